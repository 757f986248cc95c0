"""What the header says of the machine: its state, as the robot reports it, and for how long."""

from collections.abc import Mapping
from typing import Any, Final

import pytest

from app.cell.robot.alarmed import AlarmedValues, ValueAlarm
from app.cell.robot.state import RobotState
from app.cell.view.view import build_view
from app.panel.model import Panel
from app.panel.rules import STATE_ID
from tests.support.builders import FREE, NOW, panel_of, robot_there, says
from tests.support.words import english

STATE_TOPIC: Final = "/cell/state"
STATE: Final = {
    "topic": STATE_TOPIC,
    "type": "std_msgs/msg/String",
    "max_age_s": 100.0,
    "states": [
        {"value": "RUNNING", "text": "RUNNING", "shape": "play"},
        {"value": "FAULT", "text": "FAULT", "shape": "cross", "colour": "red"},
    ],
    "detail": [{"label": "Order", "topic": "/cell/order", "type": "std_msgs/msg/String"}],
}


@pytest.fixture
def panel() -> Panel:
    return panel_of(FREE, state=STATE)


@pytest.fixture
def robot(panel: Panel) -> RobotState:
    return robot_there(panel)


def shown(panel: Panel, robot: RobotState, now: float = NOW) -> Mapping[str, Any]:
    attributes: Mapping[str, Any] = english(build_view(panel, robot, now).view)["widgets"][STATE_ID]
    return attributes


def reports(robot: RobotState, state: str, *, at: float = NOW, seq: int = 1) -> None:
    """The robot reports a state, which is decoded."""
    says(robot, STATE_TOPIC, state, at=at, seq=seq)
    assert robot.reading(STATE_TOPIC).value("data") == state


def until(panel: Panel, robot: RobotState, now: float) -> float:
    return build_view(panel, robot, now).displays[STATE_ID]


def test_unreported_machine_state_has_no_colour_and_no_word(panel: Panel, robot: RobotState) -> None:
    attributes = shown(panel, robot)
    assert (attributes["state"], attributes["shape"], attributes["colour"]) == (
        "waiting", "waiting", "none",
    )  # fmt: skip
    assert attributes["detail0"] == "Order —"


def test_machine_state_and_its_details_are_the_robots(panel: Panel, robot: RobotState) -> None:
    reports(robot, "FAULT")
    says(robot, "/cell/order", "4711")
    attributes = shown(panel, robot)
    assert (attributes["text"], attributes["shape"], attributes["colour"]) == ("FAULT", "cross", "red")
    assert (attributes["detail0"], attributes["detail1"]) == ("Order 4711", "")


def test_duration_of_the_state_is_known_from_the_first_change(panel: Panel, robot: RobotState) -> None:
    reports(robot, "RUNNING")
    assert shown(panel, robot, NOW + 5)["since"] == ""
    reports(robot, "FAULT", at=NOW + 10, seq=2)
    assert shown(panel, robot, NOW + 10)["since"] == "for 0 s"
    reports(robot, "FAULT", at=NOW + 40, seq=3)
    assert shown(panel, robot, NOW + 51)["since"] == "for 41 s"
    assert until(panel, robot, NOW + 51) == pytest.approx(NOW + 52)
    assert shown(panel, robot, NOW + 100)["since"] == "for 1 min"
    assert until(panel, robot, NOW + 100) == pytest.approx(NOW + 130)


def test_duration_of_the_state_is_unknown_after_a_cut(panel: Panel, robot: RobotState) -> None:
    for seq, word in enumerate(("RUNNING", "FAULT"), 1):
        reports(robot, word, seq=seq)
    assert shown(panel, robot)["since"] == "for 0 s"
    robot.invalidate(robot.key(STATE_TOPIC))
    assert shown(panel, robot)["since"] == ""
    assert shown(panel, robot)["colour"] == "none"
    reports(robot, "FAULT", seq=3)
    assert (shown(panel, robot)["text"], shown(panel, robot)["since"]) == ("FAULT", "")


def test_a_state_that_is_too_old_has_no_colour(panel: Panel, robot: RobotState) -> None:
    reports(robot, "FAULT")
    attributes = shown(panel, robot, NOW + 100)
    assert (attributes["state"], attributes["colour"], attributes["since"]) == ("old", "none", "")


def test_long_state_is_shown_in_hours_and_minutes(panel: Panel, robot: RobotState) -> None:
    reports(robot, "FAULT")
    reports(robot, "RUNNING", seq=2)
    reports(robot, "RUNNING", at=NOW + 8060, seq=3)
    assert shown(panel, robot, NOW + 8060)["since"] == "for 2 h 14 min"


def test_an_active_alarm_with_a_state_is_shown_in_place_of_the_robots(
    panel: Panel, robot: RobotState
) -> None:
    reports(robot, "RUNNING")
    robot.alarmed = AlarmedValues(ValueAlarm("FAULT", NOW))
    attributes = shown(panel, robot, NOW + 5)
    assert (attributes["text"], attributes["colour"], attributes["since"]) == (
        "FAULT",
        "red",
        "for 5 s",
    )
    assert attributes["detail0"] == "Order —"
    assert until(panel, robot, NOW + 5) == pytest.approx(NOW + 6)
    robot.alarmed = AlarmedValues()
    assert shown(panel, robot, NOW + 6)["text"] == "RUNNING"
