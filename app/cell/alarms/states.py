"""The states of an alarm after ISA-18.2-2016 and IEC 62682, as one table, and how they are applied to
an alarm: delays, shelving, suppression and out of service."""

import math
import time
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from enum import StrEnum
from typing import Final, Literal, NamedTuple, cast

from app.cell.alarms.published import AlarmEntry
from app.panel.alarm import Alarm, inhibited_controls
from app.panel.model import Panel
from app.panel.robot_panels import widget_robots
from app.system.clock import format_age
from app.system.texts import Text, TextLike, say
from app.system.texts.text import together

# The states of an alarm after ISA-18.2-2016 and IEC 62682, as one table.
#
# The table is for an alarm that is not shelved, suppressed or out of service; under one of these it
# runs on unseen.


class State(StrEnum):
    NORMAL = "normal"
    UNACKNOWLEDGED = "unacknowledged"
    ACKNOWLEDGED = "acknowledged"
    RETURNED_UNACKNOWLEDGED = "returned_unacknowledged"
    LATCHED_UNACKNOWLEDGED = "latched_unacknowledged"
    LATCHED_ACKNOWLEDGED = "latched_acknowledged"


class Event(StrEnum):
    """`ACTIVE`: the condition is met, after its on-delay. `RISES`: a level above the one raised is
    reached. `CLEAR`: the condition is no longer met, after its off-delay."""

    ACTIVE = "active"
    RISES = "rises"
    CLEAR = "clear"
    ACKNOWLEDGE = "acknowledge"
    RESET = "reset"


@dataclass(frozen=True, slots=True)
class AlarmKind:
    """`acknowledge`: the alarm needs to be acknowledged. `latched`: it needs a reset after its return
    to normal."""

    acknowledge: bool = True
    latched: bool = False


PLAIN: Final = AlarmKind()


class TransitionRow(NamedTuple):
    """A row of the table: what an event does in a state, for the kinds of alarm that `acknowledge` and
    `latched` select; None selects both. `occurrence`: a new one begins, with its sound."""

    state: State
    event: Event
    next: State
    acknowledge: bool | None = None
    latched: bool | None = None
    occurrence: bool = False
    refusal: Text | None = None

    def selects(self, kind: AlarmKind) -> bool:
        """Whether it is for this kind of alarm."""
        return self.acknowledge in (None, kind.acknowledge) and self.latched in (None, kind.latched)


STILL_ACTIVE: Final = say("alarm_still_active")
NOT_LATCHED: Final = say("alarm_not_latched")
N, UA, AA, RU, LU, LA = State
_RAISED: Final = tuple(
    TransitionRow(state, event, UA if needed else AA, acknowledge=needed, occurrence=True)
    for state, event in (
        *((state, Event.ACTIVE) for state in (N, RU, LU, LA)),
        *((state, Event.RISES) for state in (UA, AA)),
    )
    for needed in (True, False)
)
_REFUSED: Final = tuple(
    TransitionRow(state, Event.RESET, state, latched=latched, refusal=refusal)
    for state, latched, refusal in (
        (UA, True, STILL_ACTIVE),
        (AA, True, STILL_ACTIVE),
        (LU, True, say("alarm_acknowledge_first")),
        *((state, False, NOT_LATCHED) for state in (UA, AA, RU)),
    )
)
TABLE: Final = (
    *_RAISED,
    TransitionRow(UA, Event.CLEAR, RU, latched=False),
    TransitionRow(UA, Event.CLEAR, LU, latched=True),
    TransitionRow(AA, Event.CLEAR, N, latched=False),
    TransitionRow(AA, Event.CLEAR, LA, latched=True),
    TransitionRow(UA, Event.ACKNOWLEDGE, AA),
    TransitionRow(RU, Event.ACKNOWLEDGE, N),
    TransitionRow(LU, Event.ACKNOWLEDGE, LA),
    TransitionRow(LA, Event.RESET, N),
    *_REFUSED,
)
KINDS: Final = tuple(AlarmKind(ack, latched) for ack in (True, False) for latched in (True, False))
_ROWS: Final = {
    (row.state, row.event, kind): row for row in TABLE for kind in KINDS if row.selects(kind)
}


def find_row(state: State, event: Event, kind: AlarmKind) -> TransitionRow:
    """The row for an event in a state. Without one in the table, the state stays: an act is done
    already."""
    return _ROWS.get((state, event, kind)) or TransitionRow(state, event, state)


# Delays and deadbands: from the values of a source to the level of an alarm's condition.

LimitName = Literal["low", "high", "low_low", "high_high"]
# The level of each limit. Two limits with the same level are at different ends of the range.
LIMIT_LEVELS: Final[Mapping[LimitName, int]] = {"low": 1, "high": 1, "low_low": 2, "high_high": 2}


