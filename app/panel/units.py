"""Pairs of units that the panel converts between: an operator enters mm, the robot takes m."""

import math
from collections.abc import Mapping
from fractions import Fraction
from typing import Final, NamedTuple

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
