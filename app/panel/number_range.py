"""Ranges of numbers with optional limits, of panel files and of ROS 2 parameter descriptors.

A value in a descriptor's range is a whole number of steps from its lowest value, or is its highest
(rcl_interfaces/msg/FloatingPointRange, IntegerRange).
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from struct import pack, unpack
from typing import Final

from app.i18n import PanelText, TextLike, number, say
from app.i18n.values import after_space
from app.interfaces import to_plain
from app.panel.values import number_text

# A double that is this near to a step, in parts of the step, is on it: 0.1 + 0.2 is not quite 0.3.
NEAR: Final = Fraction(1, 1_000_000_000)
MIN_WITH_EXPONENT: Final = 1e16  # larger doubles are written with an exponent


def step_fault(step: float, low: float, high: float) -> str:
    """Why no whole number of steps leads from `low` to `high`."""
    numbers = number_text(step), number_text(low), number_text(high)
    if step > high - low:
        return "a step of {} is more than the whole range, from {} to {}".format(*numbers)
    return "no whole number of steps of {} leads from {} to {}".format(*numbers)


@dataclass(frozen=True, slots=True)
class Range:
    """From `low` to `high` in steps of `step`; None: no limit."""

    low: float | None = None
    high: float | None = None
    step: float | None = None

    def contains(self, value: float) -> bool:
        """Whether a value is within the limits and on a step."""
        if self.low is not None and value < self.low:
            return False
        if self.high is not None and value > self.high:
            return False
        return value == self.high or self.is_on_step(value)

    def is_on_step(self, value: float) -> bool:
        """Whether a value is on a step: exactly for integers, else `is_on_step`."""
        whole = isinstance(value, int) and isinstance(self.step, int)
        return self.step is None or is_on_step(value, self.low or 0, self.step, whole=whole)

    def narrowed_by(self, other: "Range") -> "Range":
        """This range narrowed by another. If the other has no step, the limits are on this range's
        steps."""
        low, high = self.low, self.high
        if other.low is not None and (low is None or other.low > low):
            low = other.low if other.step is not None else self._nearest_step(other.low, math.ceil)
        if other.high is not None and (high is None or other.high < high):
            high = other.high if other.step is not None else self._nearest_step(other.high, math.floor)
        return Range(low, high, self.step if other.step is None else other.step)

    @property
    def is_empty(self) -> bool:
        return self.low is not None and self.high is not None and self.low > self.high

    def _nearest_step(self, value: float, rounded: Callable[[Fraction], int]) -> float:
        """The step of this range at or next to a value."""
        if self.step is None or self.low is None:
            return value
        low, step = _exact(self.low), _exact(self.step)
        nearest = low + rounded((_exact(value) - low) / step) * step
        return int(nearest) if isinstance(self.low, int) else float(nearest)


def is_on_step(value: float, low: float, step: float, *, whole: bool = False) -> bool:
    """Whether a value is a whole number of steps from `low`, within `NEAR` of a step, in exact decimal
    arithmetic; `whole`: within `NEAR` of 1, so that no whole number counts as its neighbour.
    `static/js/decimals.js` has the same rule."""
    rest = (_exact(value) - _exact(low)) % _exact(step)
    return min(rest, _exact(step) - rest) <= NEAR * (1 if whole else _exact(step))


def range_text(limits: Range, unit_name: str | PanelText) -> TextLike:
    """A range as text, with its unit: "0 to 1.5 m/s, in steps of 0.1"; "" without limits."""
    unit = after_space(unit_name)
    low, high = _number_text(limits.low), _number_text(limits.high)
    text: TextLike
    if limits.low is not None and limits.high is not None:
        text = say("limits_both", low=low, high=high, unit=unit)
    elif limits.low is not None:
        text = say("limits_low", low=low, unit=unit)
    elif limits.high is not None:
        text = say("limits_high", high=high, unit=unit)
    else:
        text = ""
    if limits.step is None or (limits.step == 1 and isinstance(limits.step, int)):
        return text
    steps = say("limits_step", step=_number_text(limits.step))
    return say("and_further", first=text, last=steps) if text else steps


def decimal_text(value: float) -> str:
    """A number exactly, as in HTML; "NaN", "Infinity" or "-Infinity"."""
    if isinstance(value, int) or not math.isfinite(value):
        return str(to_plain(value))
    return number_text(value) if abs(value) < MIN_WITH_EXPONENT else repr(value)


def to_float32(number: float) -> float:
    """The nearest float32."""
    try:
        narrowed: float = unpack("f", pack("f", number))[0]
    except OverflowError:
        return math.copysign(math.inf, number)
    return narrowed


def shortest_float(number: float) -> float:
    """The shortest double of a float32: 0.1 for 0.10000000149011612. Any other number is unchanged."""
    if not math.isfinite(number) or to_float32(number) != number:
        return number
    written = (float(f"{number:.{digits}g}") for digits in range(6, 10))
    return next(text for text in written if to_float32(text) == number)


def _number_text(value: float | None) -> TextLike:
    return "" if value is None else number(decimal_text(value))


def _exact(number: float) -> Fraction:
    return Fraction(repr(number))
