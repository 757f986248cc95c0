"""Numbers of messages and panel files: their ranges, their formats and their units."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from struct import pack, unpack
from typing import Final, NamedTuple, Protocol

from app.panel.values import number_text
from app.ros.messages import INTEGER_RANGES, to_plain
from app.system.texts import PanelText, TextLike, number, say
from app.system.texts.text import after_space

NUMBERS: Final = frozenset({*INTEGER_RANGES, "float32", "float64"})  # the types of numbers

# Ranges of numbers with optional limits, of panel files and of ROS 2 parameter descriptors.
#
# A value in a descriptor's range is a whole number of steps from its lowest value, or is its highest
# (rcl_interfaces/msg/FloatingPointRange, IntegerRange).

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
    `static/js/number-text.js` has the same rule."""
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


# How a number of a message is shown: its format, and the factors to the unit that is shown.
#
# Limits and comparisons of a panel file are of the shown number. `shown_number` makes it everywhere,
# and `sent_number` is its inverse.

# [+] [,] [.digits] [f, e, g, % or d]: the part of Python's format language that can't fail.
FORMAT: Final = r"^\+?,?(\.[0-9]{1,2}[feg%]|[feg%d])$"
DIGITS: Final = 15  # that a double has in each case: 300000 * 0.00001 is 3, not 3.0000000000000004
BRIEF_DIGITS: Final = 4  # of a number that is shown without a format
LONGEST_NUMBER: Final = 32  # a larger one has an exponent, whatever its format

BATTERY: Final = ("sensor_msgs/msg/BatteryState", "percentage")
PERCENT: Final = 100.0


class Scaled(Protocol):
    """What shows or compares `value * scale + offset`."""

    @property
    def scale(self) -> float: ...
    @property
    def offset(self) -> float: ...


class WrittenNumber(Scaled, Protocol):
    """What is written with a format."""

    @property
    def format(self) -> str | None: ...


class Scaling(NamedTuple):
    """A scale and an offset."""

    scale: float = 1.0
    offset: float = 0.0


class OwnScale(Protocol):
    """A field beside a number that is shown. Without `scale` and `offset` it has those of the
    number."""

    @property
    def scale(self) -> float | None: ...
    @property
    def offset(self) -> float | None: ...


def scaling_beside(described: Scaled, beside: OwnScale) -> Scaling:
    """The scale and offset of a field beside the number that is described."""
    if beside.scale is None and beside.offset is None:
        return Scaling(described.scale, described.offset)
    return Scaling(1.0 if beside.scale is None else beside.scale, beside.offset or 0.0)


def is_scaled(described: Scaled) -> bool:
    """Whether another number is shown than that of the message."""
    return (described.scale, described.offset) != (1.0, 0.0)


def is_beyond_battery(described: Scaled, value: float) -> bool:
    """Whether a value can't be the charge of a `BatteryState`, which is 0 to 1, while it is shown in
    percent: the robot publishes 0 to 100, and its 1 would be 100 %."""
    field = (getattr(described, "type", ""), getattr(described, "field", ""))
    return field == BATTERY and described.scale == PERCENT and value > 1.0


def shown_number(described: Scaled, value: float) -> float:
    """The number that is shown for one of a message, NaN where that is not known. 0.1 as float32 counts
    as 0.1."""
    if not is_scaled(described):
        return value
    if is_beyond_battery(described, value):
        return math.nan
    scaled = shortest_float(value) * described.scale + described.offset
    return float(f"{scaled:.{DIGITS}g}") if math.isfinite(scaled) else scaled


def sent_number(scale: float, offset: float, shown: float) -> float:
    """The number of a message for which this one is shown; exact in decimals."""
    exact = (Fraction(repr(shown)) - Fraction(repr(offset))) / Fraction(repr(scale))
    return int(exact) if exact.denominator == 1 else float(exact)


def brief(value: float) -> float:
    """A number with four significant digits; one with more digits before its point keeps those."""
    if not math.isfinite(value) or value == 0:
        return value
    return round(value, max(0, BRIEF_DIGITS - 1 - math.floor(math.log10(abs(value)))))


def formatted(value: float, style: str) -> str:
    """A number in a format of the panel file; never a negative zero."""
    sign, rest = ("+", style[1:]) if style.startswith("+") else ("", style)
    spec = style if style.endswith("d") else f"{sign}z{rest}"
    text = format(value, spec)  # "inf%" where a percentage is larger than any float
    return text if len(text) <= LONGEST_NUMBER and "inf" not in text else f"{value:.6g}"


# Pairs of units that the panel converts between: an operator enters mm, the robot takes m.

# Of each quantity: how many of its base unit a unit is.
QUANTITIES: Final[tuple[Mapping[str, Fraction | float], ...]] = (
    {"µm": Fraction(1, 10**6), "mm": Fraction(1, 1000), "cm": Fraction(1, 100), "m": Fraction(1)},
    {
        "mm/s": Fraction(1, 1000),
        "cm/s": Fraction(1, 100),
        "m/min": Fraction(1, 60),
        "m/s": Fraction(1),
        "km/h": Fraction(10, 36),
    },
    {"mm/s²": Fraction(1, 1000), "m/s²": Fraction(1)},
    {"°": math.pi / 180, "deg": math.pi / 180, "rad": Fraction(1)},
    {
        "°/s": math.pi / 180,
        "deg/s": math.pi / 180,
        "rpm": math.pi / 30,
        "1/min": math.pi / 30,
        "rad/s": Fraction(1),
    },
    {"%": Fraction(1, 100), "1": Fraction(1)},
    {"ms": Fraction(1, 1000), "s": Fraction(1), "min": Fraction(60), "h": Fraction(3600)},
    {"g": Fraction(1, 1000), "kg": Fraction(1)},
    {"N": Fraction(1), "kN": Fraction(1000)},
    {
        "Pa": Fraction(1),
        "mbar": Fraction(100),
        "hPa": Fraction(100),
        "kPa": Fraction(1000),
        "bar": Fraction(100_000),
    },
)
KELVIN_OFFSET: Final = Fraction(27315, 100)


class Conversion(NamedTuple):
    """`value * scale + offset` is the value in the other unit; exact where the factors are."""

    scale: Fraction | float
    offset: Fraction | float = Fraction(0)

    def apply(self, value: float) -> Fraction | float:
        """The converted value."""
        exact = Fraction(repr(value))
        if isinstance(self.scale, Fraction) and isinstance(self.offset, Fraction):
            return exact * self.scale + self.offset
        return value * float(self.scale) + float(self.offset)


def conversion(unit: str, other: str) -> Conversion | None:
    """From a unit to another one; None for a pair that the panel does not know."""
    if (unit, other) == ("°C", "K"):
        return Conversion(Fraction(1), KELVIN_OFFSET)
    if (unit, other) == ("K", "°C"):
        return Conversion(Fraction(1), -KELVIN_OFFSET)
    for units in QUANTITIES:
        if unit in units and other in units:
            own, its = units[unit], units[other]
            if isinstance(own, Fraction) and isinstance(its, Fraction):
                return Conversion(own / its)
            return Conversion(Fraction(1) if own == its else float(own) / float(its))
    return None


def units_like(unit: str) -> list[str]:
    """The other units that this one converts to."""
    if unit in ("°C", "K"):
        return ["K" if unit == "°C" else "°C"]
    return [other for units in QUANTITIES if unit in units for other in units if other != unit]
