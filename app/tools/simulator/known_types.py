"""Plausible messages: of types whose fields belong together, and of any other type. Pure, from a
moment."""

import math
import struct
import time
import zlib
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from app.ros.cdr.selection import Resolver
from app.ros.messages import INTEGER_RANGES, PLACEHOLDER, Interfaces, Structure, Type
from app.ros.messages.definitions import FLOAT_TYPES, Field, zero_value
from app.ros.messages.field_path import FieldCall
from app.tools.simulator.values import (
    PHRASES,
    Signal,
    Structures,
    battery_level,
    cycle,
    get,
    guessed,
    is_charging,
    phase_of,
    put,
    swing,
)
from app.tools.simulator.values import Fields as MessageFields

# The picture of a simulated camera: grey, with a bright square that moves, and the time.

SIZE: Final = (160, 120)  # pixels
SQUARE: Final = 20
PIXEL: Final = 4  # of the figures
NS_PER_S: Final = 10**9
# Three by five pixels each, a bit for each, rows from the top.
FIGURES: Final = {
    "0": (7, 5, 5, 5, 7),
    "1": (2, 6, 2, 2, 7),
    "2": (7, 1, 7, 4, 7),
    "3": (7, 1, 7, 1, 7),
    "4": (5, 5, 7, 1, 1),
    "5": (7, 4, 7, 1, 7),
    "6": (7, 4, 7, 5, 7),
    "7": (7, 1, 1, 1, 1),
    "8": (7, 5, 7, 5, 7),
    "9": (7, 5, 7, 1, 7),
    ":": (0, 2, 0, 2, 0),
}


