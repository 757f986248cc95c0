"""Which fields of the usual types are worth showing, with units and ranges."""

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from math import copysign, floor, isfinite, log10
from typing import Final

from app.interfaces import Interfaces
from app.interfaces.definitions import FLOAT_TYPES, INTEGER_RANGES, Field, Structure
from app.panel.times import DEFAULT_FORMATS
from app.panel.widgets.numbers import MAX_EXACT_NUMBER
from app.scaffold.reasons import is_colour
from app.simulator.values.guesses import NAMES

NUMBERS: Final = frozenset((*FLOAT_TYPES, *INTEGER_RANGES))
MOST_FIELDS: Final = 4
NO_VALUES: Final = re.compile(r"(?:^|_)(?:MIN|MAX|COUNT|SIZE|LENGTH|NUM)(?:_|$)")  # limits, sizes


@dataclass(frozen=True, slots=True, kw_only=True)
class Shown:
    """A field that is shown. Without a range (`low`, `high`, after `scale`) it is no gauge. `constants`
    are those that its values are named by."""

    field: str
    kind: str  # a base type
    word: str = ""  # behind the topic's label
    unit: str = ""
    scale: float = 1.0
    format: str = ""
    low: float | None = None
    high: float | None = None
    constants: tuple[str, ...] = ()


def _number(
    field: str,
    unit: str,
    low: float | None = None,
    high: float | None = None,
    *,
    format: str = ".1f",
    scale: float = 1.0,
    word: str = "",
) -> Shown:
    return Shown(
        field=field,
        kind="float64",
        word=word,
        unit=unit,
        scale=scale,
        format=format,
        low=low,
        high=high,
    )


_SPEED = ("m/s", -2.0, 2.0)
_TURN = ("rad/s", -2.0, 2.0)
KNOWN: Final[Mapping[str, tuple[Shown, ...]]] = {
    "sensor_msgs/msg/Temperature": (_number("temperature", "°C", 0, 100),),
    "sensor_msgs/msg/FluidPressure": (
        _number("fluid_pressure", "bar", 0, 10, scale=0.00001, format=".2f"),
    ),
    "sensor_msgs/msg/RelativeHumidity": (_number("relative_humidity", "%", 0, 100, scale=100.0),),
    "sensor_msgs/msg/Illuminance": (_number("illuminance", "lx", 0, 1000, format=".0f"),),
    "sensor_msgs/msg/Range": (_number("range", "m", 0, 5, format=".2f"),),
    "sensor_msgs/msg/BatteryState": (
        _number("percentage", "%", 0, 100, scale=100.0, format=".0f", word="charge"),
        _number("voltage", "V", word="voltage"),
        _number("current", "A", word="current"),
    ),
    "sensor_msgs/msg/NavSatFix": (
        _number("latitude", "°", format=".6f", word="latitude"),
        _number("longitude", "°", format=".6f", word="longitude"),
    ),
    "sensor_msgs/msg/Imu": (
        _number("linear_acceleration.z", "m/s²", format=".2f", word="acceleration z"),
        _number("angular_velocity.z", "rad/s", format=".2f", word="turn rate"),
    ),
    "geometry_msgs/msg/Twist": (
        _number("linear.x", *_SPEED, format=".2f", word="forward"),
        _number("angular.z", *_TURN, format=".2f", word="turn"),
    ),
    "geometry_msgs/msg/TwistStamped": (
        _number("twist.linear.x", *_SPEED, format=".2f", word="forward"),
        _number("twist.angular.z", *_TURN, format=".2f", word="turn"),
    ),
    "nav_msgs/msg/Odometry": (
        _number("pose.pose.position.x", "m", format=".2f", word="x"),
        _number("pose.pose.position.y", "m", format=".2f", word="y"),
        _number("twist.twist.linear.x", *_SPEED, format=".2f", word="forward"),
    ),
    "geometry_msgs/msg/PoseStamped": (
        _number("pose.position.x", "m", format=".3f", word="x"),
        _number("pose.position.y", "m", format=".3f", word="y"),
        _number("pose.position.z", "m", format=".3f", word="z"),
    ),
    "geometry_msgs/msg/PointStamped": (
        _number("point.x", "m", format=".3f", word="x"),
        _number("point.y", "m", format=".3f", word="y"),
        _number("point.z", "m", format=".3f", word="z"),
    ),
    "geometry_msgs/msg/WrenchStamped": (
        _number("wrench.force.x", "N", -200, 200, word="force x"),
        _number("wrench.force.y", "N", -200, 200, word="force y"),
        _number("wrench.force.z", "N", -200, 200, word="force z"),
    ),
}


