"""The lamp on a button: what the robot reports, which never locks the button."""

from typing import Any, Final

import pytest

from app.cell.view.view import build_view
from tests.support.builders import FREE, GUARDED, NOW, TEXT, panel_of, permits, robot_there, says
from tests.support.words import english

LAMP: Final = {
    "topic": "/servo_state",
    "type": TEXT,
    "max_age_s": 5.0,
    "states": [
        {"value": "on", "text": "On", "shape": "circle", "colour": "white"},
        {"value": "off", "text": "Off", "shape": "square"},
    ],
}
PUBLISH: Final = {
    **FREE,
    "id": "servo",
    "label": "Servo",
    "message": {"data": "on"},
    "lamp": LAMP,
}
CALL: Final = {
    "id": "servo",
    "kind": "call",
    "label": "Servo",
    "service": "/servo",
    "type": "std_srvs/srv/Trigger",
    "lamp": LAMP,
}
BUTTONS: Final = pytest.mark.parametrize("button", [PUBLISH, CALL], ids=["publish", "call"])


def shown(button: Any, value: str | None, now: float = NOW) -> Any:
    panel = panel_of(button)
    robot = robot_there(panel)
    if value is not None:
        says(robot, "/servo_state", value, TEXT)
    return english(build_view(panel, robot, now).view["widgets"]["servo"])


@BUTTONS
@pytest.mark.parametrize(
    ("value", "now", "state", "text", "shape", "colour"),
    [
        ("on", NOW, "live", "On", "circle", "white"),
        ("off", NOW, "live", "Off", "square", "grey"),
        ("bent", NOW, "live", "Unknown: bent", "unknown", "none"),
        (None, NOW, "waiting", "No value yet", "waiting", "none"),
        ("on", NOW + 6.0, "old", "Unknown", "old", "none"),
    ],
)
def test_it_shows_what_the_robot_reports(
    button: Any, value: str | None, now: float, state: str, text: str, shape: str, colour: str
) -> None:
    view = shown(button, value, now)
    assert (view["state"], view["text"]) == (state, text)
    assert (view["shape"], view["colour"]) == (shape, colour)


def test_a_state_that_is_not_known_does_not_lock_the_button() -> None:
    for value, now in ((None, NOW), ("bent", NOW), ("on", NOW + 6.0)):
        assert shown(PUBLISH, value, now)["enabled"] is True


def test_time_alone_makes_it_old() -> None:
    panel = panel_of(PUBLISH)
    robot = robot_there(panel)
    says(robot, "/servo_state", "on", TEXT)
    assert build_view(panel, robot, NOW).until <= NOW + 5.0


def test_it_is_shown_on_a_locked_button_of_its_own_beside_others_with_the_same_lock() -> None:
    locked = {**PUBLISH, "interlock": "operation"}
    panel = panel_of(locked, {**GUARDED, "id": "other", "message": {"data": "x"}})
    robot = robot_there(panel)
    permits(robot, False)
    says(robot, "/servo_state", "on", TEXT)
    widgets = english(build_view(panel, robot, NOW).view["widgets"])
    assert widgets["servo"]["enabled"] is False
    assert widgets["servo"]["text"] == "On"
    assert "text" not in widgets["other"]
