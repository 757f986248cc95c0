"""Receipts of presses and holds."""

import time
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from typing import Any, Final, NamedTuple, Protocol, cast

from app.cell.commands.press import Press
from app.cell.permission.roles import CONFIRMED_CODES
from app.cell.view.stop_brief import stop_brief
from app.panel.widgets.families import Command, EntryWidget
from app.panel.widgets.templated import is_stop
from app.records import Entry, Origin
from app.records.entry import GOOD_OUTCOMES as GOOD_OUTCOMES
from app.records.entry import Outcome, OutcomeCode
from app.records.press_record import PendingEntry
from app.ros.dialects.peer_traits import EVERY_SENTENCES
from app.system.clock import format_time
from app.system.errors import Cause
from app.system.texts import BETWEEN, Text, TextLike, joined, render, say

# The stable name of a receipt's reason, for programs: the code of the sentence that says why.

# Sentences that only frame another one → the parameter with that sentence.
FRAMES: Final[Mapping[str, str]] = {
    "refused": "why",
    "press_not_encoded": "why",
    "hold_ended": "why",
    "with_stop": "said",
    "with_reply": "said",
    "log_not_on_disk": "said",
}
# They follow a reason and are none themselves.
ADVICE: Final = frozenset(
    {*(s.timeout_hint for s in EVERY_SENTENCES if s.timeout_hint), *CONFIRMED_CODES}
)


def reason_code(reason: TextLike) -> str | None:
    """The code of the innermost sentence: "Not sent at 10:04:32: Locked: …" has that of the lock. Of
    several sentences the last one counts. None for a reason without a sentence of the catalogue."""
    if not isinstance(reason, Text) or not reason.is_sentence:
        return None
    about = dict(reason.params)
    if reason.code in BETWEEN:
        parts = about["parts"]
        assert isinstance(parts, tuple)  # as `joined` makes it
        codes = [code for part in parts if (code := reason_code(part)) and code not in ADVICE]
        return codes[-1] if codes else None
    framed = about.get(FRAMES.get(reason.code, ""))
    inner = reason_code(framed) if isinstance(framed, Text) else None
    return inner or reason.code


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
    true for a receipt restored from the operator's log after a restart. `brief` says the same in a few
    words, for the button of a stop; "" for other buttons. `parts` are, of a press that stops several
    robots, the receipts of each by the robot's id.
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
    brief: TextLike = ""
    parts: Mapping[str, "Receipt"] = field(default_factory=dict)

    @property
    def wall(self) -> float:
        """When it was made, in seconds since the epoch."""
        return datetime.fromisoformat(self.at).timestamp()

    @property
    def code(self) -> str | None:
        return reason_code(self.reason)

    def as_json(self) -> dict[str, Any]:
        shown: dict[str, Any] = {
            "id": self.id,
            "widget": self.widget,
            "outcome": self.outcome,
            "code": self.code,
            "reason": self.reason,
            "at": self.at,
        }
        if self.brief:
            shown["brief"] = self.brief
        if self.parts:
            receipts = ({"robot": robot, **part.as_json()} for robot, part in self.parts.items())
            shown["receipts"] = list(receipts)
        return shown


class PressRecorder(Protocol):
    """Records each press when it is made, and each receipt, corrected ones included."""

    def record_press(self, press_id: str, widget: str, who: str, inputs: Mapping[str, Any]) -> None: ...
    def record_receipt(self, receipt: Receipt) -> None: ...


def receipt_of(press: Press[Command], answer: Outcome, cause: Cause = "") -> Receipt:
    """A receipt for an outcome, dated now."""
    now = datetime.now(UTC)
    outcome = answer.outcome, answer.text, now.isoformat(timespec="milliseconds"), cause
    inputs = _if_short(press.needed_inputs)
    return Receipt(
        press.id,
        press.widget.id,
        *outcome,
        inputs,
        press.fingerprint,
        _if_short(press.inputs),
        brief=stop_brief(answer.outcome, now.timestamp()) if is_stop(press.widget) else "",
    )


def with_confirmation(receipt: Receipt, press: Press[Command]) -> Receipt:
    """The receipt, with who confirmed its press; as it is if no one did, or if it was refused."""
    if press.confirmed is None or receipt.outcome == "refused":
        return receipt
    return replace(receipt, reason=joined((receipt.reason, press.confirmed.sentence)))


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
    receipt = replace(receipt_of(press, answer, cause), at=wall, recalled=True)
    return replace(receipt, brief=stop_brief(answer.outcome, at / 1000)) if receipt.brief else receipt


def _if_short(inputs: Mapping[str, Any]) -> dict[str, Any]:
    """The inputs if they are few and short, else none."""
    plain = all(isinstance(value, str | int | float) for value in inputs.values())
    short = plain and sum(len(str(v)) + len(k) for k, v in inputs.items()) <= MAX_KEPT_CHARS
    return {**inputs} if short else {}


def corrected(receipt: Receipt, answer: Outcome) -> Receipt:
    brief = stop_brief(answer.outcome, receipt.wall) if receipt.brief else ""
    return replace(receipt, outcome=answer.outcome, reason=answer.text, cause="", brief=brief)


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
