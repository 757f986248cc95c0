"""Receipts of presses and holds."""

import time
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Final, NamedTuple, Protocol, cast

from app.audit import Entry, Origin
from app.audit.press_record import LoggedPress, PendingEntry
from app.clock import format_time
from app.commands.press import Press
from app.commands.reason_codes import reason_code
from app.errors import Cause
from app.i18n import TextLike, joined, render, say
from app.panel.widgets.families import Command, EntryWidget
from app.robot.command_status import GOOD_OUTCOMES as GOOD_OUTCOMES
from app.robot.command_status import Outcome, OutcomeCode

RECEIPTS_KEPT: Final = 1000
MAX_FINAL_CHECKS: Final = 20  # if data keeps arriving faster than it is ingested, nothing is sent
PAST_IDS_KEPT: Final = 20_000  # ids of presses whose receipts are no longer kept
MAX_LOGGED_CHARS: Final = 300
MAX_KEPT_CHARS: Final = 4000  # characters of all inputs of a press


class Refusal(NamedTuple):
    """Why a press or hold is refused: the sentence, and its receipt's cause."""

    reason: TextLike
    cause: Cause


@dataclass(frozen=True, slots=True)
class Receipt:
    """The result of a press. `reason` is a sentence for the operator, `code` its stable name (None
    without a reason), and `cause` why the press was refused.

    `inputs` are those that the widget uses. `entered` are all inputs of the press, if they are few and
    short: a page without scripts shows them again. `fingerprint` is a hash of all inputs. `recalled` is
    true for a receipt restored from the operator's log after a restart.
    """

    id: str
    widget: str
    outcome: OutcomeCode
    reason: TextLike
    at: str
    cause: Cause
    inputs: Mapping[str, Any]
    fingerprint: str
    entered: Mapping[str, Any] = field(default_factory=dict)
    recalled: bool = False

    @property
    def code(self) -> str | None:
        return reason_code(self.reason)

    def as_json(self) -> dict[str, TextLike | None]:
        return {
            "id": self.id,
            "widget": self.widget,
            "outcome": self.outcome,
            "code": self.code,
            "reason": self.reason,
            "at": self.at,
        }