class AlarmLimit(NamedTuple):
    """A value beyond it exceeds it, and is back only when it is `deadband` inside."""

    name: LimitName
    value: float
    deadband: float = 0.0

    @property
    def is_high(self) -> bool:
        return self.name in ("high", "high_high")

    def is_exceeded(self, value: float, before: bool) -> bool:
        """Whether a value exceeds it; `before` is whether the value before did. NaN always does."""
        if math.isnan(value):
            return True
        margin = self.deadband if before else 0.0
        return value > self.value - margin if self.is_high else value < self.value + margin

    def range_as(self, exceeded: bool) -> tuple[float, float]:
        """The lowest and the highest value by which it stays exceeded, or not exceeded."""
        margin = self.deadband if exceeded else 0.0
        edge = self.value - margin if self.is_high else self.value + margin
        if self.is_high:
            return (math.nextafter(edge, math.inf), math.inf) if exceeded else (-math.inf, edge)
        return (-math.inf, math.nextafter(edge, -math.inf)) if exceeded else (edge, math.inf)


class Delays(NamedTuple):
    """For how many seconds a condition is met, or no longer met, before that counts."""

    on_s: float = 0.0
    off_s: float = 0.0


@dataclass(frozen=True, slots=True)
class DelayedCondition:
    """A condition behind its delays. `met` is what was heard, since `changed_at` (monotonic seconds),
    `active` is what counts."""

    met: bool = False
    active: bool = False
    changed_at: float = -math.inf

    def observe(self, met: bool, now: float, delays: Delays) -> "DelayedCondition":
        before = self.at(now, delays)
        changed = before if met == before.met else replace(before, met=met, changed_at=now)
        return changed.at(now, delays)

    def due(self, delays: Delays) -> float:
        """When `active` changes if nothing else is heard; inf if it does not."""
        if self.met == self.active:
            return math.inf
        return self.changed_at + (delays.on_s if self.met else delays.off_s)

    def at(self, now: float, delays: Delays) -> "DelayedCondition":
        return replace(self, active=self.met) if now >= self.due(delays) else self


def level_of(limits: Iterable[tuple[AlarmLimit, bool]]) -> int:
    """The highest level of the limits that are exceeded; 0 if none is."""
    return max((LIMIT_LEVELS[limit.name] for limit, active in limits if active), default=0)


# The status of one alarm: its state, its occurrence, and whether it is shelved, suppressed or out of
# service. Values that don't change; each function returns the next status.

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


def merge(
    known: AlarmStatus, live: AlarmStatus, rules: AlarmRules, now: Moment, was_clear: bool
) -> AlarmStatus:
    """The status of an alarm whose record (`known`) is read late, after it was raised or taken out in
    this run (`live`). A raise is that of the record, and acknowledged if that is, unless the condition
    `was_clear` before it in this run. Shelves are those of both."""
    merged = live
    if live.is_normal:
        merged = known
    elif live.state is State.UNACKNOWLEDGED and not was_clear and not known.is_normal:
        merged = update_level(known, rules, None if live.unknown_since else live.level, now)
    out_of_service = live.out_of_service or known.out_of_service
    return replace(
        merged,
        occurrence=max(live.occurrence, merged.occurrence),
        shelf=None if out_of_service else live.shelf or known.shelf,
        out_of_service=out_of_service,
        suppressed_since=live.suppressed_since,
    )


# An alarm of one robot: its definition, and what is known of it now.


@dataclass(frozen=True, slots=True)
class Definition:
    """An alarm of the panel file, of one robot ("" for the only one). `thresholds` are its limits, or
    one None for a condition without a limit. `id` is unique in the panel. `inhibits` are the (robot,
    control) that it locks."""

    id: str
    robot: str
    alarm: Alarm
    rules: AlarmRules
    delays: Delays
    thresholds: tuple[AlarmLimit | None, ...]
    inhibits: tuple[tuple[str, str], ...] = ()

    @property
    def is_of_robot(self) -> bool:
        """Whether it is an alarm of a robot; else it is one of the panel itself."""
        return self.alarm.source is not None

    def of_entry(self, entry: AlarmEntry) -> "Definition":
        """The definition of an alarm that the robot publishes itself."""
        rules = self.rules
        if entry.priorities != rules.priorities:
            rules = replace(rules, priorities=entry.priorities)
        return replace(self, id=f"{self.id}:{entry.name}", rules=rules)


def define(panel: Panel, robot: str) -> Iterator[Definition]:
    """The definitions of all alarms of a robot."""
    robots, of_widgets = tuple(str(each.id) for each in panel.robots), widget_robots(panel)
    for alarm in panel.alarms:
        if alarm.is_for(robot or None):
            controls = inhibited_controls(alarm.inhibits, robot, robots, of_widgets)
            yield _define(alarm, robot, tuple(dict.fromkeys(controls)))


def _define(alarm: Alarm, robot: str, inhibits: tuple[tuple[str, str], ...]) -> Definition:
    limits = (
        AlarmLimit(cast(LimitName, name), value, alarm.deadband) for name, value in alarm.limits.items()
    )
    kind = AlarmKind(alarm.ack == "required", alarm.latched)
    return Definition(
        f"{alarm.id}@{robot}" if robot else alarm.id,
        robot,
        alarm,
        AlarmRules(kind, alarm.priorities, alarm.on_unknown == "raise", alarm.max_shelf_s),
        Delays(alarm.on_delay_s, alarm.off_delay_s),
        tuple(limits) or (None,),
        inhibits,
    )


