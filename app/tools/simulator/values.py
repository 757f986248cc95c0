"""Values of fields: signals that change with time, what a field is likely to be, and its place in a
message. Pure."""

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final, Literal
from zlib import crc32

from app.ros.cdr.selection import Resolver
from app.ros.messages import Structure, Type
from app.ros.messages.definitions import FLOAT_TYPES, INTEGER_RANGES, STRING_TYPES, zero_value
from app.ros.messages.field_path import Key, PathStep, path_steps

# Puts values at the paths of fields into messages that are dicts and lists: pure.
#
# A list grows to have the element of an index, or one with the key that a path names.

Fields = dict[str, Any]
Structures = Mapping[str, Structure]


def put(fields: Fields, type_name: str, path: str, value: Any, structures: Structures) -> None:
    """Sets one field of a message of a type."""
    _put(
        fields,
        structures[type_name],
        Resolver(structures).typed_steps(type_name, path),
        value,
        structures,
    )


def _put(
    fields: Fields, structure: Structure, steps: Sequence[PathStep], value: Any, structures: Structures
) -> None:
    name, *rest = steps
    field = next(field for field in structure.fields if field.name == name)
    if not rest:
        fields[str(name)] = value
    elif isinstance(rest[0], str):
        inner = fields.setdefault(str(name), {})
        _put(inner, structures[field.type.name], rest, value, structures)
    else:
        items = fields[str(name)] = list(fields.get(str(name), field.default_value))
        index = _index(fields, items, structure, field.type, rest[0], structures)
        _grow(items, field.type, index)
        if len(rest) == 1:
            items[index] = value
        else:
            items[index] = dict(items[index])
            _put(items[index], structures[field.type.name], rest[1:], value, structures)


def _index(
    fields: Fields,
    items: list[Any],
    structure: Structure,
    kind: Type,
    step: PathStep,
    structures: Structures,
) -> int:
    """Which element a step names."""
    if not isinstance(step, Key):
        return int(step)
    first = step.path.partition(".")[0]
    if kind.is_nested and any(field.name == first for field in structures[kind.name].fields):
        for number, item in enumerate(items):
            if get(item, path_steps(step.path)) == step.value:
                return number
        index = 0 if kind.container == "array" else len(items)
        items[index : index + 1] = [{}]
        _put(items[index], structures[kind.name], path_steps(step.path), step.value, structures)
        return index
    if not any(field.name == first for field in structure.fields):
        return 0
    beside = fields[first] = list(fields.get(first, ()))
    if step.value not in beside:
        beside.append(step.value)
    return beside.index(step.value)


def _grow(items: list[Any], kind: Type, index: int) -> None:
    while len(items) <= index:
        items.append(zero_value(kind.element))


def get(fields: Any, steps: Sequence[PathStep]) -> Any:
    """The value at a path; None where a message does not have it."""
    if not steps:
        return fields
    step, *rest = steps
    if isinstance(step, str):
        if len(rest) and isinstance(rest[0], Key) and isinstance(fields, Mapping):
            return _get_by_key(fields, step, rest[0], rest[1:])
        return get(fields.get(step), rest) if isinstance(fields, Mapping) else None
    if isinstance(step, int) and isinstance(fields, list | tuple) and step < len(fields):
        return get(fields[step], rest)
    return None


def _get_by_key(fields: Mapping[str, Any], name: str, key: Key, rest: Sequence[PathStep]) -> Any:
    items = fields.get(name, ())
    keys = fields.get(key.path)
    if not isinstance(keys, list | tuple):
        keys = [get(item, path_steps(key.path)) for item in items]
    index = next((i for i, element_key in enumerate(keys) if element_key == key.value), len(items))
    return get(items[index], rest) if index < len(items) else None


def merged(fields: Fields, over: Mapping[str, Any]) -> Fields:
    """Both; tables within tables are merged too."""
    for key, value in over.items():
        inner: Any = fields.get(key)
        tables = isinstance(value, Mapping) and isinstance(inner, dict)
        fields[key] = merged(inner, value) if tables else value
    return fields


# Values that change with time: pure functions of the seconds since the robot's start.

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


def counted(each_s: float, name: str) -> Signal:
    """Counts the parts of a machine that makes one in so many seconds, in a field of a base type; it
    begins at zero again where the type has no higher number."""
    rounds = INTEGER_RANGES[name][1] + 1 if name in INTEGER_RANGES else 2**53
    return as_type(lambda t: int(t / each_s) % rounds, name)


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


# What a field is likely to be, by its unit, its name and its type: pure.

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
