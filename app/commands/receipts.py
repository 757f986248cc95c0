"""Receipts of presses and holds."""

import hashlib
import json
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Final, Protocol, cast

from app.audit import Entry, Origin
from app.audit.press_record import PendingEntry
from app.commands.reason_codes import reason_code
from app.errors import Cause
from app.i18n import TextLike, render, say
from app.panel.template import needed_inputs
from app.panel.widgets.families import Command, EntryWidget, PressCommand
from app.robot.command_status import Outcome, OutcomeCode

RECEIPTS_KEPT: Final = 1000
MAX_FINAL_CHECKS: Final = 20  # if data keeps arriving faster than it is ingested, nothing is sent
PAST_IDS_KEPT: Final = 20_000  # ids of presses whose receipts are no longer kept
MAX_LOGGED_CHARS: Final = 300
MAX_KEPT_CHARS: Final = 4000  # characters of all inputs of a press
GOOD_OUTCOMES: Final = frozenset({"published", "confirmed", "accepted", "succeeded"})
_sorted: Final = json.JSONEncoder(sort_keys=True).encode


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

    def record_press(
        self, press_id: str, widget: str, origin: Origin, inputs: Mapping[str, Any]
    ) -> None:
        """Records a new press."""
        if self._recorder is not None:
            self._recorder.record_press(press_id, widget, origin_text(origin), inputs)

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


def receipt_of(
    widget: Command,
    inputs: Mapping[str, Any],
    press_id: str,
    answer: Outcome,
    cause: Cause = "",
) -> Receipt:
    """A receipt for an outcome, dated now."""
    at = datetime.now(UTC).isoformat(timespec="milliseconds")
    own, entered = ({**of} if _short(of) else {} for of in (needed_inputs(widget, inputs), inputs))
    outcome = answer.outcome, answer.text, at, cause
    return Receipt(press_id, widget.id, *outcome, own, fingerprint(inputs), entered)


def recalled_receipt(
    widget: PressCommand, inputs: Mapping[str, Any], press: Entry, last: Entry | None, cause: Cause
) -> Receipt:
    """The receipt of a press from the operator's log; without a `last` entry the result is unknown."""
    if last is None:
        answer, at = Outcome("unknown", say("press_unknown_server_ended")), press.at
    else:
        answer, at = Outcome(cast(OutcomeCode, last.outcome), last.reason_text), last.at
    receipt = receipt_of(widget, inputs, press.press, answer, cause)
    wall = datetime.fromtimestamp(at / 1000, UTC).isoformat(timespec="milliseconds")
    return replace(receipt, at=wall, recalled=True)


def fingerprint(inputs: Mapping[str, Any]) -> str:
    """A hash of the inputs, which are JSON values."""
    return hashlib.sha256(_sorted(inputs).encode()).hexdigest()


def _short(inputs: Mapping[str, Any]) -> bool:
    plain = all(isinstance(value, str | int | float) for value in inputs.values())
    return plain and sum(len(str(v)) + len(k) for k, v in inputs.items()) <= MAX_KEPT_CHARS


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
