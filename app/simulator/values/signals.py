"""Values that change with time: pure functions of the seconds since the robot's start."""

import math
from collections.abc import Callable, Sequence
from typing import Any, Final
from zlib import crc32

from app.interfaces.definitions import FLOAT_TYPES, INTEGER_RANGES

Signal = Callable[[float], Any]

SWING_S: Final = 24.0
BATTERY_S: Final = 240.0
COUNT_S: Final = 4.0  # between two counts
NORMAL_S: Final = 12.0  # how long the usual one of several values stays
OTHER_S: Final = 4.0
CHARGED_PART: Final = 0.2  # of a battery's period
EMPTIED_TO: Final = 0.2


def phase_of(name: str) -> float:
    """A phase from 0 to 1, so that signals do not move together: the same in each run."""
    return crc32(name.encode()) % 1000 / 1000


def swing(low: float, high: float, period_s: float = SWING_S, phase: float = 0.0) -> Signal:
    """A sine between two values."""
    middle, half = (low + high) / 2, (high - low) / 2
    return lambda t: middle - half * math.cos(2 * math.pi * (t / period_s + phase))


def battery(low: float, high: float, period_s: float = BATTERY_S) -> Signal:
    """Falls from `high` to a fifth above `low`, then rises faster."""
    return lambda t: low + (high - low) * battery_level(t, period_s)


def battery_level(t: float, period_s: float = BATTERY_S) -> float:
    """The charge from 0 to 1."""
    at = t / period_s % 1
    full = 1 - CHARGED_PART
    if at < full:
        return 1 - (1 - EMPTIED_TO) * at / full
    return EMPTIED_TO + (1 - EMPTIED_TO) * (at - full) / CHARGED_PART


def is_charging(t: float, period_s: float = BATTERY_S) -> bool:
    return t / period_s % 1 >= 1 - CHARGED_PART


def count(low: float, high: float, period_s: float | None = None) -> Signal:
    """Counts up from `low`, and begins again after `high`; `period_s` is from one end to the other."""
    each_s = COUNT_S if period_s is None else period_s / (high - low + 1)
    return lambda t: low + int(t / each_s) % int(high - low + 1)


def cycle(values: Sequence[Any], period_s: float | None = None, phase: float = 0.0) -> Signal:
    """Each value in turn. Without a period the first one is the usual one: it stays for longer, and
    comes again between the others."""
    if period_s is None and len(values) > 1:
        first, *others = values
        turn_s = NORMAL_S + OTHER_S

        def usual(t: float) -> Any:
            turn, at = divmod(t + phase * NORMAL_S, turn_s)
            return first if at < NORMAL_S else others[int(turn) % len(others)]

        return usual
    each_s = (period_s or NORMAL_S) / len(values)
    return lambda t: values[int((t / each_s + phase * len(values)) % len(values))]


def fixed(value: Any) -> Signal:
    return lambda _: value


def as_type(signal: Signal, name: str) -> Signal:
    """The signal's numbers as a field of a base type has them: whole, and within its range."""
    if name in FLOAT_TYPES:
        return lambda t: float(signal(t))
    if name not in INTEGER_RANGES:
        return signal
    low, high = INTEGER_RANGES[name]
    return lambda t: min(max(round(signal(t)), low), high)
