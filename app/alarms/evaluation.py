"""From what an alarm's source says to the levels of its condition. Pure functions."""

import math

from app.alarms.delays import DelayedCondition
from app.alarms.instance import NEVER_STEADY, AlarmInstance
from app.alarms.sources import UNKNOWN, SourceReading, read_source
from app.robot.state import RobotState


def read_alarm(
    alarm: AlarmInstance, robot: RobotState | None, now: float, began_at: float
) -> SourceReading:
    """What the source of an alarm says: a field or the graph of its robot, or what was published of it.
    `robot` is None for an alarm of the panel itself."""
    described, entry = alarm.definition.alarm, alarm.entry
    if robot is None:
        return UNKNOWN if entry is None else SourceReading(met=entry.level > 0)
    if entry is None:
        return read_source(described, robot, now, began_at)
    if not robot.link_up or not robot.graph.peers or alarm.heard_at == -math.inf:
        return UNKNOWN
    max_age_s = described.entry_max_age_s
    stale_at = math.inf if max_age_s is None else alarm.heard_at + max_age_s
    if now >= stale_at:
        return UNKNOWN
    return SourceReading(met=entry.level > 0, until=stale_at)


def steady_range(alarm: AlarmInstance) -> tuple[float, float]:
    """The lowest and the highest value that change nothing of an alarm whose source is known."""
    low, high = -math.inf, math.inf
    for limit, condition in zip(alarm.definition.thresholds, alarm.conditions, strict=True):
        if limit is None or condition.met != condition.active:
            return NEVER_STEADY
        lowest, highest = limit.range_as(condition.met)
        low, high = max(low, lowest), min(high, highest)
    return low, high


def levels_of(
    alarm: AlarmInstance, reading: SourceReading, now: float
) -> tuple[tuple[int | None, ...], tuple[DelayedCondition, ...]]:
    """The levels that the condition has in turn, None for unknown, and its conditions after them. From
    one end of the range to the other it returns in between."""
    if not reading.is_known:
        return (None,), alarm.conditions
    definition = alarm.definition
    pairs = tuple(zip(definition.thresholds, alarm.conditions, strict=True))
    conditions = tuple(
        condition.heard(reading.exceeds(limit, condition.met), now, definition.delays)
        for limit, condition in pairs
    )
    before = {limit for limit, condition in pairs if condition.active}
    after = {
        limit
        for limit, condition in zip(definition.thresholds, conditions, strict=True)
        if condition.active
    }
    level = max((alarm.level_of(limit) for limit in after), default=0)
    sides = {limit.is_high for limit in (*before, *after) if limit is not None}
    crossed = before and after and not before & after and len(sides) > 1
    return ((0, level) if crossed else (level,)), conditions
