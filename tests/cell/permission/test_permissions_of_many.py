"""Uniform buttons are judged once: the verdict is that of each of them judged by itself."""

from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as some

from app.cell.permission import press_permission
from app.cell.permission.interlocks import interlock_verdict, link_verdict
from app.cell.permission.press_permission import CHECKS, Check, ServerConditions, judged, permissions
from app.cell.permission.verdict import PERMITTED, Verdict
from app.cell.view.kinds import attributes_of
from app.cell.view.view import build_view
from tests.support.builders import (
    BOOL,
    ENABLED,
    FREE,
    GUARDED,
    MESSAGE,
    NOW,
    TEXT,
    endpoint,
    panel_of,
    permits,
    robot_there,
)

CONTROL: Final = Verdict(False, "control", "Take control first.")
SECOND: Final = {"id": "second", "topic": "/second_enabled"}


def buttons(count: int) -> list[dict[str, Any]]:
    locks: list[dict[str, Any]] = [
        {"interlock": "operation"},
        {"interlock": ["operation", "second"]},
        {},
    ]
    return [
        {**FREE, **locks[number % 3], "id": f"b{number}", "topic": f"/t{number % 5}"}
        for number in range(count)
    ]


@given(
    permitted=some.sampled_from([True, False, None]),
    wrong_type=some.sets(some.integers(0, 4)),
    ending=some.sampled_from(["", "server_shutting_down"]),
    log=some.sampled_from(["", "The disk is full."]),
    control=some.sampled_from([PERMITTED, CONTROL]),
    later=some.sampled_from([0.0, 5.0]),
)
def test_verdict_of_grouped_buttons_equals_the_verdict_of_each_alone(
    permitted: bool | None,
    wrong_type: set[int],
    ending: str,
    log: str,
    control: Verdict,
    later: float,
) -> None:
    panel = panel_of(MESSAGE, *buttons(12), GUARDED, interlock={"max_age_s": 2.0}, further=[SECOND])
    robot = robot_there(panel)
    endpoint(robot, "MP", ENABLED, BOOL)
    for number in wrong_type:
        endpoint(robot, "MS", f"/t{number}", BOOL if FREE["type"] == TEXT else TEXT)
    if permitted is not None:
        permits(robot, permitted)
    now = NOW + later
    link = link_verdict(robot, now)
    interlocks = {
        interlock.id: interlock_verdict(interlock, robot, now, link) for interlock in panel.interlocks
    }
    grounds = ServerConditions(control, log, ending)
    verdicts = permissions(panel, robot, now, link, interlocks, grounds)
    for widget in panel.commands:
        alone = judged(widget, panel.interlocks_of(widget), robot, now, grounds)
        assert verdicts[widget.id] == alone, widget.id
    shown = build_view(panel, robot, now).view["widgets"]
    for widget in panel.commands:
        plain = judged(widget, panel.interlocks_of(widget), robot, now)
        assert shown[widget.id] == attributes_of(widget, robot, now, plain)[0]


def test_a_check_that_differs_between_buttons_is_made_for_each(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    alarm = Verdict(False, "alarm", "An alarm locks this.")
    row = Check("alarm", lambda request: alarm if request.widget.id == "b3" else None)
    monkeypatch.setattr(press_permission, "CHECKS", (*CHECKS, row))
    panel = panel_of(MESSAGE, *buttons(6), further=[SECOND])
    robot = robot_there(panel)
    permits(robot)
    shown = build_view(panel, robot, NOW).view["widgets"]
    assert [name for name, attributes in shown.items() if attributes.get("reason") == alarm.reason] == [
        "b3"
    ]
