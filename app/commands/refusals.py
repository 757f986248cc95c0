"""Presses that are refused before they have a log entry: a reused id, a second tap, a rate limit, or a
client whose refusals the log only counts."""

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
from app.commands.receipts import (
    Receipt,
    Receipts,
    origin_text,
    outcome_text,
    receipt_of,
    with_log_fault,
)
from app.errors import FieldError, InputError
from app.i18n import BETWEEN, Text, TextLike, joined, say
from app.panel.widgets.families import PressCommand
from app.robot.command_status import Outcome
from app.ros_logging import RobotLog, rosout_extra


class EarlyRefusals:
    """Makes the receipts of early refusals for one robot. Used on the event loop only."""

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
        """Refuses a press that may be the second tap of an earlier one. `before` is the id of that
        press, "" without one; the reason includes its result."""
        why: TextLike = say("press_too_soon")
        if (last := self._receipts.get(before)) is not None:
            label = self._dispatcher.widget(last.widget).label
            said = say("press_last_result", label=label, said=last.reason)
            why = last.reason if ends_with(last.reason, why) else joined([said, why])
        return await self.refuse(self._dispatcher.widget(widget_id), inputs, press_id, why, origin)

    def limited(
        self,
        widget_id: str,
        inputs: Mapping[str, Any],
        press_id: str,
        sentence: str = "press_too_often",
        *,
        shown: bool = False,
    ) -> Receipt:
        """Refuses a press over the rate limit. The client may repeat it later with the same id.
        `shown`: the receipt is kept for a page without scripts."""
        now = format_time(time.time())
        answer = Outcome("refused", say("refused", why=say(sentence), time=now))
        receipt = receipt_of(self._dispatcher.widget(widget_id), inputs, press_id, answer, "limit")
        if shown:
            receipt = replace(receipt, id=_own_id(press_id))
            self._receipts.keep_unlogged(receipt)
        return receipt

    def count_only(self, receipt: Receipt, origin: Origin) -> Receipt:
        """Counts a refusal without writing a log entry."""
        self._press_log.count_unlogged(origin)
        self._receipts.keep_unlogged(receipt)
        return receipt

    def unlogged_refusal(
        self, widget: PressCommand, inputs: Mapping[str, Any], press_id: str, context: PressContext
    ) -> Receipt | None:
        """The receipt of a refusal that the log only counts; None for every other press.

        Applies only to a client that has used up the log's quota of refusals. Its permitted presses are
        still sent; its refusals push no other entry out of the log.
        """
        if self._press_log.has_room(context.origin):
            return None
        _, why, cause = self._judge.judge(widget, context)
        sentence = "refused" if why else "press_not_encoded"
        if not why:
            try:
                why, cause = self._dispatcher.refusal(widget, inputs), "interlock"
            except (FieldError, InputError) as error:
                why, cause = error.text, "input"
        if not why:
            return None
        answer = Outcome("refused", say(sentence, why=why, time=format_time(time.time())))
        return self.count_only(receipt_of(widget, inputs, press_id, answer, cause), context.origin)

    async def refuse(
        self,
        widget: PressCommand,
        inputs: Mapping[str, Any],
        press_id: str,
        why: TextLike,
        origin: Origin,
    ) -> Receipt:
        """Refuses a press. The receipt has an id of its own, because the press's id belongs to another
        press or may still be used for one."""
        own_id = _own_id(press_id)
        receipt = receipt_of(widget, inputs, own_id, Outcome("refused", why), "input")
        if not self._press_log.has_room(origin):
            return self.count_only(receipt, origin)
        own = self._dispatcher.needed_inputs(widget, inputs)
        self._receipts.record_press(own_id, widget.id, origin, own)
        who = origin_text(origin)
        extra = rosout_extra(f"press {own_id} of {widget.id} by {who}: {outcome_text(widget, receipt)}")
        self._log.warning("press %s of %s by %s: %s", own_id, widget.id, who, why, extra=extra)
        receipt = with_log_fault(
            receipt, await self._press_log.refused(widget.id, own, own_id, origin, why)
        )
        self._receipts.keep(receipt)
        return receipt


def ends_with(text: TextLike, last: TextLike) -> bool:
    """Whether a text equals another one, or its last sentence does."""
    if text == last or not isinstance(text, Text) or text.code not in BETWEEN:
        return text == last
    (_, parts) = text.params[0]
    return isinstance(parts, tuple) and ends_with(parts[-1], last)


def _own_id(press_id: str) -> str:
    """An id for a refusal, beginning with its press's id."""
    return f"{press_id:.40}.{secrets.token_hex(4)}"
