"""What bars of joints show: found by name, in their units, with the limit that one is beyond."""

import math
from typing import Any, Final

import pytest

from app.cell.robot.state import RobotState, Sample
from app.cell.view.view import build_view
from tests.support.builders import BRIDGE, INTERFACES, NOW, panel_of, robot_there
from tests.support.words import english

JOINTS: Final = {
    "id": "arm",
    "kind": "joints",
    "label": "Arm",
    "max_age_s": 1.0,
    "joint": [
        {"name": "a", "label": "J1", "min": -180, "low": -90, "high": 90, "max": 180, "near": 5},
        {"name": "it's", "unit": "mm", "min": 0, "max": 1000},
    ],
}
STATE: Final = "sensor_msgs/msg/JointState"


def robot_says(robot: RobotState, names: list[str], positions: list[float], seq: int = 1) -> None:
    payload = INTERFACES.encode(STATE, {"name": names, "position": positions})
    robot.update("joint_states", Sample(payload, seq, NOW, NOW, BRIDGE))


def shown(names: list[str], positions: list[float], *, now: float = NOW) -> Any:
    panel = panel_of(JOINTS)
    robot = robot_there(panel)
    robot_says(robot, names, positions)
    return english(build_view(panel, robot, now).view["widgets"]["arm"])


@pytest.mark.parametrize("order", [("a", "b", "it's"), ("it's", "a", "b")])
def test_a_joint_is_found_by_its_name_wherever_it_stands(order: tuple[str, ...]) -> None:
    values = {"a": math.pi / 4, "b": 9.0, "it's": 0.25}
    view = shown([*order], [values[name] for name in order])
    assert (view["state"], view["said"]) == ("live", "")
    assert view["joint_values"] == ["+45.0", "+250.0"]
    assert view["joint_bars"] == [62.5, 25.0]
    assert view["joint_levels"] == ["normal", "normal"]


@pytest.mark.parametrize(
    ("degrees", "level", "said"),
    [
        (84.9, "normal", ""),
        (85.1, "near", "J1 near its soft limit 90"),
        (-86.0, "near", "J1 near its soft limit −90"),
        (90.1, "high", "J1 above its soft limit 90"),
        (-91.0, "low", "J1 below its soft limit −90"),
        (181.0, "high_high", "J1 beyond its range, which ends at 180"),
        (-181.0, "low_low", "J1 beyond its range, which begins at −180"),
    ],
)
def test_a_limit_that_a_joint_is_beyond_is_named(degrees: float, level: str, said: str) -> None:
    view = shown(["a", "it's"], [math.radians(degrees), 0.5])
    assert (view["joint_levels"], view["said"]) == ([level, "normal"], said)


def test_the_hardest_is_named_and_the_others_are_counted() -> None:
    view = shown(["a", "it's"], [math.radians(91), 1.5])
    assert view["joint_levels"] == ["high", "high_high"]
    assert view["said"] == "it's beyond its range, which ends at 1000 and 1 more"


@pytest.mark.parametrize(
    ("names", "positions", "levels", "state"),
    [
        (["a"], [0.0], ["normal", "missing"], "live"),
        (["a", "it's"], [0.0], ["missing", "missing"], "missing"),
        (["a", "a", "it's"], [0.0, 1.0, 0.5], ["missing", "normal"], "live"),
        (["a", "it's"], [math.nan, 0.5], ["missing", "normal"], "live"),
    ],
)
def test_a_joint_that_is_not_known_is_missing(
    names: list[str], positions: list[float], levels: list[str], state: str
) -> None:
    view = shown(names, positions)
    assert (view["joint_levels"], view["state"]) == (levels, state)
    assert view["joint_bars"][levels.index("missing")] is None


def test_a_joint_that_is_not_a_number_is_named_so() -> None:
    view = shown(["a", "it's"], [math.nan, math.nan])
    assert view["said"] == "J1 is not a number (NaN) and 1 more"
    assert view["joint_values"] == ["NaN", "NaN"]


def test_old_joints_have_no_level() -> None:
    view = shown(["a", "it's"], [math.pi, 0.5], now=NOW + 2)
    assert (view["state"], view["note"], view["said"]) == ("old", "2 s old", "")
    assert (view["joint_values"], view["joint_levels"]) == (["+180.0", "+500.0"], ["", ""])


def test_joints_without_a_message_wait() -> None:
    panel = panel_of(JOINTS)
    view = english(build_view(panel, robot_there(panel), NOW).view["widgets"]["arm"])
    assert (view["state"], view["note"]) == ("waiting", "waiting for data")
    assert (view["joint_values"], view["joint_bars"]) == (["—", "—"], [None, None])
