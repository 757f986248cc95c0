"""Who presses and the result: what presses and holds have in common."""

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
MOST_LOOKS: Final = 20  # at news that come faster than they are taken in: then nothing is sent
PAST_KEPT: Final = 20_000  # ids of presses whose receipts are not kept any more
LONGEST_LOGGED: Final = 300
LONGEST_KEPT: Final = 4000  # characters of all inputs of a press
FINE: Final = frozenset({"published", "confirmed", "accepted", "succeeded"})
_sorted: Final = json.JSONEncoder(sort_keys=True).encode


@dataclass(frozen=True, slots=True)
class Receipt:
    """The result of a press. `reason` is a sentence for the operator, `code` its stable name (None
    without a reason), and `cause` why the press was refused.

    `inputs` are those that the widget needs, `entered` all that the press came with, if they are few
    and short: a page without scripts shows them again. `fingerprint` tells these from any others.
    `recalled`: it is what the operator's log knew of a press that this server did not make.
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


class Witness(Protocol):
    """Who is told of each press when it is made, and of each receipt, also of a corrected one."""

    def pressed(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None: ...
    def answered(self, receipt: Receipt) -> None: ...


class Receipts:
    """The last receipts, by the ids of their presses."""

    def __init__(self, witness: Witness | None = None) -> None:
        self._witness = witness
        self._receipts: OrderedDict[str, Receipt] = OrderedDict()
        self._left_out: OrderedDict[str, Receipt] = OrderedDict()
        self._recalled: OrderedDict[str, Receipt] = OrderedDict()
        self._past: OrderedDict[str, None] = OrderedDict()

    def get(self, press_id: str) -> Receipt | None:
        """The receipt of a press, as it is known now."""
        return self.made(press_id) or self._recalled.get(press_id)

    def made(self, press_id: str) -> Receipt | None:
        """The same, of a press of this server's own: what the log knows of others may change."""
        return self._receipts.get(press_id) or self._left_out.get(press_id)

    def is_past(self, press_id: str) -> bool:
        """Whether this press was made, though its receipt is not kept any more."""
        return press_id in self._past

    def begin(self, press_id: str, widget: str, origin: Origin, inputs: Mapping[str, Any]) -> None:
        """A press was made."""
        if self._witness is not None:
            self._witness.pressed(press_id, widget, named(origin), inputs)

    def keep(self, receipt: Receipt) -> None:
        if receipt.recalled:
            _keep(self._recalled, receipt)
            return
        if self._witness is not None:
            self._witness.answered(receipt)
        for press_id in _keep(self._receipts, receipt):
            self._past[press_id] = None
        while len(self._past) > PAST_KEPT:
            self._past.popitem(last=False)

    def keep_left_out(self, receipt: Receipt) -> None:
        """A refusal that the log only counts: however many these are, they displace no other."""
        _keep(self._left_out, receipt)


def _keep(receipts: OrderedDict[str, Receipt], receipt: Receipt) -> list[str]:
    """Keeps it, and as many as there is room for; the ids of those that are not kept any more."""
    receipts[receipt.id] = receipt
    return [receipts.popitem(last=False)[0] for _ in range(len(receipts) - RECEIPTS_KEPT)]


def receipt_of(
    widget: Command,
    inputs: Mapping[str, Any],
    press_id: str,
    answer: Outcome,
    cause: Cause = "",
) -> Receipt:
    """The result of a press just now."""
    at = datetime.now(UTC).isoformat(timespec="milliseconds")
    own, entered = ({**of} if _short(of) else {} for of in (needed_inputs(widget, inputs), inputs))
    told = answer.outcome, answer.text, at, cause
    return Receipt(press_id, widget.id, *told, own, fingerprint(inputs), entered)


def recalled(
    widget: PressCommand, inputs: Mapping[str, Any], press: Entry, told: Entry | None, cause: Cause
) -> Receipt:
    """What the operator's log knows of a press: where it was told nothing, no one will know."""
    if told is None:
        answer, at = Outcome("unknown", say("log_ended")), press.at
    else:
        answer, at = Outcome(cast(OutcomeCode, told.outcome), told.said), told.at
    receipt = receipt_of(widget, inputs, press.press, answer, cause)
    wall = datetime.fromtimestamp(at / 1000, UTC).isoformat(timespec="milliseconds")
    return replace(receipt, at=wall, recalled=True)


def fingerprint(inputs: Mapping[str, Any]) -> str:
    """The same for the same inputs only, which are what JSON has."""
    return hashlib.sha256(_sorted(inputs).encode()).hexdigest()


def _short(inputs: Mapping[str, Any]) -> bool:
    plain = all(isinstance(value, str | int | float) for value in inputs.values())
    return plain and sum(len(str(v)) + len(k) for k, v in inputs.items()) <= LONGEST_KEPT


def corrected(receipt: Receipt, answer: Outcome) -> Receipt:
    return replace(receipt, outcome=answer.outcome, reason=answer.text, cause="")


def untyped(widget: Command, receipt: Receipt) -> str:
    """The outcome, with its reason where that repeats nothing of what was typed in."""
    if receipt.cause == "input" or isinstance(widget, EntryWidget):
        return receipt.outcome
    return f"{receipt.outcome}: {render(receipt.reason)}"


def with_doubt(receipt: Receipt, doubt: TextLike) -> Receipt:
    if not doubt:
        return receipt
    return replace(receipt, reason=say("log_not_on_disk", said=receipt.reason, why=doubt))


async def closed(pending: PendingEntry, receipt: Receipt) -> Receipt:
    """The receipt, when what it says is on the disk; where it is not, it says so."""
    doubt = await pending.closed(receipt.outcome, receipt.reason)
    if pending.corrected_to is not None:  # in the meantime
        receipt = corrected(receipt, pending.corrected_to)
    return with_doubt(receipt, doubt)


def named(origin: Origin) -> str:
    return f"{origin.who} ({origin.address})" if origin.who else origin.address
