"""The parts of a draft: widgets with their keys and comments, ids and labels, and which fields are
shown."""

import re
from collections import defaultdict
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import copysign, floor, isfinite, log10
from typing import Any, Final

from app.panel.times import DEFAULT_FORMATS
from app.panel.widgets.numbers import MAX_EXACT_NUMBER
from app.ros.messages import Interfaces
from app.ros.messages.definitions import FLOAT_TYPES, INTEGER_RANGES, Field, Structure
from app.tools.simulator.values import NAMES

# The parts of a panel file that is being made: widgets with their keys, and the comments on them.


@dataclass(frozen=True, slots=True, kw_only=True)
class DraftWidget:
    """One widget. `keys` are its keys but for its id, in their order; a list of mappings becomes one
    inline table a line. `comment` stands above it. `control`: it acts on the robot.

    `place` are the parts of its namespace, or else of its node: its page. A control's `scope` is the
    namespace whose permission it needs, `nodes` are those that it acts on, and `interlock` is the id of
    a candidate, "" for none. `is_input`: a control that others take their values from.
    """

    kind: str
    name: str  # of the topic, service, action or node that it is about: its id is made of it
    keys: Mapping[str, Any]
    comment: str = ""
    control: bool = False
    place: tuple[str, ...] = ()
    scope: str = ""
    nodes: tuple[str, ...] = ()
    interlock: str = ""
    is_input: bool = False


@dataclass(frozen=True, slots=True)
class Omission:
    """A topic, or a field of one, without a widget: why."""

    name: str
    why: str


@dataclass(frozen=True, slots=True, kw_only=True)
class InterlockCandidate:
    """A topic that may permit what the robot does."""

    id: str
    label: str
    topic: str
    type: str
    is_latched: bool  # its publisher keeps the last value for those that come late
    owners: tuple[str, ...] = ()  # the nodes that publish it
    nodes: str = ""  # the names of its publishers' nodes, where there are several


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnosticAlarms:
    """The alarms of a topic with diagnostics, one for each status. `keys` are those of its table, but
    for its id."""

    topic: str
    keys: Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Draft:
    """A panel file that is not written yet. `remarks` are lines about what has no widget; `alike` are
    namespaces that look like robots."""

    title: str
    namespace: str = ""
    reached: Mapping[str, Any] = field(default_factory=dict)  # `dialect` and `domain`, if not the usual
    robots: Sequence[Mapping[str, Any]] = ()
    distro: str = "jazzy"
    interfaces: Sequence[str] = ()
    interlocks: Sequence[InterlockCandidate] = ()
    alarms: Sequence[DiagnosticAlarms] = ()
    pages: Mapping[str, Sequence[DraftWidget]] = field(default_factory=dict)
    remarks: Sequence[str] = ()
    alike: Sequence[str] = ()


# Ids, labels and pages from ROS names.

MAX_ID: Final = 58  # with a number behind it 64 at most
MAX_LABEL: Final = 40
GENERAL: Final = "robot"
# Names of bools that report a fault: true does not permit anything.
NEGATIVE: Final = re.compile(
    r"error|fault|fail|emergency|e_?stop|stopped|alarm|warn|blocked|collision|jam|abort|disable|inhibit",
    re.IGNORECASE,
)
POSITIVE: Final = re.compile(
    r"enable|permit|allow|permission|automatic|auto(?:_|$)|ready|interlock|release|safe|guard|operational",
    re.IGNORECASE,
)


def words_of(name: str) -> list[str]:
    """ "/arm/jointStates" → ["arm", "joint", "states"]."""
    parts = re.sub(r"(?<=[a-z0-9])(?=[A-Z])", "_", name)
    return [word.lower() for word in re.split(r"[^A-Za-z0-9]+", parts) if word]


def id_of(name: str, taken: Collection[str]) -> str:
    """An id that is not taken, of a name or of several with a slash between them."""
    base = "_".join(words_of(name))[:MAX_ID] or "widget"
    base = base if base[0].isalpha() else f"n_{base}"
    return next(i for n in range(1, 10_000) if (i := base if n == 1 else f"{base}_{n}") not in taken)


def label_of(name: str) -> str:
    """A label of the last part of a name: "/arm/joint_states" → "Joint states"."""
    text = " ".join(words_of(name.rstrip("/").rpartition("/")[2])) or name
    return (text[0].upper() + text[1:])[:MAX_LABEL]


def place_of(name: str, nodes: Collection[str]) -> tuple[str, ...]:
    """The parts of the namespace of a topic or service, else of the node that it belongs to."""
    namespace = name.strip("/").split("/")[:-1]
    node = min(nodes, default="").strip("/").split("/")
    return tuple(filter(None, namespace or node)) or (GENERAL,)


def permits(name: str) -> bool:
    """Whether a bool of this name is likely to permit what the robot does."""
    return bool(POSITIVE.search(name)) and not NEGATIVE.search(name)


# Labels that tell widgets apart. Pure.

LONGEST_LABEL: Final = 100


def with_own_labels(entries: Sequence[DraftWidget]) -> list[DraftWidget]:
    """The entries, no two with the same label."""
    labels = own_labels([(str(entry.keys["label"]), entry.name) for entry in entries])
    return [
        entry if label == entry.keys["label"] else replace(entry, keys={**entry.keys, "label": label})
        for entry, label in zip(entries, labels, strict=True)
    ]