class PressRecorder(Protocol):
    """Records each press when it is made, and each receipt, corrected ones included."""

    def record_press(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None: ...
    def record_receipt(self, receipt: Receipt) -> None: ...


class Receipts:
    """The last receipts, by the ids of their presses."""

    def __init__(self, recorder: PressRecorder | None = None) -> None:
        self._recorder = recorder
        self._receipts: OrderedDict[str, Receipt] = OrderedDict()
        self._unlogged: OrderedDict[str, Receipt] = OrderedDict()
        self._from_log: OrderedDict[str, Receipt] = OrderedDict()
        self._past_ids: OrderedDict[str, None] = OrderedDict()

    def get(self, press_id: str) -> Receipt | None:
        """The current receipt of a press; None for unknown ids."""
        return self.get_own(press_id) or self._from_log.get(press_id)

    def get_own(self, press_id: str) -> Receipt | None:
        """The receipt of a press of this server's run. Receipts from the log are read again each time,
        as their entries may change."""
        return self._receipts.get(press_id) or self._unlogged.get(press_id)

    def is_past(self, press_id: str) -> bool:
        """Whether this press was made, but its receipt is no longer kept."""
        return press_id in self._past_ids

    def record_press(self, press: LoggedPress) -> None:
        """Records a new press."""
        if self._recorder is not None:
            who = origin_text(press.origin)
            self._recorder.record_press(press.id, press.widget, who, press.inputs)

    def keep(self, receipt: Receipt) -> None:
        if receipt.recalled:
            _keep(self._from_log, receipt)
            return
        if self._recorder is not None:
            self._recorder.record_receipt(receipt)
        for press_id in _keep(self._receipts, receipt):
            self._past_ids[press_id] = None
        while len(self._past_ids) > PAST_IDS_KEPT:
            self._past_ids.popitem(last=False)

    def keep_unlogged(self, receipt: Receipt) -> None:
        """Keeps a refusal that the log only counts, apart from others: these never displace them."""
        _keep(self._unlogged, receipt)


def _keep(receipts: OrderedDict[str, Receipt], receipt: Receipt) -> list[str]:
    """Keeps a receipt, and drops the oldest beyond `RECEIPTS_KEPT`; returns the ids dropped."""
    receipts[receipt.id] = receipt
    return [receipts.popitem(last=False)[0] for _ in range(len(receipts) - RECEIPTS_KEPT)]


def receipt_of(press: Press[Command], answer: Outcome, cause: Cause = "") -> Receipt:
    """A receipt for an outcome, dated now."""
    at = datetime.now(UTC).isoformat(timespec="milliseconds")
    outcome = answer.outcome, answer.text, at, cause
    inputs = _if_short(press.needed_inputs)
    return Receipt(
        press.id, press.widget.id, *outcome, inputs, press.fingerprint, _if_short(press.inputs)
    )


def with_confirmation(receipt: Receipt, press: Press[Command]) -> Receipt:
    """The receipt, with who confirmed its press; as it is if nobody did, or if it was refused."""
    if press.confirmed is None or receipt.outcome == "refused":
        return receipt
    return replace(receipt, reason=joined((receipt.reason, press.confirmed.said)))


def refused_receipt(press: Press[Command], refusal: Refusal, sentence: str = "refused") -> Receipt:
    """The receipt of a refusal, dated now; `sentence` is the code of the sentence with the reason."""
    text = say(sentence, why=refusal.reason, time=format_time(time.time()))
    return receipt_of(press, Outcome("refused", text), refusal.cause)


def recalled_receipt(press: Press[Command], entry: Entry, last: Entry | None, cause: Cause) -> Receipt:
    """The receipt of a press from its entries in the operator's log, the first and the last one;
    without a `last` entry the result is unknown."""
    if last is None:
        answer, at = Outcome("unknown", say("press_unknown_server_ended")), entry.at
    else:
        answer, at = Outcome(cast(OutcomeCode, last.outcome), last.reason_text), last.at
    wall = datetime.fromtimestamp(at / 1000, UTC).isoformat(timespec="milliseconds")
    return replace(receipt_of(press, answer, cause), at=wall, recalled=True)


def _if_short(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The inputs if they are few and short, else none."""
    plain = all(isinstance(value, str | int | float) for value in inputs.values())
    short = plain and sum(len(str(v)) + len(k) for k, v in inputs.items()) <= MAX_KEPT_CHARS
    return {**inputs} if short else {}


def corrected(receipt: Receipt, answer: Outcome) -> Receipt:
    return replace(receipt, outcome=answer.outcome, reason=answer.text, cause="")


def outcome_text(widget: Command, receipt: Receipt) -> str:
    """The outcome and its reason, without reasons that may repeat what the operator typed."""
    if receipt.cause == "input" or isinstance(widget, EntryWidget):
        return receipt.outcome
    return f"{receipt.outcome}: {render(receipt.reason)}"


def with_log_fault(receipt: Receipt, fault: TextLike) -> Receipt:
    """The receipt, with a note if its log entry is not on the disk."""
    if not fault:
        return receipt
    return replace(receipt, reason=say("log_not_on_disk", said=receipt.reason, why=fault))


async def close_entry(pending: PendingEntry, receipt: Receipt) -> Receipt:
    """Closes a press's log entry; returns the receipt when that is on the disk, or with a note."""
    fault = await pending.close(receipt.outcome, receipt.reason)
    if pending.corrected_to is not None:  # in the meantime
        receipt = corrected(receipt, pending.corrected_to)
    return with_log_fault(receipt, fault)


def origin_text(origin: Origin) -> str:
    return f"{origin.who} ({origin.address})" if origin.who else origin.address
