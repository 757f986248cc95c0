"""Values in frames, as often as the panel says; permissions and the graph at once."""

import asyncio
import time
from collections.abc import Coroutine
from typing import Any, Final

import pytest
from hypothesis import given
from hypothesis import strategies as some

from app.cell.permission.control import ControlAuthority
from app.cell.permission.verdict import locked
from app.cell.robot.state import RobotState, Sample
from app.cell.view import kinds
from app.cell.view.publisher import ViewPublisher
from app.cell.view.refresh import NoOtherRobots, ViewRefresher, ViewSources
from app.cell.view.view import (
    ViewContext,
    ViewWithDeadlines,
    build_view,
    update_commands,
    update_displays,
)
from app.panel.model import Panel
from app.panel.widgets.families import Display
from app.records import NullLog
from app.records.entry import CommandStatus
from tests.support.builders import (
    BOOL,
    BRIDGE,
    COUNT,
    ENABLED,
    FREE,
    GUARDED,
    HEARD,
    NOW,
    TEXT,
    endpoint,
    panel_of,
    permits,
    robot_there,
    says,
)

AGED = {**HEARD, "id": "aged", "topic": "/aged", "max_age_s": 2.0}
LAMP = {
    "id": "lamp",
    "kind": "indicator",
    "label": "Lamp",
    "topic": "/lamp",
    "type": BOOL,
    "max_age_s": 3.0,
    "states": [{"value": True, "text": "On", "shape": "circle"}],
}
PANEL = panel_of(GUARDED, HEARD, AGED, LAMP, interlock={"max_age_s": 60.0})
TOPICS = {"/heard": TEXT, "/aged": TEXT, "/lamp": BOOL}
SLOW = panel_of(GUARDED, HEARD, display_hz=1)


def there(panel: Panel) -> RobotState:
    """A robot whose node is heard of and permits."""
    robot = robot_there(panel)
    endpoint(robot, "MP", ENABLED, BOOL)
    permits(robot)
    return robot


Said = tuple[str, Any, float]  # a topic, what it says (None: no message), and seconds since the last
SAID = some.tuples(
    some.sampled_from(sorted(TOPICS)), some.sampled_from(["x", "y", None]), some.floats(0.0, 1.5)
)


def say(robot: RobotState, topic: str, word: str | None, at: float) -> None:
    if word is None:
        robot.update(robot.key(topic), Sample(b"broken", 1, at, at, BRIDGE))
    else:
        says(robot, topic, word == "x" if TOPICS[topic] is BOOL else word, TOPICS[topic], at=at)


@given(some.lists(SAID, max_size=20))
def test_incremental_values_equal_a_full_rebuild(story: list[Said]) -> None:
    robot = there(PANEL)
    now = NOW
    built = build_view(PANEL, robot, now)
    displays = [w for w in PANEL.widgets() if isinstance(w, Display)]
    for topic, word, later in story:
        now += later
        say(robot, topic, word, now)
        if now >= built.rest:
            built = build_view(PANEL, robot, now)
        else:
            stale = [w for w in displays if w.topic == topic or built.displays[w.id] <= now]
            built = update_displays(built, stale, robot, now)
        whole = build_view(PANEL, robot, now)
        assert built.view == whole.view
        assert built.displays == whole.displays
        assert built.rest <= whole.rest  # or it is looked at earlier than need be


def showing_of(panel: Panel, robot: RobotState) -> ViewRefresher:
    control = ControlAuthority(panel.control, "", log_line=lambda *_: None)
    return ViewRefresher(panel, robot, "r1", ViewSources(control, NullLog(), NoOtherRobots()))


async def newer(publisher: ViewPublisher, version: int) -> None:
    async with asyncio.timeout(10):
        while publisher.version <= version:
            await publisher.wait_for_change(version, publisher.heartbeat.count)


def run(work: Coroutine[Any, Any, None]) -> None:
    asyncio.run(work)


def test_values_wait_for_the_frame_and_come_together() -> None:
    async def shown() -> None:
        robot = there(SLOW)
        showing = showing_of(SLOW, robot)
        showing.refresh_now()
        due, version = showing.due, showing.publisher.version
        for number in range(100):
            says(robot, "/heard", str(number))
            showing.refresh_values({robot.key("/heard")})
        assert showing.publisher.version == version
        await newer(showing.publisher, version)
        assert time.monotonic() >= due
        assert showing.publisher.version == version + 1
        assert showing.publisher.view["widgets"]["heard"]["text"] == "99"
        showing.stop()

    run(shown())


