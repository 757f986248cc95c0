"""The receipt of a press that stops several robots, made of the receipts of each. Pure."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Final

from app.cell.commands.press import MAX_ID_LENGTH
from app.cell.commands.receipts import Receipt
from app.cell.view.stop_brief import REPORTED
from app.records.entry import GOOD_OUTCOMES, OutcomeCode
from app.system.clock import format_time
from app.system.texts import Text, TextLike, joined, number, say

# The sentence of a robot that may go on, by the outcome; that of a lost link by the receipt's cause.
FAILED: Final[Mapping[OutcomeCode, str]] = {
    "unknown": "stop_no_answer_of",
    "timed_out": "stop_no_answer_of",
}


@dataclass(frozen=True, slots=True)
class StopOutcome:
    """The receipt of the press that stops one robot; `name` is the robot's."""

    robot: str
    name: TextLike
    receipt: Receipt

    @property
    def is_good(self) -> bool:
        return self.receipt.outcome in GOOD_OUTCOMES

    @property
    def sentence(self) -> TextLike:
        """Why the robot may go on, and what stops it then."""
        code = FAILED.get(self.receipt.outcome, "stop_failed_of")
        return say("stop_no_link_of" if self.receipt.cause == "link" else code, robot=self.name)


def id_of_robot(press_id: str, robot: str) -> str:
    """The id of the press that stops one robot: the same for the same press."""
    own = f"{press_id}.{robot}"
    if len(own) <= MAX_ID_LENGTH:
        return own
    return hashlib.sha256(own.encode()).hexdigest()[:MAX_ID_LENGTH]


def receipt_of_several(press_id: str, stops: Sequence[StopOutcome]) -> Receipt:
    """The receipt of a press that stops several robots: its outcome and cause are those of the first
    robot that may go on, else of the first. What may go on comes first in its sentence."""
    failed = [stop for stop in stops if not stop.is_good]
    first = (failed or stops)[0].receipt
    latest = max((stop.receipt for stop in stops), key=lambda receipt: receipt.wall)
    time = format_time(latest.wall)
    reported = [stop.name for stop in stops if stop.receipt.outcome in REPORTED]
    sent = [stop.name for stop in stops if stop.is_good and stop.receipt.outcome not in REPORTED]
    good = (
        say(code, robots=joined(names, "between_names"), time=time)
        for code, names in (("stop_stopped_all_of", reported), ("stop_sent_all_of", sent))
        if names
    )
    return replace(
        first,
        id=press_id,
        at=latest.at,
        reason=joined((*(stop.sentence for stop in failed), *good)),
        brief=_brief([stop.name for stop in failed], len(stops), time, all_reported=not sent),
        parts={stop.robot: stop.receipt for stop in stops},
    )


def _brief(failed: Sequence[TextLike], count: int, time: Text, *, all_reported: bool) -> TextLike:
    if len(failed) == 1:
        return say("stop_one_failed", robot=failed[0])
    if failed:
        return say("stop_some_failed", failed=number(str(len(failed))), count=number(str(count)))
    return say("stop_all_stopped" if all_reported else "stop_all_sent", time=time)
