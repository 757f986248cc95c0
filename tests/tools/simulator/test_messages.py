"""Plausible messages of every type, and values at the paths of fields."""

import struct
import zlib
from typing import Any, Final

import pytest

from app.tools.simulator.known_types import GENERATORS, SIZE, Fields, Moment, plausible
from app.tools.simulator.values import (
    ANYTHING,
    as_type,
    battery_level,
    count,
    cycle,
    get,
    put,
    span_of,
    swing,
)
from tests.support.builders import INTERFACES

NOON_NS: Final = 1_700_000_000 * 10**9
TIMES: Final = (0.0, 3.3, 47.0, 1e4, 3e6)
JOINTS: Final = "sensor_msgs/msg/JointState"
STRUCTURES: Final = INTERFACES.structures


def made(type_name: str, t: float = 0.0, *wanted: str) -> Fields:
    return plausible(type_name, INTERFACES, wanted)(Moment(t, NOON_NS))


@pytest.mark.parametrize("package", sorted({name.split("/")[0] for name in STRUCTURES}))
def test_every_type_has_messages_at_any_time(package: str) -> None:
    for name in (name for name in STRUCTURES if name.startswith(f"{package}/")):
        for t in TIMES:
            payload = INTERFACES.encode(name, made(name, t))
            INTERFACES.decode(name, payload)


@pytest.mark.parametrize("name", GENERATORS)
def test_a_type_whose_fields_belong_together_is_one_of_ros(name: str) -> None:
    assert name in STRUCTURES


def test_stamps_are_of_the_moment() -> None:
    stamp = made("geometry_msgs/msg/PoseStamped", 5.0)["header"]["stamp"]
    assert stamp == {"sec": 1_700_000_000, "nanosec": 0}


def test_joints_swing_and_are_those_that_the_panel_names() -> None:
    first, later = made(JOINTS, 0.0), made(JOINTS, 2.0)
    assert len(first["name"]) == len(first["position"]) == len(first["velocity"]) == 6
    assert all(a != b for a, b in zip(first["position"], later["position"], strict=True))
    assert made(JOINTS, 0.0, "lift", "tilt")["name"] == ["lift", "tilt"]


def test_a_battery_empties_and_is_charged() -> None:
    levels = [made("sensor_msgs/msg/BatteryState", t)["percentage"] for t in range(0, 241, 10)]
    lowest = levels.index(min(levels))
    assert levels[: lowest + 1] == sorted(levels[: lowest + 1], reverse=True)
    assert levels[lowest:] == sorted(levels[lowest:])
    assert (min(levels) >= 0.19, max(levels), levels[0]) == (True, 1.0, 1.0)
    assert made("sensor_msgs/msg/BatteryState", 230)["power_supply_status"] == 1
    assert battery_level(0, 60) == battery_level(60, 60) == 1


def test_a_picture_is_a_png_that_moves() -> None:
    data: bytes = made("sensor_msgs/msg/CompressedImage", 1.0)["data"]
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    assert struct.unpack(">II", data[16:24]) == SIZE
    length = struct.unpack(">I", data[33:37])[0]
    assert len(zlib.decompress(data[41 : 41 + length])) == (SIZE[0] + 1) * SIZE[1]
    assert data != made("sensor_msgs/msg/CompressedImage", 2.0)["data"]


def test_a_quaternion_is_of_length_1() -> None:
    for t in TIMES:
        quaternion = made("geometry_msgs/msg/Quaternion", t)
        assert sum(value**2 for value in quaternion.values()) == pytest.approx(1)


@pytest.mark.parametrize(
    ("type_name", "path", "value"),
    [
        ("std_msgs/msg/Float64MultiArray", "data[3]", 1.5),
        ("geometry_msgs/msg/PoseStamped", "pose.position.x", 1.5),
        (JOINTS, "position[name=joint_2]", 1.5),
        (JOINTS, "position[name=gripper]", 1.5),
        ("diagnostic_msgs/msg/DiagnosticArray", "status[name='drive: motor'].level", 2),
        ("tf2_msgs/msg/TFMessage", "transforms[header.frame_id=map].child_frame_id", "odom"),
        ("visualization_msgs/msg/MarkerArray", "markers[id=5].text", "door"),
        ("visualization_msgs/msg/MarkerArray", "markers[type=CUBE].ns", "door"),
        ("geometry_msgs/msg/PoseWithCovariance", "covariance[35]", 0.5),
        ("nav_msgs/msg/Path", "poses[4].pose.position.y", -2.0),
    ],
)
def test_a_value_is_put_where_its_path_says(type_name: str, path: str, value: Any) -> None:
    fields = made(type_name)
    put(fields, type_name, path, value, STRUCTURES)
    assert get(fields, INTERFACES.typed_steps(type_name, path)) == value
    payload = INTERFACES.encode(type_name, fields)
    assert INTERFACES.field_reader(type_name, [path]).read(payload).get(path) == value


def test_changing_a_field_changes_no_other_message() -> None:
    message = plausible(JOINTS, INTERFACES)
    fields = message(Moment(0.0, NOON_NS))
    put(fields, JOINTS, "position[0]", 99.0, STRUCTURES)
    assert message(Moment(0.0, NOON_NS))["position"][0] != 99.0


def test_signals_stay_within_their_limits() -> None:
    times = [t / 7 for t in range(2000)]
    for signal in (swing(-3, 8), as_type(swing(-3.4, 8.4), "int8"), count(0, 8)):
        assert all(-3.4 <= signal(t) <= 8.4 for t in times)
    clipped = [as_type(swing(-500, 500), "uint8")(t) for t in times]
    assert (min(clipped), max(clipped)) == (0, 255)


def test_first_constant_is_the_usual_value() -> None:
    shown = [cycle(("ok", "warm", "hot"))(t) for t in range(64)]
    assert set(shown) == {"ok", "warm", "hot"}
    assert shown.count("ok") == 48
    assert [cycle((1, 2, 3), 6)(t) for t in range(0, 12, 2)] == [1, 2, 3, 1, 2, 3]


@pytest.mark.parametrize(
    ("unit", "names", "within"),
    [
        ("°C", ("data",), (20, 60)),
        ("%", ("percentage", "Battery"), (0, 100)),
        ("", ("data", "Motor temperature"), (20, 60)),
        ("", ("data", "Parts", "/parts"), (0, 500)),
        ("", ("qqq",), (ANYTHING.low, ANYTHING.high)),
    ],
)
def test_a_number_is_guessed_by_its_unit_and_its_names(
    unit: str, names: tuple[str, ...], within: tuple[float, float]
) -> None:
    span = span_of(unit, *names)
    assert within[0] <= span.low < span.high <= within[1]
