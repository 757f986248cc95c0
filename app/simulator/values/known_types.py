"""Plausible messages of types whose fields belong together: pure, from a moment.

Types that are not here are made field by field: see `messages.py`.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass
from typing import Any, Final

from app.simulator.values.clock_picture import SIZE, grey_pixels, png
from app.simulator.values.signals import battery_level, is_charging, phase_of

Fields = dict[str, Any]
NS_PER_S: Final = 10**9

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
Made = Callable[[Moment, Collection[str]], Fields]


def time(moment: Moment, _: Collection[str] = ()) -> Fields:
    seconds, rest = divmod(moment.wall_ns, NS_PER_S)
    return {"sec": seconds & 0x7FFFFFFF, "nanosec": rest}


def _header(moment: Moment, _: Collection[str]) -> Fields:
    return {"stamp": time(moment), "frame_id": "base_link"}


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
        "header": header(moment),
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


def _map(moment: Moment, _: Collection[str]) -> Fields:
    """A room with walls and a table."""
    width, height = MAP
    cells = []
    for y in range(height):
        for x in range(width):
            wall = x in (0, width - 1) or y in (0, height - 1)
            table = 18 <= x < 26 and 12 <= y < 18
            cells.append(100 if wall or table else 0)
    about = {"resolution": 0.125, "width": width, "height": height}
    origin = {"position": {"x": -3.0, "y": -2.0}, "orientation": {"w": 1.0}}
    return {
        "header": {**header(moment), "frame_id": "map"},
        "info": {"map_load_time": time(moment), **about, "origin": origin},
        "data": cells,
    }


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
    return {"stamp": time(moment), "level": 20, "name": "cell", "msg": text, "file": "cell.cpp"}


KNOWN: Final[Mapping[str, Made]] = {
    "builtin_interfaces/msg/Time": time,
    "builtin_interfaces/msg/Duration": lambda moment, _: {"sec": int(moment.t) % 3600},
    "std_msgs/msg/Header": _header,
    "std_msgs/msg/ColorRGBA": lambda *_: {"r": 0.2, "g": 0.5, "b": 0.9, "a": 1.0},
    "geometry_msgs/msg/Point": _point,
    "geometry_msgs/msg/Quaternion": _quaternion,
    "geometry_msgs/msg/Twist": _twist,
    "geometry_msgs/msg/Wrench": _wrench,
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
    "diagnostic_msgs/msg/DiagnosticArray": _diagnostics,
    "rcl_interfaces/msg/Log": _log,
    "lifecycle_msgs/msg/State": lambda *_: {"id": 3, "label": "active"},
}
