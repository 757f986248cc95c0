"""What a gauge shows: its level and limit in words, and where its pointer is."""

import math
from typing import Any, Final

import pytest

from app.cell.robot.state import RobotState
from app.cell.view.view import build_view
from app.system.clock import format_time
from tests.support.builders import NOW, panel_of, robot_there, says
from tests.support.words import english

FLOAT: Final = "std_msgs/msg/Float64"
GAUGE: Final = {
    "id": "air",
    "kind": "gauge",
    "label": "Air",
    "topic": "/air",
    "type": FLOAT,
    "unit": "bar",
    "min": 0,
    "max": 10,
    "normal": [5, 6],
    "low_low": 3,
    "low": 4,
    "high": 7,
    "high_high": 8,
    "max_age_s": 5.0,
}
AT: Final = f"received {format_time(NOW)}"


def robot_with(value: float | None, **more: Any) -> tuple[Any, RobotState]:
    panel = panel_of({**GAUGE, **more})
    robot = robot_there(panel)
    if value is not None:
        says(robot, "/air", value, more.get("type", FLOAT))
    return panel, robot


def shown(value: float | None, *, now: float = NOW, **more: Any) -> Any:
    panel, robot = robot_with(value, **more)
    return english(build_view(panel, robot, now).view["widgets"]["air"])


@pytest.mark.parametrize(
    ("value", "level", "said", "pointer", "beyond"),
    [
        (5.5, "normal", "", 55.0, ""),
        (5.0, "normal", "", 50.0, ""),
        (6.0, "normal", "", 60.0, ""),
        (4.5, "abnormal", "below normal 5", 45.0, ""),
        (6.5, "abnormal", "above normal 6", 65.0, ""),
        (4.0, "abnormal", "below normal 5", 40.0, ""),
        (3.5, "low", "below low 4", 35.0, ""),
        (2.0, "low_low", "below low-low 3", 20.0, ""),
        (7.5, "high", "above high 7", 75.0, ""),
        (9.0, "high_high", "above high-high 8", 90.0, ""),
        (12.5, "high_high", "above high-high 8", 100.0, "above"),
        (-1.0, "low_low", "below low-low 3", 0.0, "below"),
        (math.inf, "high_high", "above high-high 8", 100.0, "above"),
    ],
)
def test_the_hardest_limit_that_a_value_is_beyond_is_named(
    value: float, level: str, said: str, pointer: float, beyond: str
) -> None:
    view = shown(value)
    assert (view["state"], view["level"], view["said"]) == ("live", level, said)
    assert (view["pointer"], view["beyond"]) == (pointer, beyond)


def test_beyond_the_scale_is_abnormal_also_without_limits() -> None:
    bare: Any = dict.fromkeys(("normal", "low_low", "low", "high", "high_high"))
    view = shown(12.5, **bare)
    assert (view["level"], view["said"], view["text"]) == ("abnormal", "above the scale", "12.5")


def test_a_float32_at_a_limit_is_not_beyond_it() -> None:
    limits: Any = {"type": "std_msgs/msg/Float32", "normal": None, "low": None, "low_low": None}
    view = shown(0.1, **limits, max=1, high=0.1, high_high=0.2)
    assert (view["level"], view["text"]) == ("normal", "0.1")


def test_limits_are_in_the_unit_that_is_shown() -> None:
    view = shown(720_000.0, scale=0.00001, format=".2f")
    assert (view["text"], view["level"], view["said"]) == ("7.20", "high", "above high 7.00")


@pytest.mark.parametrize(
    ("value", "now", "state", "text", "note"),
    [
        (None, NOW, "waiting", "—", "waiting for data"),
        (9.0, NOW + 6, "old", "9", "6 s old"),
        (math.nan, NOW, "unreadable", "—", "the value is not a number (NaN)"),
    ],
)
def test_unknown_gauge_has_no_level(
    value: float | None, now: float, state: str, text: str, note: str
) -> None:
    view = shown(value, now=now)
    assert (view["state"], view["text"], view["note"]) == (state, text, note)
    assert (view["level"], view["said"]) == ("", "")


def test_a_value_gets_old_by_time_alone() -> None:
    panel, robot = robot_with(5.5)
    assert build_view(panel, robot, NOW).displays["air"] == NOW + 5


def test_a_constant_set_point() -> None:
    view = shown(5.5, setpoint=6, format=".1f")
    assert (view["target"], view["setpoint"]) == ("set 6.0", 60.0)
    without = shown(5.5)
    assert (without["target"], without["setpoint"]) == ("", None)


def test_a_set_point_of_a_topic_is_scaled_and_gets_old() -> None:
    setpoint = {"topic": "/air_set", "type": FLOAT, "max_age_s": 2.0}
    panel, robot = robot_with(55.0, setpoint=setpoint, scale=0.1)

    def view(now: float = NOW) -> Any:
        return english(build_view(panel, robot, now).view["widgets"]["air"])

    assert (view()["target"], view()["setpoint"]) == ("set-point unknown", None)
    says(robot, "/air_set", 65.0, FLOAT)
    assert (view()["target"], view()["setpoint"]) == ("set 6.5", 65.0)
    assert build_view(panel, robot, NOW).displays["air"] == NOW + 2
    later = view(NOW + 3)
    assert (later["state"], later["target"], later["setpoint"]) == ("live", "set 6.5, old", None)