def own_labels(labelled: Sequence[tuple[str, str]]) -> list[str]:
    """The labels of (label, ROS name), each once: where several are alike, the parts by which the names
    differ come first ("Left home"), or the whole name is the label."""
    alike: defaultdict[str, list[int]] = defaultdict(list)
    for place, (label, _) in enumerate(labelled):
        alike[label.lower()].append(place)
    labels = [label for label, _ in labelled]
    for places in alike.values():
        for place, parts in zip(places, _differing(labelled[at][1] for at in places), strict=True):
            labels[place] = _label(parts, labels[place]) if len(places) > 1 else labels[place]
    taken: set[str] = set()
    for place, (_, name) in enumerate(labelled):
        if labels[place].lower() in taken:
            labels[place] = next(
                text
                for number in range(1, len(labels) + 2)
                if (text := _numbered(name, number)).lower() not in taken
            )
        taken.add(labels[place].lower())
    return labels


def _label(parts: Sequence[str], label: str) -> str:
    before = " ".join(words_of("/".join(parts)))
    text = f"{before} {label[0].lower()}{label[1:]}" if before else label
    return (text[0].upper() + text[1:])[:LONGEST_LABEL]


def _numbered(name: str, number: int) -> str:
    return name[-LONGEST_LABEL:] if number == 1 else f"{name[-LONGEST_LABEL:]} {number}"


def _differing(names: Iterable[str]) -> list[list[str]]:
    """The parts of each name without those at their begin and end that all have."""
    split = [name.strip("/").split("/") for name in names]
    least = min(map(len, split))
    first = next((n for n in range(least) if len({parts[n] for parts in split}) > 1), least)
    most = least - first
    last = next((n for n in range(most) if len({parts[-1 - n] for parts in split}) > 1), most)
    return [parts[first : len(parts) - last] for parts in split]


# Why a topic has no widget. Pure.

_FOR_TOOLS: Final = "{} is drawn by tools such as RViz or Foxglove; a panel has no widget for it"
# ROS's own topics that one may look for.
OF_NAMES: Final[Mapping[str, str]] = {
    "/tf": _FOR_TOOLS.format("the tree of frames"),
    "/tf_static": _FOR_TOOLS.format("the tree of frames"),
    "/robot_description": "the robot's model is a whole file as one text",
    "/diagnostics_agg": "it has what /diagnostics has",
}
OF_TYPES: Final[Mapping[str, str]] = {
    "nav_msgs/msg/OccupancyGrid": 'it is not named map; kind = "map" shows it if it is one',
} | {
    name: _FOR_TOOLS.format(noun)
    for name, noun in {
        "map_msgs/msg/OccupancyGridUpdate": "a map",
        "nav_msgs/msg/GridCells": "a map",
        "nav_msgs/msg/MapMetaData": "a map",
        "nav_msgs/msg/Path": "a path",
        "sensor_msgs/msg/LaserScan": "a laser scan",
        "sensor_msgs/msg/MultiEchoLaserScan": "a laser scan",
        "sensor_msgs/msg/PointCloud": "a point cloud",
        "sensor_msgs/msg/PointCloud2": "a point cloud",
        "tf2_msgs/msg/TFMessage": "the tree of frames",
        "visualization_msgs/msg/Marker": "a marker",
        "visualization_msgs/msg/MarkerArray": "a marker",
    }.items()
}
NO_JOINTS: Final = "no message arrived that names its joints"
NO_MESSAGE: Final = "give the message that a key sends"
COLOURS: Final = (frozenset("rgb"), frozenset(("red", "green", "blue")))


def is_colour(type_name: str, interfaces: Interfaces) -> bool:
    """Whether the fields of a type are a colour's."""
    names = {field.name for field in interfaces.structures[type_name].fields}
    return any(names >= colour for colour in COLOURS)


def why_no_display(type_name: str, interfaces: Interfaces) -> str:
    """The reason of a type without a field that is worth showing."""
    if type_name in OF_TYPES:
        return OF_TYPES[type_name]
    if is_colour(type_name, interfaces):
        return "no widget shows a colour"
    return "no field of it is a number, text or bool for operators"


def too_long(length: int) -> str:
    """The reason of a text that is no line of a display."""
    return f"its text of {length:,} characters is too long for a page"


# Which fields of the usual types are worth showing, with units and ranges.

NUMBERS: Final = frozenset((*FLOAT_TYPES, *INTEGER_RANGES))
MOST_FIELDS: Final = 4
NO_VALUES: Final = re.compile(r"(?:^|_)(?:MIN|MAX|COUNT|SIZE|LENGTH|NUM)(?:_|$)")  # limits, sizes


@dataclass(frozen=True, slots=True, kw_only=True)
class FieldCandidate:
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
) -> FieldCandidate:
    return FieldCandidate(
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
FIELDS_BY_TYPE: Final[Mapping[str, tuple[FieldCandidate, ...]]] = {
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


# Their messages are for programs, but for those in FIELDS_BY_TYPE: clouds, scans, maps, paths, markers.
FOR_PROGRAMS: Final = frozenset(
    (
        *("action_msgs", "builtin_interfaces", "diagnostic_msgs", "geometry_msgs", "lifecycle_msgs"),
        *("map_msgs", "nav_msgs", "pcl_msgs", "rcl_interfaces", "rosgraph_msgs", "sensor_msgs"),
        *("service_msgs", "shape_msgs", "statistics_msgs", "stereo_msgs", "tf2_msgs"),
        *("trajectory_msgs", "type_description_interfaces", "visualization_msgs"),
    )
)


def shown_fields(type_name: str, interfaces: Interfaces) -> Iterator[FieldCandidate]:
    """The fields of a type that are worth showing: the usual ones, else its first plain ones."""
    if type_name in FIELDS_BY_TYPE:
        yield from FIELDS_BY_TYPE[type_name]
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
        yield FieldCandidate(field=plain_field.name, kind=kind, word=word, format=text, constants=named)


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


def range_for(
    shown: FieldCandidate, names: tuple[str, ...], value: float | None
) -> tuple[float, float] | None:
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
