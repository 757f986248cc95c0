"""The status of one alarm: its state, its occurrence, and whether it is shelved, suppressed or out of
service. Values that don't change; each function returns the next status."""

import math
import time
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final, NamedTuple

from app.alarms.states import PLAIN, AlarmKind, Event, State, find_row
from app.clock import format_age
from app.i18n import Text, say

SHIFT_S: Final = 8 * 3600.0
HIGH: Final = 1  # the highest priority


class Moment(NamedTuple):
    """`monotonic` seconds give the order, `wall` seconds since the epoch are shown."""

    monotonic: float
    wall: float


def now() -> Moment:
    return Moment(time.monotonic(), time.time())


class Override(StrEnum):
    OUT_OF_SERVICE = "out_of_service"
    SHELVED = "shelved"
    SUPPRESSED = "suppressed"


@dataclass(frozen=True, slots=True)
class AlarmRules:
    """How an alarm behaves. `priorities` are those of its levels, from the first one on; 1 is high.
    `raise_unknown`: it is raised when its source becomes unknown. `max_shelf_s`: how long it may be
    shelved at most."""

    kind: AlarmKind = PLAIN
    priorities: tuple[int, ...] = (3,)
    raise_unknown: bool = False
    max_shelf_s: float = SHIFT_S

    def priority(self, level: int) -> int:
        """The priority of a level; the first one's for 0."""
        return self.priorities[max(level, 1) - 1]


@dataclass(frozen=True, slots=True)
class TakenOut:
    """Shelved until a time (`until`, monotonic seconds), or out of service. `actor` did it."""

    since: Moment
    reason: str
    actor: str
    until: float = math.inf


@dataclass(frozen=True, slots=True)
class AlarmStatus:
    """`level` is that of the condition as last known, 0 for clear. `raised_level` is the highest one
    that was raised and is not acknowledged. `occurrence` counts how often it was raised."""

    state: State = State.NORMAL
    level: int = 0
    raised_level: int = 0
    occurrence: int = 0
    raised_at: Moment | None = None
    unknown_since: Moment | None = None
    shelf: TakenOut | None = None
    out_of_service: TakenOut | None = None
    suppressed_since: Moment | None = None

    @property
    def override(self) -> Override | None:
        """Out of service wins over shelved, and shelved over suppressed by design."""
        if self.out_of_service:
            return Override.OUT_OF_SERVICE
        if self.shelf:
            return Override.SHELVED
        return Override.SUPPRESSED if self.suppressed_since else None

    @property
    def is_normal(self) -> bool:
        return self.state is State.NORMAL

    @property
    def is_standing(self) -> bool:
        """Whether it counts: it is not normal, and neither shelved, suppressed nor out of service."""
        return not self.is_normal and self.override is None

    def is_same_to_operators(self, other: "AlarmStatus") -> bool:
        """Whether nothing differs but that the source of a normal alarm is known."""
        is_normal = self.is_normal and other.is_normal and self.override == other.override
        return self == other or (is_normal and self.override is None)

    @property
    def is_acknowledged(self) -> bool:
        return self.state in (State.NORMAL, State.ACKNOWLEDGED, State.LATCHED_ACKNOWLEDGED)


NORMAL: Final = AlarmStatus()


@dataclass(frozen=True, slots=True)
class ActResult:
    """The status after an act. `refusal` is the sentence that refuses it; `repeated`: it
    was done already, and nothing has changed."""

    status: AlarmStatus
    refusal: Text | None = None
    repeated: bool = field(default=False, kw_only=True)


def update_level(status: AlarmStatus, rules: AlarmRules, level: int | None, now: Moment) -> AlarmStatus:
    """The status with the level of the condition; None: the source is unknown."""
    if level is None:
        return _mark_unknown(status, rules, now)
    known = replace(status, unknown_since=None)
    changed = _apply_level(known, rules, level, now)
    if changed.shelf and level and rules.priority(level) == HIGH:
        return _end_override(changed, replace(changed, shelf=None), rules, now)
    return changed


def _apply_level(status: AlarmStatus, rules: AlarmRules, level: int, now: Moment) -> AlarmStatus:
    changed = replace(status, level=level)
    if level == 0:
        return _transit(changed, rules, Event.CLEAR, now)
    if status.state is State.ACKNOWLEDGED and status.level == 0:
        # Acknowledged while its source was unknown: it may have returned in the meantime.
        return _transit(replace(changed, state=State.NORMAL), rules, Event.ACTIVE, now)
    if status.state not in (State.UNACKNOWLEDGED, State.ACKNOWLEDGED):
        return _transit(changed, rules, Event.ACTIVE, now)
    if level > status.raised_level:
        return _transit(changed, rules, Event.RISES, now)
    return _lower_raised(changed) if status.is_acknowledged else changed


def _lower_raised(status: AlarmStatus) -> AlarmStatus:
    """An acknowledged level that falls is raised again when it rises."""
    return replace(status, raised_level=status.level)


def _mark_unknown(status: AlarmStatus, rules: AlarmRules, now: Moment) -> AlarmStatus:
    if status.unknown_since:
        return status
    unknown = replace(status, unknown_since=now)
    if rules.raise_unknown and status.is_normal:
        return _transit(unknown, rules, Event.ACTIVE, now)
    return unknown