def grey_pixels(t: float, wall_ns: int) -> bytes:
    """A byte for each pixel, `t` seconds after the robot's start."""
    width, height = SIZE
    row = bytes(40 + column * 80 // width for column in range(width))
    left = int(t * SQUARE) % (width - SQUARE)
    marked = row[:left] + bytes([200]) * SQUARE + row[left + SQUARE :]
    square = range(height - 2 * SQUARE, height - SQUARE)
    pixels = bytearray(b"".join(marked if y in square else row for y in range(height)))
    clock = time.strftime("%H:%M:%S", time.localtime(wall_ns // NS_PER_S))
    for number, figure in enumerate(clock):
        _draw(pixels, FIGURES[figure], (width - 4 * PIXEL * len(clock)) // 2 + 4 * PIXEL * number)
    return bytes(pixels)


def _draw(pixels: bytearray, figure: tuple[int, ...], left: int) -> None:
    """One figure, near the top."""
    for y, bits in enumerate(figure):
        for x in range(3):
            if bits >> (2 - x) & 1:
                for line in range(PIXEL):
                    at = (3 * PIXEL + y * PIXEL + line) * SIZE[0] + left + x * PIXEL
                    pixels[at : at + PIXEL] = bytes([240]) * PIXEL


def png(grey: bytes) -> bytes:
    """A picture of 8-bit grey as a PNG file (ISO/IEC 15948)."""
    width, height = SIZE

    def chunk(name: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = b"".join(b"\0" + grey[y * width : (y + 1) * width] for y in range(height))
    about = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    parts = chunk(b"IHDR", about) + chunk(b"IDAT", zlib.compress(rows, 1)) + chunk(b"IEND", b"")
    return b"\x89PNG\r\n\x1a\n" + parts


# Plausible messages of types whose fields belong together: pure, from a moment.
#
# Types that are not here are made field by field: see `messages.py`.

Fields = dict[str, Any]

JOINTS: Final = tuple(f"joint_{number}" for number in range(1, 7))
PARTS: Final = ("drive", "gripper", "safety controller")
TURN_S: Final = 40.0  # a round of a mobile robot
BEAMS: Final = 180
MAP: Final = (48, 32)  # cells


@dataclass(frozen=True, slots=True)
class Moment:
    """`t` is in seconds since the robot's start, `wall_ns` in nanoseconds since the epoch."""

    t: float
    wall_ns: int


# Of a structure: a moment, and the names that the panel looks for in it → its fields.
Generator = Callable[[Moment, Collection[str]], Fields]


def stamp(moment: Moment, _: Collection[str] = ()) -> Fields:
    seconds, rest = divmod(moment.wall_ns, NS_PER_S)
    return {"sec": seconds & 0x7FFFFFFF, "nanosec": rest}


def _header(moment: Moment, _: Collection[str]) -> Fields:
    return {"stamp": stamp(moment), "frame_id": "base_link"}


def header(moment: Moment) -> Fields:
    return _header(moment, ())


def _round(moment: Moment) -> float:
    """The angle of a mobile robot on its round."""
    return 2 * math.pi * moment.t / TURN_S


def _point(moment: Moment, _: Collection[str]) -> Fields:
    at = _round(moment)
    return {"x": 2 * math.cos(at), "y": 1.2 * math.sin(at), "z": 0.0}


def _quaternion(moment: Moment, _: Collection[str]) -> Fields:
    half = (_round(moment) + math.pi / 2) % (2 * math.pi) / 2
    return {"x": 0.0, "y": 0.0, "z": math.sin(half), "w": math.cos(half)}


def _twist(moment: Moment, _: Collection[str]) -> Fields:
    speed = 0.35 + 0.15 * math.cos(2 * _round(moment))
    return {"linear": {"x": speed}, "angular": {"z": 2 * math.pi / TURN_S}}


def _wrench(moment: Moment, _: Collection[str]) -> Fields:
    at = moment.t / 3
    force = {"x": 4 * math.sin(at), "y": 3 * math.cos(at), "z": 20 + 8 * math.sin(at / 2)}
    return {"force": force, "torque": {"x": 0.4 * math.cos(at), "y": 0.3, "z": 0.2 * math.sin(at)}}


def _joints(moment: Moment, wanted: Collection[str]) -> Fields:
    names = list(wanted) or list(JOINTS)
    turns = [2 * math.pi * (moment.t / 16 + phase_of(name)) for name in names]
    return {
        "header": header(moment),
        "name": names,
        "position": [1.2 * math.sin(turn) for turn in turns],
        "velocity": [0.47 * math.cos(turn) for turn in turns],
        "effort": [12 * math.sin(turn + 0.4) for turn in turns],
    }


def _battery(moment: Moment, _: Collection[str]) -> Fields:
    level, charging = battery_level(moment.t), is_charging(moment.t)
    return {
        "header": header(moment),
        "voltage": 22 + 6.4 * level,
        "temperature": 27 + 6 * (1 - level),
        "current": 8.5 if charging else -3.2,
        "charge": 40 * level,
        "capacity": 39.2,
        "design_capacity": 40.0,
        "percentage": level,
        "power_supply_status": 1 if charging else 2,
        "power_supply_health": 1,
        "power_supply_technology": 2,
        "present": True,
        "cell_voltage": [(22 + 6.4 * level) / 7] * 7,
        "location": "base",
    }


def _imu(moment: Moment, wanted: Collection[str]) -> Fields:
    return {
        "header": header(moment),
        "orientation": _quaternion(moment, wanted),
        "angular_velocity": {"z": 2 * math.pi / TURN_S},
        "linear_acceleration": {"x": 0.1 * math.sin(moment.t), "z": 9.81},
    }


def _temperature(moment: Moment, _: Collection[str]) -> Fields:
    return {"header": header(moment), "temperature": 38 + 9 * math.sin(moment.t / 9)}


def _pressure(moment: Moment, _: Collection[str]) -> Fields:
    return {"header": header(moment), "fluid_pressure": 570_000 + 60_000 * math.sin(moment.t / 7)}


def _range(moment: Moment, _: Collection[str]) -> Fields:
    limits = {"field_of_view": 0.26, "min_range": 0.05, "max_range": 4.0}
    return {"header": header(moment), **limits, "range": 1.5 + math.sin(moment.t / 4)}


def _scan(moment: Moment, _: Collection[str]) -> Fields:
    """The walls of a room of 6 by 4 m, and a person who walks by."""
    step = 2 * math.pi / BEAMS
    walker = int(moment.t * 6) % BEAMS
    ranges = []
    for beam in range(BEAMS):
        x, y = abs(math.cos(beam * step)), abs(math.sin(beam * step))
        wall = min(3 / max(x, 1e-6), 2 / max(y, 1e-6))
        ranges.append(1.4 if (beam - walker) % BEAMS < 6 else wall)
    return {
        "header": {**header(moment), "frame_id": "base_link"},
        "angle_min": 0.0,
        "angle_max": 2 * math.pi - step,
        "angle_increment": step,
        "scan_time": 0.2,
        "range_min": 0.05,
        "range_max": 8.0,
        "ranges": ranges,
    }


def _fix(moment: Moment, _: Collection[str]) -> Fields:
    at = _round(moment)
    place = {"latitude": 48.137 + 1e-4 * math.sin(at), "longitude": 11.575 + 1e-4 * math.cos(at)}
    return {"header": header(moment), **place, "altitude": 519.0}


def _image(moment: Moment, _: Collection[str]) -> Fields:
    width, height = SIZE
    shape = {"width": width, "height": height, "encoding": "mono8", "step": width}
    return {"header": header(moment), **shape, "data": grey_pixels(moment.t, moment.wall_ns)}


def _png(moment: Moment) -> bytes:
    return png(grey_pixels(moment.t, moment.wall_ns))


def _compressed(moment: Moment, _: Collection[str]) -> Fields:
    return {
        "header": header(moment),
        "format": "png",
        "data": png(grey_pixels(moment.t, moment.wall_ns)),
    }


def _map(moment: Moment, below: Collection[str]) -> Fields:
    """A room with walls and a table, which is elsewhere if there are levels `below` it."""
    width, height = MAP
    left = 18 - 5 * (len(below) % 4)
    cells = []
    for y in range(height):
        for x in range(width):
            wall = x in (0, width - 1) or y in (0, height - 1)
            table = left <= x < left + 8 and 12 <= y < 18
            cells.append(100 if wall or table else 0)
    about = {"resolution": 0.125, "width": width, "height": height}
    origin = {"position": {"x": -3.0, "y": -2.0}, "orientation": {"w": 1.0}}
    return {
        "header": {**header(moment), "frame_id": "map"},
        "info": {"map_load_time": stamp(moment), **about, "origin": origin},
        "data": cells,
    }


def _pose(moment: Moment, wanted: Collection[str]) -> Fields:
    return {"position": _point(moment, wanted), "orientation": _quaternion(moment, wanted)}


def _on_map(moment: Moment, pose: Fields) -> Fields:
    """A pose in the frame of the map."""
    return {"header": {**header(moment), "frame_id": "map"}, "pose": pose}


def _path(moment: Moment, wanted: Collection[str]) -> Fields:
    """Ahead of where a robot is."""
    here = _point(moment, wanted)
    places = [{"x": here["x"] + 0.1 * step, "y": here["y"] + 0.002 * step**2} for step in range(25)]
    poses = [_on_map(moment, {"position": place, "orientation": {"w": 1.0}}) for place in places]
    return {"header": {**header(moment), "frame_id": "map"}, "poses": poses}


def _polygon(moment: Moment, _: Collection[str]) -> Fields:
    """The corners of a robot."""
    corners = [{"x": x, "y": y} for x, y in ((0.4, 0.3), (-0.4, 0.3), (-0.4, -0.3), (0.4, -0.3))]
    return {"header": {**header(moment), "frame_id": "base_link"}, "polygon": {"points": corners}}


def _map_update(moment: Moment, _: Collection[str]) -> Fields:
    """Nothing of a map changes."""
    return {"header": {**header(moment), "frame_id": "map"}}


def _located(moment: Moment, wanted: Collection[str]) -> Fields:
    """A pose that is known to within some centimetres."""
    covariance = [0.0] * 36
    covariance[0], covariance[7] = 0.006, 0.003
    return _on_map(moment, {"pose": _pose(moment, wanted), "covariance": covariance})


def _transforms(moment: Moment, wanted: Collection[str]) -> Fields:
    """From the map to the robot, as its localization and its wheels have it."""
    moved = {"translation": _point(moment, wanted), "rotation": _quaternion(moment, wanted)}
    parents = (("map", "odom", {"rotation": {"w": 1.0}}), ("odom", "base_link", moved))
    return {
        "transforms": [
            {
                "header": {**header(moment), "frame_id": parent},
                "child_frame_id": child,
                "transform": way,
            }
            for parent, child, way in parents
        ]
    }


def static_transforms(moment: Moment) -> Fields:
    """Where a sensor is on the robot: a transform of `/tf_static` does not change."""
    mounted = {"translation": {"x": 0.2, "y": 0.0, "z": 0.3}, "rotation": {"w": 1.0}}
    transform = {"header": header(moment), "child_frame_id": "base_scan", "transform": mounted}
    return {"transforms": [transform]}


def _diagnostic(name: str, moment: Moment) -> Fields:
    bad = (moment.t / 30 + phase_of(name)) % 1 > 0.85
    return {
        "level": 1 if bad else 0,
        "name": name,
        "message": "temperature is high" if bad else "ok",
        "hardware_id": name,
        "values": [{"key": "temperature", "value": f"{40 + 15 * bad} °C"}],
    }


def _diagnostics(moment: Moment, wanted: Collection[str]) -> Fields:
    names = list(wanted) or list(PARTS)
    return {"header": header(moment), "status": [_diagnostic(name, moment) for name in names]}


def _log(moment: Moment, _: Collection[str]) -> Fields:
    words = ("cycle started", "part gripped", "part placed", "cycle done")
    text = words[int(moment.t / 3) % len(words)]
    return {"stamp": stamp(moment), "level": 20, "name": "cell", "msg": text, "file": "cell.cpp"}


GENERATORS: Final[Mapping[str, Generator]] = {
    "builtin_interfaces/msg/Time": stamp,
    "builtin_interfaces/msg/Duration": lambda moment, _: {"sec": int(moment.t) % 3600},
    "std_msgs/msg/Header": _header,
    "std_msgs/msg/ColorRGBA": lambda *_: {"r": 0.2, "g": 0.5, "b": 0.9, "a": 1.0},
    "geometry_msgs/msg/Point": _point,
    "geometry_msgs/msg/Quaternion": _quaternion,
    "geometry_msgs/msg/Twist": _twist,
    "geometry_msgs/msg/Wrench": _wrench,
    "geometry_msgs/msg/PoseStamped": lambda moment, wanted: _on_map(moment, _pose(moment, wanted)),
    "geometry_msgs/msg/PoseWithCovarianceStamped": _located,
    "geometry_msgs/msg/PolygonStamped": _polygon,
    "map_msgs/msg/OccupancyGridUpdate": _map_update,
    "tf2_msgs/msg/TFMessage": _transforms,
    "sensor_msgs/msg/JointState": _joints,
    "sensor_msgs/msg/BatteryState": _battery,
    "sensor_msgs/msg/Imu": _imu,
    "sensor_msgs/msg/Temperature": _temperature,
    "sensor_msgs/msg/FluidPressure": _pressure,
    "sensor_msgs/msg/Range": _range,
    "sensor_msgs/msg/LaserScan": _scan,
    "sensor_msgs/msg/NavSatFix": _fix,
    "sensor_msgs/msg/Image": _image,
    "sensor_msgs/msg/CompressedImage": _compressed,
    "nav_msgs/msg/OccupancyGrid": _map,
    "nav_msgs/msg/Path": _path,
    "diagnostic_msgs/msg/DiagnosticArray": _diagnostics,
    "rcl_interfaces/msg/Log": _log,
    "lifecycle_msgs/msg/State": lambda *_: {"id": 3, "label": "active"},
}


# Plausible messages of any type: each is made for a moment, from its type alone.
#
# Fields that belong together are those of `known_types.py`; each other field moves by its name and
# type.

Message = Callable[[Moment], Fields]
Part = Callable[[Moment], Any]

DEEPEST: Final = 5  # structures in structures
LENGTH: Final = 6  # numbers of a sequence without a bound
FEW: Final = 3  # structures of a sequence


def plausible(type_name: str, interfaces: Interfaces, wanted: Collection[str] = ()) -> Message:
    """Messages of a type; `wanted` are the names that a panel looks for in lists of the message."""
    return _message(interfaces.structures[type_name], interfaces.structures, tuple(wanted), 0)


def _message(
    structure: Structure, structures: Mapping[str, Structure], wanted: tuple[str, ...], depth: int
) -> Message:
    known = GENERATORS.get(structure.name)
    if known is not None:
        return lambda moment: known(moment, wanted)
    parts: dict[str, Part] = {}
    for field in structure.fields if depth < DEEPEST else ():
        part = _part(field, structure, structures, wanted, depth)
        if part is not None:
            parts[field.name] = part
    return lambda moment: {name: part(moment) for name, part in parts.items()}


def _part(
    field: Field,
    structure: Structure,
    structures: Mapping[str, Structure],
    wanted: tuple[str, ...],
    depth: int,
) -> Part | None:
    """One field; None where its default is as good."""
    kind = field.type
    if field.name == PLACEHOLDER or field.name in ("layout", "uuid"):
        return None
    if kind.is_nested:
        inner = _message(structures[kind.name], structures, wanted, depth + 1)
        if kind.container == "one":
            return inner
        size = kind.size if kind.container == "array" else min(FEW, kind.size or FEW)
        if depth + 1 >= DEEPEST:
            return None if kind.container == "sequence" else lambda _: [{}] * size
        return lambda moment: [inner(moment) for _ in range(size)]
    if kind.container != "one":
        return _several(field.name, kind)
    constants = field_constants(field.name, structure)
    signal: Signal
    if constants and kind.name in INTEGER_RANGES:
        signal = cycle(constants, phase=phase_of(field.name))
    else:
        signal = guessed(kind.name, kind.bound, field.name)
    return lambda moment: signal(moment.t)


def _several(name: str, kind: Type) -> Part | None:
    """A list of base types. A fixed one, such as a covariance, stays at zero."""
    if kind.container == "array":
        return None
    size = min(LENGTH, kind.size or LENGTH)
    if kind.name in FLOAT_TYPES:
        signals = [swing(-1, 1, phase=phase_of(f"{name}{i}")) for i in range(size)]
        return lambda moment: [signal(moment.t) for signal in signals]
    if kind.name in INTEGER_RANGES:
        return lambda moment: [(i + int(moment.t)) % 100 for i in range(size)]
    if kind.name == "bool":
        return lambda moment: [(i + int(moment.t / 5)) % FEW == 0 for i in range(size)]
    words = [text[: kind.bound or None] for text in PHRASES[: min(FEW, size)]]
    return lambda _: list(words)


def field_constants(name: str, structure: Structure) -> list[Any]:
    """The values of the constants that begin with a field's name, each once."""
    prefix = f"{name}_".upper()
    values = (value for constant, value in structure.constants.items() if constant.startswith(prefix))
    return list(dict.fromkeys(values))


# Puts fields into a message so that a function of them has a value: the inverse of
# `interfaces.field_functions`, as far as one is plausible. Pure.

FEW_NUMBERS: Final = 6  # numbers of a list that has none
MOST: Final = 100  # elements of a list of which the length is shown


def put_result(
    fields: MessageFields,
    type_name: str,
    call: FieldCall,
    value: Any,
    structures: Structures,
    moment: Moment,
) -> None:
    """Sets the fields of a function, so that its result is a number."""
    resolver = Resolver(structures)
    kind = resolver.type_at(type_name, call.paths[0])
    held = [get(fields, resolver.typed_steps(type_name, path)) for path in call.paths]
    match call.name:
        case "yaw":
            made: Any = {"x": 0.0, "y": 0.0, "z": math.sin(value / 2), "w": math.cos(value / 2)}
        case "norm":
            made = {"x": value}
        case "min" | "max":
            made = _extreme(call.name, held[0], value, kind.size)
        case "length":
            made = [zero_value(kind.element)] * (kind.size or max(0, min(round(value), MOST)))
        case "age":
            made = stamp(Moment(moment.t, moment.wall_ns - round(value * NS_PER_S)))
        case _:
            made = (held[1] or 0) + value
    put(fields, type_name, call.paths[0], made, structures)


_CHOOSE: Final[Mapping[str, Callable[[Any, Any], Any]]] = {"min": max, "max": min}


def _extreme(name: str, held: Any, value: Any, size: int) -> list[Any]:
    """The list with this least or greatest number."""
    rest = list(held or ()) or [value] * (size or FEW_NUMBERS)
    return [value, *(_CHOOSE[name](number, value) for number in rest[1:])]
