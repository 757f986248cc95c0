"""Presses that are refused before they are an entry of the log: their id was used before, they came too
soon, they are more than their client may, or their refusal is only counted."""

import secrets
import time
from collections.abc import Mapping
from dataclasses import replace
from typing import Any

from app.audit import Origin
from app.audit.press_record import PressLog
from app.clock import format_time
from app.commands.dispatch import Dispatcher
from app.commands.press_context import PressContext
from app.commands.press_judge import PressJudge
from app.commands.receipts import Receipt, Receipts, named, receipt_of, untyped, with_doubt
from app.errors import FieldError, InputError
from app.i18n import BETWEEN, Text, TextLike, joined, say
from app.panel.widgets.families import PressCommand
from app.robot.command_status import Outcome
from app.ros_logging import RobotLog, rosout_extra


class EarlyRefusals:
    """Of one panel; used on the event loop only."""

    def __init__(
        self,
        judge: PressJudge,
        dispatcher: Dispatcher,
        press_log: PressLog,
        receipts: Receipts,
        log: RobotLog,
    ) -> None:
        self._judge = judge
        self._dispatcher = dispatcher
        self._press_log = press_log
        self._receipts = receipts
        self._log = log

    async def too_soon(
        self, widget_id: str, inputs: Mapping[str, Any], press_id: str, before: str, origin: Origin
    ) -> Receipt:
        """What may be the second tap of another press, of which it says what came too: `before` is its
        id, "" where there is none."""
        why: TextLike = say("press_too_soon")
        if (last := self._receipts.get(before)) is not None:
            label = self._dispatcher.widget(last.widget).label
            said = say("press_before", label=label, said=last.reason)
            why = last.reason if ends_with(last.reason, why) else joined([said, why])
        return await self.refuse(self._dispatcher.widget(widget_id), inputs, press_id, why, origin)

    def limited(
        self,
        widget_id: str,
        inputs: Mapping[str, Any],
        press_id: str,
        sentence: str = "too_often",
        *,
        shown: bool = False,
    ) -> Receipt:
        """Of one that its client may make later, by the same id; `shown`: on a page without scripts."""
        now = format_time(time.time())
        answer = Outcome("refused", say("refused", why=say(sentence), time=now))
        receipt = receipt_of(self._dispatcher.widget(widget_id), inputs, press_id, answer, "limit")
        if shown:
            receipt = replace(receipt, id=_own_id(press_id))
            self._receipts.keep_left_out(receipt)
        return receipt

    def counted(self, receipt: Receipt, origin: Origin) -> Receipt:
        """A refusal that is no entry of the log's."""
        self._press_log.leave_out(origin)
        self._receipts.keep_left_out(receipt)
        return receipt

    def left_out(
        self, widget: PressCommand, inputs: Mapping[str, Any], press_id: str, context: PressContext
    ) -> Receipt | None:
        """The receipt of a refusal that the log only counts; None for every other press.

        Only a client that has used up the log's quota of refusals is judged here, before its entry is
        written: what it may do still goes out, and its refusals push no other entry out of the log.
        """
        if self._press_log.room(context.origin):
            return None
        _, why, cause = self._judge.ground(widget, context)
        sentence = "refused" if why else "not_encoded"
        if not why:
            try:
                why, cause = self._dispatcher.refusal(widget, inputs), "interlock"
            except (FieldError, InputError) as error:
                why, cause = error.text, "input"
        if not why:
            return None
        answer = Outcome("refused", say(sentence, why=why, time=format_time(time.time())))
        return self.counted(receipt_of(widget, inputs, press_id, answer, cause), context.origin)

    async def refuse(
        self,
        widget: PressCommand,
        inputs: Mapping[str, Any],
        press_id: str,
        why: TextLike,
        origin: Origin,
    ) -> Receipt:
        """The receipt has an id of its own: that of the press is another's, or may still be one's."""
        own_id = _own_id(press_id)
        receipt = receipt_of(widget, inputs, own_id, Outcome("refused", why), "input")
        if not self._press_log.room(origin):
            return self.counted(receipt, origin)
        own = self._dispatcher.needed(widget, inputs)
        self._receipts.begin(own_id, widget.id, origin, own)
        who = named(origin)
        extra = rosout_extra(f"press {own_id} of {widget.id} by {who}: {untyped(widget, receipt)}")
        self._log.warning("press %s of %s by %s: %s", own_id, widget.id, who, why, extra=extra)
        receipt = with_doubt(
            receipt, await self._press_log.refused(widget.id, own, own_id, origin, why)
        )
        self._receipts.keep(receipt)
        return receipt


def ends_with(text: TextLike, last: TextLike) -> bool:
    """Whether a text is another, or ends in it."""
    if text == last or not isinstance(text, Text) or text.code not in BETWEEN:
        return text == last
    (_, parts) = text.params[0]
    return isinstance(parts, tuple) and ends_with(parts[-1], last)


def _own_id(press_id: str) -> str:
    """That of a refusal, by which its press is known."""
    return f"{press_id:.40}.{secrets.token_hex(4)}"