def _transit(status: AlarmStatus, rules: AlarmRules, event: Event, now: Moment) -> AlarmStatus:
    row = find_row(status.state, event, rules.kind)
    if row.next is State.NORMAL:
        return _return_to_normal(status)
    if not row.occurrence:
        return replace(status, state=row.next)
    return replace(
        status,
        state=row.next,
        raised_level=max(status.level, 1),
        occurrence=status.occurrence + 1,
        raised_at=now,
    )


def _return_to_normal(status: AlarmStatus) -> AlarmStatus:
    return replace(status, state=State.NORMAL, raised_level=0)


def acknowledge(status: AlarmStatus, rules: AlarmRules, occurrence: int) -> ActResult:
    """The acknowledgement of one occurrence. One that the operator has not seen is refused."""
    if status.is_acknowledged:
        return ActResult(status, repeated=True)
    if occurrence != status.occurrence:
        return ActResult(status, say("alarm_came_again"))
    row = find_row(status.state, Event.ACKNOWLEDGE, rules.kind)
    # Not normal while its source is unknown: acknowledged, and clear as last known.
    unknown = status.unknown_since and row.next is State.NORMAL
    return ActResult(_lower_raised(replace(status, state=State.ACKNOWLEDGED if unknown else row.next)))


def reset(status: AlarmStatus, rules: AlarmRules) -> ActResult:
    """The reset of a latched alarm that has returned and is acknowledged."""
    row = find_row(status.state, Event.RESET, rules.kind)
    if row.refusal:
        return ActResult(status, row.refusal)
    if row.next is status.state:
        return ActResult(status, repeated=True)
    if status.unknown_since:
        return ActResult(status, say("alarm_source_unknown"))
    return ActResult(_return_to_normal(status))


def shelve(status: AlarmStatus, rules: AlarmRules, shelf: TakenOut) -> ActResult:
    """The status on a shelf. Refused for high priority, without a reason, and for longer than the rules
    allow."""
    if refusal := _shelve_refusal(status, rules, shelf):
        return ActResult(status, refusal)
    return ActResult(replace(status, shelf=shelf))


def _shelve_refusal(status: AlarmStatus, rules: AlarmRules, shelf: TakenOut) -> Text | None:
    if status.out_of_service:
        return say("alarm_out_of_service")
    if rules.priority(max(status.level, status.raised_level)) == HIGH:
        return say("alarm_shelve_high")
    if not shelf.reason.strip():
        return say("alarm_reason_missing")
    if 0 < shelf.until - shelf.since.monotonic <= rules.max_shelf_s:
        return None
    return say("alarm_shelve_too_long", limit=format_age(rules.max_shelf_s))


def unshelve(status: AlarmStatus, rules: AlarmRules, now: Moment) -> ActResult:
    if status.shelf is None:
        return ActResult(status, repeated=True)
    return ActResult(_end_override(status, replace(status, shelf=None), rules, now))


def remove_from_service(status: AlarmStatus, taken_out: TakenOut) -> ActResult:
    """The status out of service, which ends a shelf. Refused without a reason."""
    if status.out_of_service:
        return ActResult(status, repeated=True)
    if not taken_out.reason.strip():
        return ActResult(status, say("alarm_reason_missing"))
    return ActResult(replace(status, out_of_service=taken_out, shelf=None))


def return_to_service(status: AlarmStatus, rules: AlarmRules, now: Moment) -> ActResult:
    if status.out_of_service is None:
        return ActResult(status, repeated=True)
    return ActResult(_end_override(status, replace(status, out_of_service=None), rules, now))


def update_suppression(
    status: AlarmStatus, rules: AlarmRules, suppressed: bool, now: Moment
) -> AlarmStatus:
    """The status with the condition of `while`, which suppresses by design; unknown counts as false."""
    if suppressed == (status.suppressed_since is not None):
        return status
    if suppressed:
        return replace(status, suppressed_since=now)
    return _end_override(status, replace(status, suppressed_since=None), rules, now)


def expire(status: AlarmStatus, rules: AlarmRules, now: Moment) -> AlarmStatus:
    """The status after the time of its shelf."""
    if status.shelf and now.monotonic >= status.shelf.until:
        return _end_override(status, replace(status, shelf=None), rules, now)
    return status


def _end_override(
    before: AlarmStatus, after: AlarmStatus, rules: AlarmRules, now: Moment
) -> AlarmStatus:
    """The status where an override has ended. An active alarm is raised as a new occurrence. One that
    has returned is normal, or needs its reset if it is latched."""
    if before.override is None or after.override is not None:
        return after
    if after.level > 0:
        return _transit(replace(after, state=State.NORMAL), rules, Event.ACTIVE, now)
    if after.is_normal or after.unknown_since:
        return after
    if not rules.kind.latched:
        return _return_to_normal(after)
    needed = State.LATCHED_UNACKNOWLEDGED if rules.kind.acknowledge else State.LATCHED_ACKNOWLEDGED
    return replace(after, state=needed)
