"""A locked stop button says what to use in its place; other buttons do not."""

from typing import Any, Final

import pytest

from app.robot.state import RobotState
from app.view.view import build_view
from tests.support.builders import FREE, NOW, panel_of, permits, robot_there
from tests.support.words import english

STOP: Final = {**FREE, "id": "stop", "label": "Stop", "role": "stop", "interlock": "operation"}
START: Final = {**STOP, "id": "start", "label": "Start", "role": "start"}
HINT: Final = "Use the red button at the gate."


def reason(widget: str, robot: RobotState, **keys: Any) -> str:
    panel = panel_of(STOP, START, **keys)
    text: str = english(build_view(panel, robot, NOW).view)["widgets"][widget]["reason"]
    return text


@pytest.fixture
def robot() -> RobotState:
    return robot_there(panel_of(STOP, START))


def test_a_locked_stop_button_says_what_to_use_instead(robot: RobotState) -> None:
    permits(robot, False)
    plain = reason("start", robot, stop_hint=HINT)
    assert HINT not in plain
    assert reason("stop", robot, stop_hint=HINT) == f"{plain} {HINT}"


def test_without_the_key_it_is_the_emergency_stop(robot: RobotState) -> None:
    robot.link_up = False
    assert reason("stop", robot).endswith("Use the emergency stop of the cell.")


def test_a_free_stop_button_says_nothing(robot: RobotState) -> None:
    permits(robot)
    assert build_view(panel_of(STOP, START), robot, NOW).view["widgets"]["stop"]["reason"] is None
