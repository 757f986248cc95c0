"""What a field is likely to be, by its unit, its name and its type: pure."""

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, Literal

from app.interfaces.definitions import FLOAT_TYPES, INTEGER_RANGES, STRING_TYPES
from app.simulator.values.signals import (
    BATTERY_S,
    SWING_S,
    Signal,
    as_type,
    battery,
    count,
    cycle,
    fixed,
    phase_of,
    swing,
)

Shape = Literal["swing", "count", "battery"]


@dataclass(frozen=True, slots=True)
class Span:
    """The values that a number has, and how it moves between them."""

    low: float
    high: float
    shape: Shape = "swing"


# By the unit of a readout: what is shown, after scale and offset.
UNITS: Final[Mapping[str, Span]] = {
    "%": Span(0, 100),
    "°C": Span(22, 58),
    "K": Span(295, 331),
    "°F": Span(72, 136),
    "V": Span(22.5, 28.5),
    "mV": Span(3300, 4150),
    "A": Span(0.5, 9),
    "mA": Span(50, 900),
    "W": Span(40, 850),
    "kW": Span(0.4, 7.5),
    "bar": Span(4.8, 6.6),
    "mbar": Span(985, 1030),
    "Pa": Span(480_000, 660_000),
    "kPa": Span(480, 660),
    "hPa": Span(985, 1030),
    "m": Span(0, 4),
    "cm": Span(0, 180),
    "mm": Span(0, 850),
    "µm": Span(0, 400),
    "m/s": Span(0, 1.5),
    "mm/s": Span(0, 250),
    "m/min": Span(0, 60),
    "rad": Span(-1.5, 1.5),
    "°": Span(-90, 90),
    "deg": Span(-90, 90),
    "rad/s": Span(-1, 1),
    "°/s": Span(-60, 60),
    "rpm": Span(0, 1450),
    "1/min": Span(0, 1450),
    "Hz": Span(45, 55),
    "N": Span(-40, 120),
    "kN": Span(0, 12),
    "Nm": Span(-8, 8),
    "kg": Span(0, 12),
    "g": Span(0, 900),
    "l/min": Span(2, 18),
    "s": Span(0, 60),
    "ms": Span(2, 40),
    "min": Span(0, 45),
    "h": Span(1200, 1900, "count"),
    "dB": Span(35, 75),
    "lx": Span(150, 900),
    "pcs": Span(0, 500, "count"),
}
# By words in the name of a field, a topic or a label; the first that fits counts.
NAMES: Final[tuple[tuple[re.Pattern[str], Span], ...]] = tuple(
    (re.compile(rf"(?:^|[^a-z])(?:{words})", re.IGNORECASE), span)
    for words, span in (
        (r"batter|akku|charge|state_of_charge|soc(?![a-z])", Span(0, 100, "battery")),
        (r"percent|level|load|utili[sz]ation|progress|fill", Span(0, 100)),
        (r"temp", Span(22, 58)),
        (r"humid", Span(35, 65)),
        (r"volt", Span(22.5, 28.5)),
        (r"current|ampere", Span(0.5, 9)),
        (r"power", Span(40, 850)),
        (r"pressure|vacuum", Span(4.8, 6.6)),
        (r"count|counter|parts|total|cycles|pieces|produced|seq|number", Span(0, 500, "count")),
        (r"hours", Span(1200, 1900, "count")),
        (r"speed|velocity|feed", Span(0, 1.5)),
        (r"distance|range|height|width|depth|stroke", Span(0.2, 4)),
        (r"angle|yaw|pitch|roll|joint", Span(-1.5, 1.5)),
        (r"torque|effort|moment", Span(-8, 8)),
        (r"force|weight", Span(0, 120)),
        (r"position|[xyz]$", Span(-1, 1)),
        (r"w$", Span(0.6, 1)),
        (r"frequency|rate", Span(45, 55)),
        (r"time|duration|elapsed|remaining", Span(0, 60)),
        (r"latitude", Span(48.13, 48.14)),
        (r"longitude", Span(11.57, 11.58)),
        (r"error|fault|code|id$|index", Span(0, 0)),
        (r"covariance|padding|offset|reserved", Span(0, 0)),
    )
)
ANYTHING: Final = Span(0, 100)
# Names of bools that a healthy robot has at false.
NEGATIVE: Final = re.compile(
    r"error|fault|fail|emergency|estop|e_stop|stopped|alarm|warn|blocked|collision|jam|abort|cancel",
    re.IGNORECASE,
)
PHRASES: Final = ("ready", "moving to the part", "gripping", "placing", "waiting for a part")


def span_of(unit: str, *names: str) -> Span:
    """The span of a number with a unit, or of these names, in order of precedence."""
    known = UNITS.get(unit.strip())
    by_name = next((s for name in names for words, s in NAMES if words.search(name)), None)
    if known is None:
        return by_name or ANYTHING
    shape = by_name.shape if by_name and unit in ("%", "V", "h", "pcs", "") else known.shape
    return Span(known.low, known.high, shape)


def moving(span: Span, kind: str, period_s: float | None, phase: float) -> Signal:
    """A number of a base type that moves in a span."""
    if span.high <= span.low:
        return as_type(fixed(span.low), kind)
    match span.shape:
        case "count":
            course = count(span.low, span.high, period_s)
        case "battery":
            course = battery(span.low, span.high, period_s or BATTERY_S)
        case _:
            course = swing(span.low, span.high, period_s or SWING_S, phase)
    return as_type(course, kind)


def guessed(kind: str, bound: int, *names: str) -> Signal:
    """A signal for a single field of a base type, by its names; `bound` is a text's."""
    phase = phase_of(" ".join(names))
    if kind == "bool":
        usual = not any(NEGATIVE.search(name) for name in names)
        return cycle((usual, not usual), phase=phase)
    if kind in STRING_TYPES:
        texts = [text[: bound or None] for text in PHRASES]
        return cycle(texts, phase=phase)
    assert kind in FLOAT_TYPES or kind in INTEGER_RANGES
    return moving(span_of("", *names), kind, None, phase)
