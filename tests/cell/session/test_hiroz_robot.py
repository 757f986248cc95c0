"""A robot that nobody here wrote: a node on hiroz, by the makers of Zenoh. Its keys, tokens,
attachments and type hashes are its own (`tests/rmw_crate/`)."""

import asyncio
import signal
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from app.cell.session.session import RobotSession
from tests.cell.session.test_rmw_zenoh import asked, enabled, link, session_with
from tests.support.builders import ENABLED, GUARDED, MESSAGE, panel_of, press_widget
from tests.support.parts import Process, until
from tests.support.rmw import RmwNode, Router
from tests.support.waiting import when

pytestmark = pytest.mark.promise("dialects")

NUMBER = {"id": "number", "kind": "number", "label": "Number", "min": 0, "max": 20}
SAY = {**GUARDED, "id": "say", "topic": "/operation"}
LAST = {
    "id": "last",
    "kind": "readout",
    "label": "Heard",
    "topic": "/last_heard",
    "type": "std_msgs/msg/String",
    "field": "data",
}
ADD = {
    "id": "add",
    "kind": "call",
    "label": "Add",
    "service": "/add",
    "type": "example_interfaces/srv/AddTwoInts",
    "request": {"a": "{number}", "b": 2},
    "answer": "{sum}",
}
COUNT = {
    "id": "count",
    "kind": "action",
    "label": "Count",
    "action": "/count",
    "type": "example_interfaces/action/Fibonacci",
    "goal": {"order": "{number}"},
}
SPEED = {
    "id": "speed",
    "kind": "parameter",
    "label": "Speed",
    "node": "/system_controller",
    "parameter": "max_speed",
    "type": "integer",
    "min": 0,
    "max": 60,
}
PANEL = panel_of(MESSAGE, NUMBER, SAY, LAST, ADD, COUNT, SPEED)


@pytest.fixture
def robot(hiroz: Path, router: Router) -> Iterator[Process]:
    mine = Process([str(hiroz), router.endpoint], {})
    until(lambda: "running" in mine.text or not mine.running, "it runs")
    assert mine.running, mine.text
    yield mine
    mine.end(signal.SIGKILL)


def shown(session: RobotSession, widget: str) -> Any:
    return session.publisher.view["widgets"][widget]


def test_everything_of_a_robot_on_hiroz_works(router: Router, robot: Process) -> None:
    """Nobody said that it is on rmw_zenoh."""

    async def scene() -> None:
        async with session_with(router, PANEL) as session:
            await when(partial(enabled, session, "say"), "the latched permission came")
            said = await press_widget(session.presses, "say", {"message": "hello"}, "n1")
            assert said.outcome == "published", said.reason
            await when(lambda: "heard hello" in robot.text, "it heard the press")
            await when(lambda: "hello" in str(shown(session, "last")), "it says it back")

            await when(partial(enabled, session, "add"))
            added = await press_widget(session.presses, "add", {"number": 40}, "n2")
            assert added.outcome == "refused", added.reason  # beyond the input's limits
            added = await press_widget(session.presses, "add", {"number": 5}, "n3")
            assert added.outcome == "succeeded", added.reason
            assert "7" in str(added.reason)

            await when(partial(enabled, session, "speed"), "the parameter was read")
            assert "50" in str(shown(session, "speed"))
            set_to = await press_widget(session.presses, "speed", {"speed": 33}, "n4")
            assert set_to.outcome == "succeeded", set_to.reason
            await when(lambda: "33" in str(shown(session, "speed")), "it is read back")

            await when(partial(enabled, session, "count"))
            goal = await press_widget(session.presses, "count", {"number": 6}, "n5")
            assert goal.outcome == "accepted", goal.reason
            await when(lambda: shown(session, "count")["outcome"] == "succeeded", "a result")

    asyncio.run(scene())


def test_it_sees_the_panel_and_its_death_is_seen(router: Router, robot: Process) -> None:
    async def scene() -> None:
        other = await asked(RmwNode, router, "other")
        try:
            async with session_with(router, PANEL) as session:
                await when(partial(enabled, session, "say"))
                assert {"/system_controller", "/web_ui", "/other"} == set(await asked(other.nodes))
                robot.send(signal.SIGKILL)
                await when(lambda: not enabled(session, "say"), "locked")
                await when(lambda: link(session, "node")["state"] == "bad")
                assert "Node /system_controller has ended" in str(link(session, "node")["reason"])
                assert ENABLED in str(shown(session, "say")["reason"])
        finally:
            await asked(other.end)

    asyncio.run(scene())