NEVER_STEADY: Final = (math.inf, -math.inf)


class Leader(NamedTuple):
    """An alarm that another one follows: it was raised `after_s` seconds before that."""

    id: str
    text: TextLike
    after_s: float


@dataclass(slots=True)
class AlarmInstance:
    """`value` is the last one of its field, `limit` the last limit that it exceeded. `entry` is what
    the robot published, for diagnostics and lists, and `heard_at` when. `leader` is the alarm of its
    group that it followed when it was raised, None if there was none. `steady` is the range of values
    that change nothing. `due` is when time alone changes it, and `timer` when the engine looks at that.
    All in monotonic seconds."""

    definition: Definition
    status: AlarmStatus = NORMAL
    conditions: tuple[DelayedCondition, ...] = field(init=False)
    value: float | None = None
    limit: float | None = None
    entry: AlarmEntry | None = None
    heard_at: float = -math.inf
    leader: Leader | None = None
    steady: tuple[float, float] = NEVER_STEADY
    is_evaluated: bool = False
    due: float = math.inf
    timer: float = math.inf

    def __post_init__(self) -> None:
        self.conditions = (DelayedCondition(),) * len(self.definition.thresholds)

    def set_conditions(self, conditions: tuple[DelayedCondition, ...]) -> None:
        """Sets the conditions of its limits, and the limit of the highest level among those that are
        exceeded."""
        self.conditions = conditions
        pairs = zip(self.definition.thresholds, conditions, strict=True)
        exceeded = [limit for limit, condition in pairs if limit is not None and condition.active]
        if exceeded:
            self.limit = max(exceeded, key=self.level_of).value

    def restore(self, status: AlarmStatus) -> None:
        """Takes over the status of an earlier run, with what counted as met then."""
        self.status, self.steady = status, NEVER_STEADY
        self.conditions = tuple(
            DelayedCondition(met, met)
            for limit in self.definition.thresholds
            for met in [status.level > 0 and self.level_of(limit) <= status.level]
        )

    def level_of(self, limit: AlarmLimit | None) -> int:
        """The level that is reached where a limit is exceeded; the robot says its own."""
        if limit is not None:
            return LIMIT_LEVELS[limit.name]
        levels = len(self.definition.rules.priorities)
        return max(1, min(self.entry.level, levels)) if self.entry else 1

    @property
    def text(self) -> TextLike:
        """What it says: the robot's own text (of a diagnostic status with its name) or that of the
        panel file."""
        if self.entry is not None:
            text = self.entry.text
            named = self.definition.alarm.diagnostics and text != self.entry.name
            return together([f"{self.entry.name}: ", text]) if named else text
        return self.definition.alarm.text or self.definition.id

    @property
    def action(self) -> TextLike:
        """What the operator does: by the fault catalogue, or the panel file."""
        return (self.entry and self.entry.action) or self.definition.alarm.action or ""

    @property
    def priority(self) -> int:
        """That of the highest level since it was raised and not acknowledged."""
        return self.definition.rules.priority(max(self.status.level, self.status.raised_level))

    @property
    def is_unlisted(self) -> bool:
        """Whether there is nothing to list: it is normal, and neither shelved, suppressed nor out of
        service."""
        return self.status.is_normal and self.status.override is None

    @property
    def inhibits(self) -> bool:
        """Whether it locks the controls that it names: it is active or latched, or its source is
        unknown or was not read yet. One that has returned does not."""
        status, alarm = self.status, self.definition.alarm
        if not self.is_evaluated:
            return True
        if status.suppressed_since and not alarm.inhibits_when_suppressed:
            return False
        is_latched = alarm.latched and not status.is_normal
        return status.level > 0 or is_latched or status.unknown_since is not None

    @property
    def lock(self) -> tuple[bool, bool, TextLike]:
        """What decides the lock of its controls: whether it locks, whether it is because its source is
        unknown, and its text."""
        status = self.status
        is_unknown = not self.is_evaluated or bool(status.unknown_since and not status.level)
        return self.inhibits, is_unknown, self.text

    @property
    def order(self) -> tuple[bool, int, float]:
        """The unacknowledged first, by priority, then the newest."""
        raised_at = self.status.raised_at
        return (
            self.status.is_acknowledged,
            self.priority,
            -(raised_at.monotonic if raised_at else 0.0),
        )


class Transition(NamedTuple):
    """A change of an alarm: `seq` gives the order. `act` is the act that caused it, "" for none, and
    `actor` its actor. `value` is that of the source."""

    seq: int
    at: Moment
    id: str
    before: AlarmStatus
    after: AlarmStatus
    act: str = ""
    actor: str = ""
    value: float | None = None
