"""Presses that a client repeats after a restart of the server, answered from the operator's log."""

from app.audit import Entry, Repeated, same_values
from app.commands.dispatch import Dispatcher
from app.commands.press import Press
from app.commands.receipts import Receipt, origin_text, recalled_receipt
from app.commands.refusals import EarlyRefusals
from app.errors import Cause, FieldError, InputError
from app.i18n import say
from app.panel.widgets.families import PressCommand
from app.permission.press_permission import cause_of
from app.permission.verdict import PERMITTED_CODES
from app.ros_logging import RobotLog


class RepeatedPresses:
    """Answers repeated presses of one robot. Used on the event loop only."""

    def __init__(self, dispatcher: Dispatcher, early_refusals: EarlyRefusals, log: RobotLog) -> None:
        self._dispatcher = dispatcher
        self._early_refusals = early_refusals
        self._log = log

    async def receipt(self, press: Press[PressCommand], known: Repeated) -> Receipt:
        """The receipt from the log; a refusal if the id belongs to a different press."""
        entry, last = known.press, known.last_entry
        if entry.widget != press.widget.id or not same_values(entry.values, press.needed_inputs):
            return await self._early_refusals.refuse(press, say("press_id_reused", id=press.id))
        receipt = recalled_receipt(press, entry, last, self._cause(press, last))
        self._log.info("press %s of %s by %s repeats entry %d: %s: %s", press.id, press.widget.id,
                origin_text(press.origin), entry.seq, receipt.outcome, receipt.reason)  # fmt: skip
        return receipt

    def _cause(self, press: Press[PressCommand], last: Entry | None) -> Cause:
        """The cause of a refusal, as far as the entry shows it. Inputs that are invalid now were
        invalid then."""
        if last is None or last.outcome not in ("refused", "timed_out"):
            return ""
        if last.outcome == "timed_out":
            return "time"
        if last.verdict not in PERMITTED_CODES:
            return cause_of(last.verdict or "log")
        try:
            self._dispatcher.refusal(press)
        except (FieldError, InputError):
            return "input"
        return "interlock"
