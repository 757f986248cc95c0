"""From a robot's state to what the source of an alarm says now. Pure functions."""

import math
from collections.abc import Callable, Mapping
from typing import Any, Final, NamedTuple

from app.alarms.delays import Limit
from app.panel.alarm import Alarm, SourceKind
from app.panel.condition import Condition
from app.panel.widgets.parameter import GET
from app.permission.conditions import fresh_since, permits
from app.permission.interlocks import link_verdict
from app.robot.keyed_values import kept_s
from app.robot.state import RobotState


class SourceReading(NamedTuple):
    """What a source says: `value` is that of a field, and `met` whether a condition without limits is.
    Both are None while it is unknown. `until` (monotonic seconds) is when time alone changes it."""

    value: float | None = None
    met: bool | None = None
    until: float = math.inf

    @property
    def is_known(self) -> bool:
        return self.value is not None or self.met is not None

    def exceeds(self, limit: Limit | None, before: bool) -> bool:
        """Whether it exceeds a limit, or its condition is met if there is no limit."""
        if limit is None or self.value is None:
            return self.met is True
        return limit.is_exceeded(self.value, before)


UNKNOWN: Final = SourceReading()
CONNECTS_WITHIN_S: Final = 10.0  # after the start of the server
CATCHING_UP: Final = "link_catching_up"  # for a moment, after the event loop stalled


def read_source(alarm: Alarm, robot: RobotState, now: float, began_at: float) -> SourceReading:
    """What the source of an alarm says at `now`; `began_at` is when the server began to listen. Both in
    monotonic seconds."""
    read = READERS.get(alarm.source) if alarm.source else None
    return read(alarm, robot, now, began_at) if read else UNKNOWN


def _read_field(alarm: Alarm, robot: RobotState, now: float, _: float) -> SourceReading:
    link = link_verdict(robot, now)
    if alarm.topic is None or not (link.permitted or link.code == CATCHING_UP):
        return SourceReading(until=link.until)
    reading = robot.reading(alarm.topic).of_field(alarm.field, kept_s(alarm.max_age_s))
    value = reading.value(alarm.field) if reading.status in ("message", "reading") else None
    if not isinstance(value, int | float):
        return UNKNOWN
    stale_at = math.inf if alarm.max_age_s is None else reading.at + alarm.max_age_s
    if now >= stale_at:
        return UNKNOWN
    return SourceReading(value=value if alarm.scale == 1.0 else value * alarm.scale, until=stale_at)


def _read_node(alarm: Alarm, robot: RobotState, now: float, _: float) -> SourceReading:
    """A node is there while its parameter services are."""
    link = link_verdict(robot, now)
    if alarm.node is None or not (link.permitted or link.code == CATCHING_UP):
        return SourceReading(until=link.until)
    key = robot.key(f"{alarm.node}/{GET[0]}")
    return SourceReading(met=robot.graph.server_type("SS", key) is None)


def _read_condition(alarm: Alarm, robot: RobotState, now: float, _: float) -> SourceReading:
    return UNKNOWN if alarm.when is None else read_condition(alarm.when, robot, now)


def read_condition(condition: Condition, robot: RobotState, now: float) -> SourceReading:
    """Whether a condition is met; unknown while its value is not known, or too old. A value that may
    have been replayed can raise an alarm, but not say that there is none."""
    link = link_verdict(robot, now)
    if not (link.permitted or link.code == CATCHING_UP):
        return SourceReading(until=link.until)
    reading = robot.reading(condition.topic).of_field(condition.field, kept_s(condition.max_age_s))
    value = reading.value(condition.field) if reading.status in ("message", "reading") else None
    if value is None or value != value:
        return UNKNOWN
    stale_at = math.inf if condition.max_age_s is None else reading.at + condition.max_age_s
    met, key = permits(condition, value), robot.key(condition.topic)
    is_aged = condition.max_age_s is not None and reading.at < fresh_since(robot, key)
    is_doubtful = is_aged or robot.silent_publishers.has_silent(key, robot.peers_of(key))
    if now >= stale_at or (not met and is_doubtful):
        return UNKNOWN
    return SourceReading(met=met, until=stale_at)


def read_suppression(alarm: Alarm, robot: RobotState | None, now: float) -> SourceReading:
    """Whether the condition of `while` is met; unknown without one."""
    if alarm.suppressed_while is None or robot is None:
        return UNKNOWN
    return read_condition(alarm.suppressed_while, robot, now)


def _read_age(alarm: Alarm, robot: RobotState, now: float, began_at: float) -> SourceReading:
    if alarm.topic is None or alarm.stale_s is None:
        return UNKNOWN
    stale_at = max(robot.reading(alarm.topic).at, began_at) + alarm.stale_s
    return SourceReading(met=True) if now >= stale_at else SourceReading(met=False, until=stale_at)


def _read_loss(alarm: Alarm, robot: RobotState, now: float, began_at: float) -> SourceReading:
    """Whether the link is lost; unknown while the server connects after its start."""
    lost = not robot.link_up
    if alarm.lost == "robot":
        lost = lost or not robot.graph.peers or robot.graph.has_silent_peer or not robot.is_responding
    if lost and now < began_at + CONNECTS_WITHIN_S:
        return SourceReading(until=began_at + CONNECTS_WITHIN_S)
    return SourceReading(met=lost)


READERS: Final[Mapping[SourceKind, Callable[[Alarm, RobotState, float, float], SourceReading]]] = {
    "limits": _read_field,
    "condition": _read_condition,
    "stale": _read_age,
    "node": _read_node,
    "lost": _read_loss,
}


def link_state(robot: RobotState, now: float) -> tuple[Any, ...]:
    """What the readings of all alarms of a robot depend on: if it differs, each may have changed."""
    graph = robot.graph
    link = link_verdict(robot, now).code
    is_permitted = link in ("permitted", CATCHING_UP)
    return (
        robot.link_up,
        robot.is_responding,
        graph.has_silent_peer,
        frozenset(graph.peers),
        "" if is_permitted else link,
    )
