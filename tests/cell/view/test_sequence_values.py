"""Sequences of steps: what is done, now and next, and how to go on under a fault or an alarm."""

from typing import Any, Final

import pytest

from app.cell.robot.alarmed import AlarmAction
from app.cell.robot.state import RobotState
from app.cell.view.view import build_view
from app.panel.model import Panel
from app.system.texts import PanelText
from tests.support.builders import BOOL, ENABLED, NOW, endpoint, panel_of, robot_there, says
from tests.support.words import english

COUNT: Final = "std_msgs/msg/UInt8"
TEXT: Final = "std_msgs/msg/String"
DOOR: Final = {
    "id": "door",
    "label": "Door",
    "action": "Close the door",
    "topic": "/door",
    "max_age_s": 5.0,
}
RESET: Final = {"id": "no_fault", "action": "Touch Reset", "topic": "/no_fault"}
ALARM: Final = {"id": "low", "text": "Air is low", "action": "Open the valve\nWait", "lost": "link"}
STEPS: Final = [{"text": text} for text in ("Open", "Lay in", "Close", "Start", "Look")]
SEQUENCE: Final = {
    "id": "go_on",
    "kind": "sequence",
    "label": "Loading",
    "current": {"topic": "/step", "type": COUNT, "max_age_s": 2.0},
    "steps": STEPS,
    "recovery": [
        {"text": "Look into the cell"},
        {"condition": "door", "mark": [80, 40], "picture": "door.svg"},
        {"condition": "no_fault", "note": "motors come on"},
    ],
    "picture": "cell.svg",
    "alarms": ["low"],
}


def built(**keys: Any) -> tuple[Panel, RobotState]:
    panel = panel_of(SEQUENCE | keys, condition=[DOOR, RESET], alarm=[ALARM])
    robot = robot_there(panel)
    for topic in ("/door", "/no_fault"):
        endpoint(robot, "MP", topic, BOOL)
    return panel, robot


def shown(panel: Panel, robot: RobotState, now: float = NOW) -> Any:
    return english(build_view(panel, robot, now).view["widgets"]["go_on"])


def at_rest(robot: RobotState) -> None:
    """The door is closed and nothing is wrong."""
    for topic in ("/door", "/no_fault"):
        says(robot, topic, True, BOOL)


def states(view: Any) -> list[str]:
    return [row["state"] for row in view["rows"]]


@pytest.mark.parametrize(
    ("step", "numbers", "expected", "text"),
    [
        (0, "1234", ["now", "next", "next", "next"], "step 1 of 5"),
        (1, "1234", ["done", "now", "next", "next"], "step 2 of 5"),
        (3, "2345", ["done", "done", "now", "next"], "step 4 of 5"),
        (4, "2345", ["done", "done", "done", "now"], "step 5 of 5"),
    ],
)
def test_the_field_says_which_step_is_under_way(
    step: int, numbers: str, expected: list[str], text: str
) -> None:
    panel, robot = built()
    at_rest(robot)
    says(robot, "/step", step, COUNT)
    view = shown(panel, robot)
    assert (view["state"], view["mode"], view["title"]) == ("live", "usual", "Loading")
    assert "".join(row["number"] for row in view["rows"]) == numbers
    assert (states(view), view["text"]) == (expected, text)


def test_a_value_that_no_step_has_marks_none_and_is_said() -> None:
    panel, robot = built()
    at_rest(robot)
    says(robot, "/step", 9, COUNT)
    view = shown(panel, robot)
    assert (view["state"], set(states(view)), view["text"]) == ("missing", {"next"}, "")
    assert view["note"] == "The robot reports 9, which is not a step of this list."


def test_a_step_has_the_value_that_the_file_gives_it() -> None:
    steps = [{"text": "Pick", "value": "PICK"}, {"text": "Place", "value": "PLACE"}]
    panel, robot = built(current={"topic": "/phase", "type": TEXT}, steps=steps)
    at_rest(robot)
    says(robot, "/phase", "PLACE", TEXT)
    assert states(shown(panel, robot)) == ["done", "now"]


def test_an_old_step_is_shown_as_old() -> None:
    panel, robot = built()
    at_rest(robot)
    says(robot, "/step", 1, COUNT)
    view = shown(panel, robot, NOW + 3)
    assert (view["state"], states(view)[1]) == ("old", "now")
    assert build_view(panel, robot, NOW).displays["go_on"] == NOW + 2


def test_under_a_fault_steps_tick_themselves_by_their_conditions() -> None:
    panel, robot = built()
    says(robot, "/door", False, BOOL)
    says(robot, "/no_fault", False, BOOL)
    view = shown(panel, robot)
    assert (view["mode"], view["title"], view["text"]) == ("recovery", "How to go on", "step 1 of 3")
    assert [row["text"] for row in view["rows"]] == [
        "Look into the cell",
        "Close the door",
        "Touch Reset",
    ]
    assert states(view) == ["now", "now", "next"]
    assert (view["picture"], view["mark"], view["at"]) == ("door.svg", [80.0, 40.0], "2")
    says(robot, "/door", True, BOOL)
    view = shown(panel, robot)
    assert (states(view), view["text"]) == (["past", "done", "now"], "step 3 of 3")
    assert (view["picture"], view["mark"], view["at"]) == ("cell.svg", [], "")
    says(robot, "/no_fault", True, BOOL)
    assert shown(panel, robot)["mode"] == "usual"


def test_a_fault_that_is_not_known_marks_no_step() -> None:
    panel, robot = built()
    says(robot, "/door", True, BOOL)
    says(robot, "/step", 1, COUNT)
    view = shown(panel, robot)
    assert (view["mode"], view["state"]) == ("usual", "waiting")
    assert view["note"] == "It is not known whether there is a fault."


def test_only_the_conditions_that_the_file_names_are_a_fault() -> None:
    panel, robot = built(fault=["door"])
    says(robot, "/door", True, BOOL)
    says(robot, "/no_fault", False, BOOL)
    assert shown(panel, robot)["mode"] == "usual"


def test_steps_without_a_field_tick_themselves() -> None:
    steps = [{"text": "Close", "condition": "door"}, {"text": "Look"}, {"condition": "no_fault"}]
    panel, robot = built(current=None, steps=steps, recovery=[])
    says(robot, "/door", True, BOOL)
    says(robot, "/no_fault", False, BOOL)
    assert states(shown(panel, robot)) == ["done", "now", "now"]
    says(robot, "/door", False, BOOL)
    assert states(shown(panel, robot)) == ["now", "next", "next"]


def test_fixed_steps_without_conditions_are_a_plain_list() -> None:
    panel, robot = built(current=None, recovery=[])
    assert set(states(shown(panel, robot))) == {"next"}


def test_the_lines_of_an_alarm_that_stands_are_steps() -> None:
    panel, robot = built()
    at_rest(robot)
    says(robot, ENABLED, True, BOOL)
    action = PanelText({"en": "Open the valve\nWait", "de": "Ventil öffnen\nWarten"}, "en")
    robot.alarm_actions = (AlarmAction("other", "no", ""), AlarmAction("low", action, "valve.svg"))
    view = shown(panel, robot)
    assert (view["mode"], view["picture"]) == ("recovery", "valve.svg")
    assert [row["text"] for row in view["rows"]] == ["Open the valve", "Wait"]
    says(robot, "/door", False, BOOL)
    assert [row["text"] for row in shown(panel, robot)["rows"]][2:] == [
        "Look into the cell",
        "Close the door",
    ]
