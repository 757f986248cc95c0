"""The attributes of a stop button that is for several robots."""

from typing import Any

import pytest

from app.cell.view.group_stops import StopOfRobot, group_stop
from app.system.texts import render

LOST = {"enabled": False, "reason": "No connection."}
OPEN = {"enabled": True, "reason": None}
DOOR = {"enabled": False, "reason": "Wait."}


@pytest.mark.parametrize(
    ("shown", "enabled", "reason"),
    [
        ([OPEN, OPEN], True, None),
        ([OPEN, LOST], True, None),  # it stops those that it reaches
        ([LOST, LOST], False, "No connection."),
        ([LOST, DOOR], False, "Cell 1: No connection.\nCell 2: Wait."),
    ],
)
def test_it_is_locked_only_where_each_robot_is(
    shown: list[dict[str, Any]], enabled: bool, reason: str | None
) -> None:
    made = group_stop([StopOfRobot(f"Cell {n}", each) for n, each in enumerate(shown, 1)])
    assert made["enabled"] is enabled
    assert (render(made["reason"]) if made["reason"] else None) == reason
    assert made.keys() == OPEN.keys()


def test_what_the_robots_show_alike_is_shown_and_nothing_else() -> None:
    first = {**OPEN, "result": "Stopped", "outcome": "confirmed", "stoppable": True, "press": "a"}
    second = {**first, "result": "No answer", "press": "b"}
    made = group_stop([StopOfRobot("Cell 1", first), StopOfRobot("Cell 2", second)])
    assert made == {**first, "result": "", "stoppable": False, "press": ""}
