"""The result of a stop in a few words, for the button itself. Pure."""

from collections.abc import Collection
from typing import Final

from app.records.entry import OutcomeCode
from app.system.clock import format_time
from app.system.texts import TextLike, say

# Of a stop that was only sent the panel does not know that it stopped anything.
REPORTED: Final[Collection[str]] = frozenset({"confirmed", "succeeded"})
SENT: Final[Collection[str]] = frozenset({"published", "accepted"})
FAILED: Final = {
    "refused": "stop_not_sent",
    "rejected": "stop_rejected",
    "aborted": "stop_rejected",
    "canceled": "stop_rejected",
}


def stop_brief(outcome: OutcomeCode, wall: float) -> TextLike:
    """What became of a stop; `wall` is the time of its receipt in seconds since the epoch."""
    if outcome in REPORTED:
        return say("stop_stopped", time=format_time(wall))
    if outcome in SENT:
        return say("stop_sent", time=format_time(wall))
    return say(FAILED.get(outcome, "stop_no_answer"))