def test_a_permission_waits_for_no_frame_and_takes_the_values_along() -> None:
    async def shown() -> None:
        robot = there(SLOW)
        showing = showing_of(SLOW, robot)
        showing.refresh_now()
        says(robot, "/heard", "hello")
        showing.refresh_values({robot.key("/heard")})
        permits(robot, False)
        showing.refresh_now()
        widgets = showing.publisher.view["widgets"]
        assert (widgets["guarded"]["enabled"], widgets["heard"]["text"]) == (False, "hello")
        showing.stop()

    run(shown())


def test_a_sight_changes_when_the_first_of_its_parts_does() -> None:
    robot = there(PANEL)
    says(robot, "/aged", "x")
    says(robot, "/lamp", True, BOOL)
    built: ViewWithDeadlines = build_view(PANEL, robot, NOW)
    assert built.until == NOW + 2.0
    assert built.displays == {"heard": float("inf"), "aged": NOW + 2.0, "lamp": NOW + 3.0}


CALL: Final = {
    "id": "reset",
    "kind": "call",
    "label": "Reset",
    "service": "/reset",
    "type": "std_srvs/srv/Trigger",
    "interlock": "operation",
}
CONFIRMED: Final = {
    **FREE,
    "id": "sure",
    "confirm": {"topic": "/heard", "field": "data", "equals": "x", "within_s": 1.0},
}
STOP: Final = {**CALL, "id": "stop", "role": "stop", "service": "/stop"}
COMMANDS: Final = panel_of(GUARDED, HEARD, CALL, STOP, COUNT, CONFIRMED)
STATUSES: Final = {
    "waits": CommandStatus(busy=True, text="Waiting"),
    "runs": CommandStatus(
        busy=True, text="1", fraction=0.5, can_cancel=True, goal="EXECUTING", press="p"
    ),
    "succeeded": CommandStatus(outcome="succeeded", text="Done"),
    "unknown": CommandStatus(busy=True, outcome="unknown", text="No answer"),
}
LOCK: Final = locked("control_held", holder="Ann")
CONTEXTS: Final = {
    "alone": ViewContext(),
    "without control": ViewContext(control_lock=LOCK),
    "an unwritten log": ViewContext(fault="Disk full", log_lock="Disk full"),
    "an alarm": ViewContext(inhibited={"reset": locked("alarm_inhibits_action", text="Door")}),
}


@pytest.mark.parametrize("context", CONTEXTS.values(), ids=[*CONTEXTS])
@pytest.mark.parametrize("status", STATUSES.values(), ids=[*STATUSES])
@pytest.mark.parametrize("widget", ["reset", "stop", "count", "sure"])
def test_a_status_that_is_shown_alone_equals_a_full_rebuild(
    widget: str, status: CommandStatus, context: ViewContext
) -> None:
    robot = there(COMMANDS)
    built = build_view(COMMANDS, robot, NOW, context)
    robot.command_status[widget] = status
    command = next(command for command in COMMANDS.commands if command.id == widget)
    updated = update_commands(built, [command], COMMANDS, robot, NOW + 0.5, context)
    whole = build_view(COMMANDS, robot, NOW + 0.5, context)
    assert updated.view == whole.view
    assert updated.without_control == whole.without_control
    assert updated.rest <= whole.rest  # or it is looked at earlier than need be


def test_a_status_is_shown_without_building_the_other_widgets(monkeypatch: pytest.MonkeyPatch) -> None:
    async def shown() -> None:
        robot = there(COMMANDS)
        showing = showing_of(COMMANDS, robot)
        ids: list[str] = []
        real = kinds.attributes_of

        def counted(widget: Any, *arguments: Any) -> Any:
            ids.append(widget.id)
            return real(widget, *arguments)

        monkeypatch.setattr("app.cell.view.view.attributes_of", counted)
        robot.command_status["reset"] = STATUSES["waits"]
        showing.refresh_commands({"reset"})
        assert ids == ["reset"]
        assert showing.publisher.view["widgets"]["reset"]["busy"]
        showing.refresh_commands({"no widget of the panel"})
        assert {*ids} == {widget.id for widget in COMMANDS.widgets()}
        showing.stop()

    run(shown())
