"""Functions of fields: their values, what has none, and which fields they are for."""

import math
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.ros.messages import load_interfaces
from app.ros.messages.field_path import SLICE_NUMBERS
from app.system.errors import InterfaceError

JAZZY: Final = load_interfaces("jazzy")
ODOMETRY: Final = "nav_msgs/msg/Odometry"
SCAN: Final = "sensor_msgs/msg/LaserScan"
ARRAY: Final = "std_msgs/msg/Float64MultiArray"
QUATERNION: Final = "geometry_msgs/msg/QuaternionStamped"
RECEIVED: Final = 1_800_000_000.0


def result(type_name: str, field: str, message: Any, received: float = RECEIVED) -> Any:
    """The value; without one, why there is none."""
    fields = JAZZY.field_reader(type_name, [field]).read(JAZZY.encode(type_name, message), received)
    value = fields.get(field)
    return fields.absence(field) if value is None else value


def stamp(seconds: int, nanosec: int = 0) -> Any:
    return {"header": {"stamp": {"sec": seconds, "nanosec": nanosec}}}


@pytest.mark.parametrize("angle", [0.0, 1.0, -2.5, 3.1])
def test_the_heading_of_a_quaternion_is_in_radians(angle: float) -> None:
    message = {"quaternion": {"z": math.sin(angle / 2), "w": math.cos(angle / 2)}}
    assert result(QUATERNION, "yaw(quaternion)", message) == pytest.approx(angle)


def test_numbers_of_lists_vectors_and_pairs() -> None:
    assert result(SCAN, "min(ranges)", {"ranges": [2.5, 0.5, math.inf]}) == 0.5
    assert result(SCAN, "max(ranges)", {"ranges": [2.5, 0.5]}) == 2.5
    assert result("std_msgs/msg/Int8MultiArray", "min(data)", {"data": [3, -4]}) == -4
    assert result("geometry_msgs/msg/PoseArray", "length(poses)", {"poses": [{}] * 1500}) == 1500
    assert result(ODOMETRY, "length(pose.covariance)", {}) == 36
    moving = {"twist": {"twist": {"linear": {"x": 3.0, "y": -4.0}}}}
    assert result(ODOMETRY, "norm(twist.twist.linear)", moving) == 5.0
    assert result(ARRAY, "diff(data[0], data[1])", {"data": [1.5, 2.0]}) == -0.5
    joints = {"name": ["a", "b"], "position": [0.5, 2.0]}
    assert (
        result("sensor_msgs/msg/JointState", "diff(position[name=b], position[name=a])", joints) == 1.5
    )


def test_the_age_of_a_stamp_is_that_at_its_arrival() -> None:
    assert result(ODOMETRY, "age(header.stamp)", stamp(int(RECEIVED) - 3)) == 3.0
    assert result(ODOMETRY, "age(header.stamp)", stamp(int(RECEIVED), 50_000_000)) == 0.0  # nearly now


def test_without_a_value_there_is_a_reason() -> None:
    assert result(SCAN, "min(ranges)", {"ranges": []}) == "empty"
    assert result(QUATERNION, "yaw(quaternion)", {"quaternion": {"w": 0.0}}) == "no_rotation"
    assert result(ODOMETRY, "age(header.stamp)", {}) == "no_time"
    assert result(ODOMETRY, "age(header.stamp)", stamp(int(RECEIVED) + 2)) == "other_clock"
    assert result(ODOMETRY, "age(header.stamp)", stamp(12)) == "other_time"  # of a simulation
    assert result(ODOMETRY, "age(header.stamp)", stamp(int(RECEIVED)), math.nan) == "other_time"
    assert result(ARRAY, "diff(data[0], data[1])", {"data": [1.5]}) is None


def test_a_number_that_is_none_makes_the_result_none() -> None:
    nan = math.nan
    assert math.isnan(result(SCAN, "min(ranges)", {"ranges": [1.0, nan, 2.0]}))
    assert math.isnan(result(QUATERNION, "yaw(quaternion)", {"quaternion": {"x": nan}}))
    assert math.isnan(result(ARRAY, "diff(data[0], data[1])", {"data": [math.inf, math.inf]}))
    infinite = {"twist": {"twist": {"linear": {"x": nan, "y": math.inf}}}}
    assert math.isnan(result(ODOMETRY, "norm(twist.twist.linear)", infinite))
    assert result(SCAN, "min(ranges)", {"ranges": [math.inf, -math.inf]}) == -math.inf


@given(st.lists(st.floats(), max_size=20))
def test_every_list_has_a_result_or_a_reason(numbers: list[float]) -> None:
    for name in ("min", "max", "length"):
        value = result(ARRAY, f"{name}(data)", {"data": numbers})
        assert value == "empty" or isinstance(value, int | float)


@given(st.tuples(*[st.floats()] * 4))
def test_every_quaternion_has_a_result_or_a_reason(parts: tuple[float, ...]) -> None:
    message = {"quaternion": dict(zip("xyzw", parts, strict=True))}
    value = result(QUATERNION, "yaw(quaternion)", message)
    assert value == "no_rotation" or math.isnan(value) or -math.pi <= value <= math.pi


def test_a_long_list_is_compared_in_slices() -> None:
    numbers = [1.0] * (3 * SLICE_NUMBERS) + [0.25]
    walk = JAZZY.field_reader(ARRAY, ["min(data)"]).walk(JAZZY.encode(ARRAY, {"data": numbers}))
    slices = 1
    while (fields := walk.advance()) is None:
        slices += 1
    assert fields.get("min(data)") == 0.25
    assert slices > 3


@pytest.mark.parametrize(
    ("field", "message"),
    [
        ("yam(pose)", 'did you mean "yaw"?'),
        ("heading(pose)", "there is yaw, norm, min, max, length, age, diff"),
        ("yaw(pose.pose.position)", "nav_msgs/msg/Odometry has pose.pose.orientation"),
        ("min(pose)", "a list of numbers; nav_msgs/msg/Odometry has pose.covariance"),
        ("age(header)", "nav_msgs/msg/Odometry has header.stamp"),
        ("diff(pose.covariance[0])", "like diff(a, b)"),
        ("norm(yaw(pose.pose.orientation))", "not of another function"),
        ("yaw()", "is not a field"),
        ("norm(twist.linear)", 'there is no "linear"'),
    ],
)
def test_a_wrong_call_says_what_would_be_right(field: str, message: str) -> None:
    with pytest.raises(InterfaceError) as error:
        JAZZY.type_at(ODOMETRY, field)
    assert message in str(error.value)


def test_the_type_of_a_result() -> None:
    assert JAZZY.field_type(SCAN, "min(ranges)") == "float32"
    assert JAZZY.field_type(ODOMETRY, "yaw(pose.pose.orientation)") == "float64"
    assert JAZZY.field_type(SCAN, "length(ranges)") == "uint32"
    assert JAZZY.field_type("std_msgs/msg/Int8MultiArray", "diff(data[0], data[1])") == "int64"
