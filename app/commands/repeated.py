"""Presses that are sent again after a restart of the server: the operator's log knows them."""

from collections.abc import Mapping
from typing import Any

from app.audit import Entry, Origin, Repeated, same_values
from app.commands.dispatch import Dispatcher
from app.commands.receipts import Receipt, named, recalled
from app.commands.refusals import EarlyRefusals
from app.errors import Cause, FieldError, InputError
from app.i18n import say
from app.panel.widgets.families import PressCommand
from app.permission.interlocks import PERMITTED
from app.permission.press_permission import cause_of
from app.ros_logging import RobotLog


class RepeatedPresses:
    """Of one panel; used on the event loop only."""

    def __init__(self, dispatcher: Dispatcher, early_refusals: EarlyRefusals, log: RobotLog) -> None:
        self._dispatcher = dispatcher
        self._early_refusals = early_refusals
        self._log = log

    async def receipt(
        self, widget: PressCommand, inputs: Mapping[str, Any], origin: Origin, known: Repeated
    ) -> Receipt:
        """What the log knows of the press; a refusal where its id is that of another press."""
        press, told = known.press, known.told
        own = self._dispatcher.needed(widget, inputs)
        if press.widget != widget.id or not same_values(press.values, own):
            why = say("press_reused", id=press.press)
            return await self._early_refusals.refuse(widget, inputs, press.press, why, origin)
        receipt = recalled(widget, inputs, press, told, self._cause(widget, inputs, told))
        self._log.info("press %s of %s by %s is that of entry %d: %s: %s", press.press, widget.id,
                named(origin), press.seq, receipt.outcome, receipt.reason)  # fmt: skip
        return receipt

    def _cause(self, widget: PressCommand, inputs: Mapping[str, Any], told: Entry | None) -> Cause:
        """Why it was refused, as far as an entry tells: inputs that never fit were refused for that."""
        if told is None or told.outcome not in ("refused", "timed_out"):
            return ""
        if told.outcome == "timed_out":
            return "time"
        if told.verdict != PERMITTED.code:
            return cause_of(told.verdict or "log")
        try:
            self._dispatcher.refusal(widget, inputs)
        except (FieldError, InputError):
            return "input"
        return "interlock"
