"""Why a control is locked, and what to do: of the interlocks' present values."""

from typing import Any, Final

import pytest

from app.cell.permission.press_permission import NO_CONDITIONS, ServerConditions
from app.cell.permission.verdict import locked
from app.cell.view.lock_help import LockHelp, lock_help
from tests.support.builders import BOOL, ENABLED, FREE, NOW, endpoint, panel_of, robot_there, says
from tests.support.words import english

FLOAT: Final = "std_msgs/msg/Float64"
AIR: Final = {"id": "air", "label": "Air", "topic": "/air", "type": FLOAT, "min": 5.0, "unit": "bar"}
START: Final = {**FREE, "id": "start", "label": "Start", "interlock": ["operation", "air"]}
HELP: Final = {"text": "Look into the cell.\nClose the door."}


def help_of(
    *,
    permitted: bool | None = True,
    bar: float | None = 5.6,
    link: bool = True,
    guard: dict[str, Any] | None = None,
    grounds: ServerConditions = NO_CONDITIONS,
    **about: Any,
) -> LockHelp | None:
    panel = panel_of(
        {**START, **about}, interlock={"label": "Guard door", **(guard or {})}, further=[AIR]
    )
    robot = robot_there(panel)
    endpoint(robot, "MP", "/air", FLOAT)
    if permitted is not None:
        says(robot, ENABLED, permitted, BOOL)
    if bar is not None:
        says(robot, "/air", bar, FLOAT)
    robot.link_up = link
    return lock_help(panel, panel.commands[0], robot, NOW, grounds)


def shown(**about: Any) -> Any:
    """The help in English; a row is (label, met, value, need, sentence)."""
    made = help_of(**about)
    assert made is not None
    rows = [(*row[:4], sentence) for row, sentence in made.rows]
    return english({**made._asdict(), "rows": rows})


def test_a_control_that_is_not_locked_has_no_help() -> None:
    assert help_of() is None


def test_what_is_not_met_comes_first_with_its_value_and_its_need() -> None:
    view = shown(bar=4.5)
    assert (view["title"], view["summary"]) == ("Start is locked", "1 of 2 not met")
    assert view["rows"] == [
        ["Air", "unmet", "4.5 bar", "needs 5 bar or more", ""],
        ["Guard door", "met", "met", "", ""],
    ]
    assert view["reasons"] == []  # its row says it


@pytest.mark.parametrize(
    ("guard", "sentence", "advice"),
    [
        ({}, "", []),
        ({"locked": "Door is open."}, "Door is open.", []),
        ({"locked": "Door is {value}.", "action": "Close it."}, "Door is false.", ["Close it."]),
        ({"action": "Close it.", "help": HELP}, "", [HELP["text"]]),
    ],
)
def test_what_to_do_is_the_help_else_the_action_and_the_row_has_the_own_sentence(
    guard: dict[str, Any], sentence: str, advice: list[str]
) -> None:
    view = shown(permitted=False, guard=guard)
    assert (view["rows"][0][-1], view["advice"]) == (sentence, advice)
    assert view["reasons"] == []


def test_of_an_interlock_that_is_not_known_the_reason_is_shown_and_no_advice() -> None:
    view = shown(permitted=None, guard={"help": HELP})
    assert view["rows"][0] == ["Guard door", "unknown", "not known", "", ""]
    assert view["reasons"] == ["Locked: Guard door is not known yet."]
    assert view["advice"] == []


def test_without_a_link_that_is_the_reason() -> None:
    view = shown(link=False)
    assert view["reasons"][0].startswith("No connection to the robot")
    assert {row[1] for row in view["rows"]} == {"unknown"}


def test_the_servers_own_locks_are_reasons_too() -> None:
    view = shown(grounds=ServerConditions(inhibited={"start": locked("press_in_progress")}), bar=4.5)
    assert len(view["reasons"]) == 1
    assert view["rows"][0][:2] == ["Air", "unmet"]


def test_a_stop_says_what_to_use_instead_first() -> None:
    view = shown(role="stop", permitted=False, guard={"help": HELP})
    assert view["advice"] == ["Use E-stop.", HELP["text"]]
