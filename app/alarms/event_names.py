"""What happened to an alarm at a transition, by its name."""

from collections.abc import Mapping
from typing import Final

from app.alarms.status import AlarmStatus, Moment

OF_ACTS: Final[Mapping[str, str]] = {
    "acknowledge": "acknowledged",
    "reset": "reset",
    "shelve": "shelved",
    "unshelve": "unshelved",
    "out_of_service": "out_of_service",
    "in_service": "in_service",
}
EVENT_NAMES: Final = (
    "raised", "returned", *OF_ACTS.values(), "suppressed", "unsuppressed", "unknown", "known",
    "changed",
)  # fmt: skip


def event_of(before: AlarmStatus, after: AlarmStatus, act: str = "") -> str:
    """One of `EVENT_NAMES`. An alarm that is raised at the end of a shelf is raised."""
    if after.occurrence != before.occurrence:
        return "raised"
    if act:
        return OF_ACTS[act]
    if before.shelf and not after.shelf:
        return "unshelved"
    if bool(before.suppressed_since) != bool(after.suppressed_since):
        return "suppressed" if after.suppressed_since else "unsuppressed"
    if before.level and not after.level:
        return "returned"
    if bool(before.unknown_since) != bool(after.unknown_since):
        return "unknown" if after.unknown_since else "known"
    return "changed"


def lasted(before: AlarmStatus, after: AlarmStatus, at: Moment) -> float | None:
    """The seconds since it was raised; None where it is raised now, or was not."""
    if after.occurrence != before.occurrence or before.raised_at is None:
        return None
    return max(0.0, at.monotonic - before.raised_at.monotonic)