# Their messages are for programs, but for those in KNOWN: clouds, scans, maps, paths, markers.
FOR_PROGRAMS: Final = frozenset(
    (
        *("action_msgs", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs"),
        *("map_msgs", "nav_msgs", "pcl_msgs", "rcl_interfaces", "rosgraph_msgs", "sensor_msgs"),
        *("service_msgs", "shape_msgs", "statistics_msgs", "stereo_msgs", "tf2_msgs"),
        *("trajectory_msgs", "type_description_interfaces", "visualization_msgs"),
    )
)


def shown_fields(type_name: str, interfaces: Interfaces) -> Iterator[Shown]:
    """The fields of a type that are worth showing: the usual ones, else its first plain ones."""
    if type_name in KNOWN:
        yield from KNOWN[type_name]
    if type_name.partition("/")[0] in FOR_PROGRAMS or is_colour(type_name, interfaces):
        return
    plain = [
        field
        for field in interfaces.structures[type_name].fields
        if (not field.type.is_nested or field.type.name in DEFAULT_FORMATS)
        and field.type.container == "one"
        and field.type.name != "wstring"
    ]
    for plain_field in plain[:MOST_FIELDS]:
        word = (
            "" if plain_field.name == "data" and len(plain) == 1 else plain_field.name.replace("_", " ")
        )
        number = plain_field.type.name in NUMBERS
        text = ".2f" if plain_field.type.name in FLOAT_TYPES else ""
        named = constants_of(interfaces.structures[type_name], plain_field)
        kind = "float64" if number else plain_field.type.name
        yield Shown(field=plain_field.name, kind=kind, word=word, format=text, constants=named)


def constants_of(structure: Structure, field: Field) -> tuple[str, ...]:
    """The names of the constants that a field has as values: those that begin with the last words of
    its name ("MODE_" of `drive_mode`), else all of a type with one whole number. () for none."""
    if field.type.name not in INTEGER_RANGES:
        return ()
    numbers = {
        name: value
        for name, value in structure.constants.items()
        if isinstance(value, int) and not isinstance(value, bool) and not NO_VALUES.search(name)
    }
    words = field.name.upper().split("_")
    begins = [f"{'_'.join(words[n:])}_" for n in range(len(words))]
    named = ([name for name in numbers if name.startswith(begin)] for begin in begins)
    group = next((names for names in named if len(names) > 1), [])
    if not group and sum(field.type.name in INTEGER_RANGES for field in structure.fields) == 1:
        group = list(numbers)
    values = [numbers[name] for name in group]
    return tuple(group) if len(values) > 1 and len({*values}) == len(values) else ()


def range_for(shown: Shown, names: tuple[str, ...], value: float | None) -> tuple[float, float] | None:
    """The ends of a gauge's scale: the usual ones of the type, else by a word in the name, wide enough
    for the value that was seen. None where neither says one, or a panel file can't have so wide a
    scale."""
    low, high = shown.low, shown.high
    if low is None or high is None:
        by_name = (span for name in names for words, span in NAMES if words.search(name))
        span = next(by_name, None)
        if span is None or span.high <= span.low or span.shape == "count":
            return None
        low = min(0.0, _round_away(span.low))
        high = max(0.0, _round_away(span.high))
    if value is not None and isfinite(value):
        low, high = min(low, _round_away(value)), max(high, _round_away(value))
    return (low, high) if max(-low, high) <= MAX_EXACT_NUMBER else None


def _round_away(value: float) -> float:
    """The next of 1, 2, 5, 10, 20, … further from zero, for every finite number; infinite where there
    is none."""
    if value == 0:
        return 0.0
    size = abs(value)
    steps = (float(f"{step}e{floor(log10(size))}") for step in (1, 2, 5, 10))
    return copysign(next(step for step in steps if step >= size * (1 - 1e-9)), value)
