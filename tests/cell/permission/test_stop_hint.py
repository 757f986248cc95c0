"""A locked stop button says what to use in its place; other buttons do not."""

import asyncio
from typing import Any, Final

import pytest

from app.cell.robot.state import RobotState
from app.cell.view.view import build_view, lock_all
from app.system.texts import render, say
from tests.support.builders import (
    FREE,
    MESSAGE,
    NOW,
    FakeTransport,
    panel_of,
    permits,
    press_widget,
    presses_of,
    robot_there,
)
from tests.support.words import english

pytestmark = pytest.mark.promise("stop")

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


def test_locked_stop_button_names_the_emergency_stop(robot: RobotState) -> None:
    permits(robot, False)
    plain = reason("start", robot, stop_hint=HINT)
    assert HINT not in plain
    assert reason("stop", robot, stop_hint=HINT) == f"{HINT} {plain}"


def test_stop_hint_defaults_to_the_emergency_stop(robot: RobotState) -> None:
    robot.link_up = False
    assert reason("stop", robot).startswith("Use E-stop. ")


def test_a_free_stop_button_says_nothing(robot: RobotState) -> None:
    permits(robot)
    assert build_view(panel_of(STOP, START), robot, NOW).view["widgets"]["stop"]["reason"] is None


def test_receipt_of_a_refused_stop_has_the_hint(robot: RobotState) -> None:
    permits(robot, False)
    presses = presses_of(panel_of(MESSAGE, STOP, START, stop_hint=HINT), robot, FakeTransport())
    inputs = {"message": "now"}
    stop = asyncio.run(press_widget(presses, "stop", inputs))
    start = asyncio.run(press_widget(presses, "start", inputs, "p2"))
    assert (stop.outcome, start.outcome) == ("refused", "refused")
    assert HINT in str(english(stop.reason))
    assert HINT not in str(english(start.reason))


def test_failed_view_shows_the_hint_at_the_stop_button_only(robot: RobotState) -> None:
    panel = panel_of(STOP, START, stop_hint=HINT)
    view = lock_all(panel, build_view(panel, robot, NOW), say("view_failed")).view
    reasons = {name: str(english(view["widgets"][name]["reason"])) for name in ("stop", "start")}
    assert reasons["stop"] == f"{HINT} {reasons['start']}"


@pytest.mark.parametrize(
    ("hint", "language", "shown"),
    [
        ("Use E-stop", "en", "Use E-stop. Guard door open"),
        ("Where is the gate?", "en", "Where is the gate? Guard door open"),
        ("Not-Halt benutzen!", "de", "Not-Halt benutzen! Guard door open"),
        ({"en": "Use E-stop", "ja": "非常停止を使用"}, "ja", "非常停止を使用。Guard door open"),
    ],
)
def test_a_hint_without_a_full_stop_does_not_run_into_the_reason(
    robot: RobotState, hint: Any, language: str, shown: str
) -> None:
    permits(robot, False)
    panel = panel_of(STOP, START, stop_hint=hint, interlock={"locked": "Guard door open"})
    widgets = build_view(panel, robot, NOW).view["widgets"]
    assert render(widgets["stop"]["reason"], language) == shown
    assert render(widgets["start"]["reason"], language) == "Guard door open"
