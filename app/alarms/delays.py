"""Delays and deadbands: from the values of a source to the level of an alarm's condition."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from typing import Final, Literal, NamedTuple

LimitName = Literal["low", "high", "low_low", "high_high"]
# The level of each limit. Two limits with the same level are at different ends of the range.
LIMIT_LEVELS: Final[Mapping[LimitName, int]] = {"low": 1, "high": 1, "low_low": 2, "high_high": 2}


class Limit(NamedTuple):
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

    def heard(self, met: bool, now: float, delays: Delays) -> "DelayedCondition":
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


def level_of(limits: Iterable[tuple[Limit, bool]]) -> int:
    """The highest level of the limits that are exceeded; 0 if none is."""
    return max((LIMIT_LEVELS[limit.name] for limit, active in limits if active), default=0)
