"""Presses that are refused before they have a log entry: a reused id, a second tap, a rate limit, or a
client whose refusals the log only counts."""

import secrets
from dataclasses import replace

from app.audit import Origin
from app.audit.press_record import PressLog
from app.commands.dispatch import Dispatcher
from app.commands.press import Press
from app.commands.press_judge import PressJudge
from app.commands.receipts import (
    Receipt,
    Receipts,
    Refusal,
    origin_text,
    outcome_text,
    receipt_of,
    refused_receipt,
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

    async def too_soon(self, press: Press[PressCommand], before: str) -> Receipt:
        """Refuses a press that may be the second tap of an earlier one. `before` is the id of that
        press, "" without one; the reason includes its result."""
        why: TextLike = say("press_too_soon")
        if (last := self._receipts.get(before)) is not None:
            label = self._dispatcher.widget(last.widget).label
            result = say("press_last_result", label=label, said=last.reason)
            why = last.reason if ends_with(last.reason, why) else joined([result, why])
        return await self.refuse(press, why)

    def limited(
        self, press: Press[PressCommand], sentence: str = "press_too_often", *, shown: bool = False
    ) -> Receipt:
        """Refuses a press over the rate limit. The client may repeat it later with the same id.
        `shown`: the receipt is kept for a page without scripts."""
        receipt = refused_receipt(press, Refusal(say(sentence), "limit"))
        if shown:
            receipt = replace(receipt, id=_own_id(press.id))
            self._receipts.keep_unlogged(receipt)
        return receipt

    def count_only(self, receipt: Receipt, origin: Origin) -> Receipt:
        """Counts a refusal without writing a log entry."""
        self._press_log.count_unlogged(origin)
        self._receipts.keep_unlogged(receipt)
        return receipt

    def unlogged_refusal(self, press: Press[PressCommand]) -> Receipt | None:
        """The receipt of a refusal that the log only counts; None for every other press.

        Applies only to a client that has used up the log's quota of refusals. Its permitted presses are
        still sent; its refusals push no other entry out of the log.
        """
        if self._press_log.has_room(press.origin):
            return None
        if refusal := self._judge.judge(press).refusal:
            receipt = refused_receipt(press, refusal)
        elif refusal := self._not_encoded(press):
            receipt = refused_receipt(press, refusal, "press_not_encoded")
        else:
            return None
        return self.count_only(receipt, press.origin)

    def _not_encoded(self, press: Press[PressCommand]) -> Refusal | None:
        """Why a permitted press would not be sent; None if it would."""
        try:
            reason = self._dispatcher.refusal(press)
        except (FieldError, InputError) as error:
            return Refusal(error.text, "input")
        return Refusal(reason, "interlock") if reason else None

    async def refuse(self, press: Press[PressCommand], why: TextLike) -> Receipt:
        """Refuses a press. The receipt has an id of its own, because the press's id belongs to another
        press or may still be used for one."""
        press = replace(press, id=_own_id(press.id))
        receipt = receipt_of(press, Outcome("refused", why), "input")
        logged = press.logged()
        if not self._press_log.has_room(logged.origin):
            return self.count_only(receipt, logged.origin)
        self._receipts.record_press(logged)
        who, widget = origin_text(logged.origin), press.widget
        extra = rosout_extra(
            f"press {press.id} of {widget.id} by {who}: {outcome_text(widget, receipt)}"
        )
        self._log.warning("press %s of %s by %s: %s", press.id, widget.id, who, why, extra=extra)
        receipt = with_log_fault(receipt, await self._press_log.refused(logged, why))
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
