"""An alarm of one robot: its definition, and what is known of it now."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Final, NamedTuple, cast

from app.alarms.delays import LIMIT_LEVELS, DelayedCondition, Delays, Limit, LimitName
from app.alarms.entries import AlarmEntry
from app.alarms.states import AlarmKind
from app.alarms.status import NORMAL, AlarmRules, AlarmStatus, Moment
from app.i18n import TextLike
from app.panel.alarm import Alarm
from app.panel.inhibits import inhibited_controls
from app.panel.model import Panel
from app.panel.robot_panels import widget_robots


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
    thresholds: tuple[Limit | None, ...]
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
        Limit(cast(LimitName, name), value, alarm.deadband) for name, value in alarm.limits.items()
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

    def level_of(self, limit: Limit | None) -> int:
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
            return f"{self.entry.name}: {text}" if named else text
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
