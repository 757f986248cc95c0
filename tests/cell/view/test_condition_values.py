"""Check lists of conditions and plans of pallets: what is met, what is known, what is next."""

import math
from typing import Any, Final

import pytest

from app.cell.view.view import build_view
from tests.support.builders import BOOL, ENABLED, NOW, endpoint, panel_of, robot_there, says
from tests.support.words import english

FLOAT: Final = "std_msgs/msg/Float64"
COUNT: Final = "std_msgs/msg/UInt32"
AIR: Final = {
    "id": "air",
    "label": "Air",
    "topic": "/air",
    "type": FLOAT,
    "min": 5.0,
    "unit": "bar",
    "max_age_s": 5.0,
}
LIST: Final = {
    "id": "checks",
    "kind": "conditions",
    "label": "Conditions",
    "conditions": ["operation", "air"],
}
PLAN: Final = {
    "id": "plan",
    "kind": "pallet",
    "label": "Pallet",
    "topic": "/boxes",
    "type": COUNT,
    "across": 6,
    "along": 4,
    "layers": 2,
}


def checked(*, permitted: bool | None, bar: float | None, now: float = NOW, link: bool = True) -> Any:
    panel = panel_of(LIST, condition=[AIR])
    robot = robot_there(panel)
    endpoint(robot, "MP", "/air", FLOAT)
    if permitted is not None:
        says(robot, ENABLED, permitted, BOOL)
    if bar is not None:
        says(robot, "/air", bar, FLOAT)
    robot.link_up = link
    return english(build_view(panel, robot, now).view["widgets"]["checks"])


def test_all_that_are_met_are_one_line() -> None:
    view = checked(permitted=True, bar=5.5)
    assert (view["shape"], view["text"]) == ("met", "All conditions met")
    assert view["row_values"] == ["met", "5.5 bar"]
    assert view["row_needs"] == ["", "needs 5 bar or more"]


@pytest.mark.parametrize(
    ("permitted", "bar", "shape", "states", "order"),
    [
        (False, 5.5, "unmet", ["unmet", "met"], [0, 1]),
        (True, 4.5, "unmet", ["met", "unmet"], [1, 0]),
        (None, 4.5, "unmet", ["unknown", "unmet"], [1, 0]),
        (True, None, "unknown", ["met", "unknown"], [1, 0]),
        (True, math.nan, "unmet", ["met", "unmet"], [1, 0]),
    ],
)
def test_what_is_not_met_comes_first(
    permitted: bool | None, bar: float | None, shape: str, states: list[str], order: list[int]
) -> None:
    view = checked(permitted=permitted, bar=bar)
    assert (view["shape"], view["row_states"], view["order"]) == (shape, states, order)


def test_a_value_that_is_too_old_is_not_known() -> None:
    view = checked(permitted=True, bar=5.5, now=NOW + 6)
    assert view["row_states"] == ["met", "unknown"]
    assert view["row_values"][1] == "not known"


def test_a_condition_that_is_not_met_says_what_to_do() -> None:
    panel = panel_of(LIST, condition=[AIR | {"action": "Open valve V1"}])
    robot = robot_there(panel)
    endpoint(robot, "MP", "/air", FLOAT)
    says(robot, "/air", 4.5, FLOAT)
    view = english(build_view(panel, robot, NOW).view["widgets"]["checks"])
    assert view["row_needs"][1] == "Open valve V1"
    says(robot, "/air", 5.5, FLOAT)
    view = english(build_view(panel, robot, NOW).view["widgets"]["checks"])
    assert view["row_needs"][1] == "needs 5 bar or more"


def test_without_a_way_to_the_robot_nothing_is_known() -> None:
    view = checked(permitted=True, bar=5.5, link=False)
    assert (view["shape"], view["row_states"]) == ("unknown", ["unknown", "unknown"])


def test_the_list_changes_by_time_alone() -> None:
    panel = panel_of(LIST, condition=[AIR])
    robot = robot_there(panel)
    endpoint(robot, "MP", "/air", FLOAT)
    says(robot, ENABLED, True, BOOL)
    says(robot, "/air", 5.5, FLOAT)
    assert build_view(panel, robot, NOW).displays["checks"] == NOW + 5


@pytest.mark.parametrize(
    ("count", "text", "filled", "place"),
    [
        (0, "Layer 1 of 2, place 1 of 24", "", "0 0"),
        (15, "Layer 1 of 2, place 16 of 24", "M0 0H6V2H0zM0 2H3V3H0z", "3 2"),
        (24, "Layer 2 of 2, place 1 of 24", "", "0 0"),
        (48, "Full", "M0 0H6V4H0z", ""),
        (60, "Full", "M0 0H6V4H0z", ""),
    ],
)
def test_a_count_fills_the_plan_of_a_pallet(count: int, text: str, filled: str, place: str) -> None:
    panel = panel_of(PLAN)
    robot = robot_there(panel)
    says(robot, "/boxes", count, COUNT)
    view = english(build_view(panel, robot, NOW).view["widgets"]["plan"])
    assert (view["state"], view["text"]) == ("live", text)
    assert (view["filled"], view["next"]) == (filled, place)


def test_a_plan_without_a_count_marks_no_place() -> None:
    panel = panel_of(PLAN)
    view = english(build_view(panel, robot_there(panel), NOW).view["widgets"]["plan"])
    assert (view["state"], view["filled"], view["next"]) == ("waiting", "", "")
