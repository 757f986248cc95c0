"""Between the judging of a press and its sending a permission can be taken back: what has come by then
counts."""

import asyncio
import time
from bisect import bisect
from collections.abc import Callable
from typing import Any

import pytest

from app.cell.commands.receipts import MAX_FINAL_CHECKS, Receipt
from app.cell.link.bridge import BRIDGE as BRIDGES
from app.cell.robot.state import RobotState
from app.cell.session.session import ServerParts, wire_session
from app.records import NullLog
from app.ros.dialects.bridge_dialect import server_token
from app.ros.zenoh.config import config_to
from app.ros.zenoh.inbox import Inbox
from app.ros.zenoh.session import ZenohSession
from tests.support.builders import (
    BRIDGE,
    COUNT,
    FREE,
    GUARDED,
    MESSAGE,
    FakeTransport,
    Table,
    panel_of,
    permits,
    press_widget,
    presses_of,
    robot_there,
    small_panel,
)
from tests.support.form import several
from tests.support.parts import Bridge, RosNode

pytestmark = pytest.mark.promise("press")

CALL: Table = {
    "id": "reset",
    "kind": "call",
    "label": "Reset",
    "service": "/reset",
    "type": "std_srvs/srv/Trigger",
    "request": {},
    "interlock": "operation",
}
GOAL: Table = {**COUNT, "interlock": "operation"}
PANEL = panel_of(MESSAGE, FREE, GUARDED, CALL, GOAL)
PRESSES = several(150, 600)


class Way(FakeTransport):
    """It keeps what was sent, and answers nothing."""

    def __init__(self) -> None:
        self.sent: list[str] = []

    def put(self, key: str, payload: bytes) -> None:
        self.sent.append(key)

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        self.sent.append(key)
        answer: asyncio.Future[bytes | None] = asyncio.get_running_loop().create_future()
        answer.set_result(None)
        return answer


class Late:
    """News that come after the press was judged, so often; each is taken in by the next look."""

    def __init__(self, robot: RobotState, *said: bool, ends: bool = True) -> None:
        self._robot = robot
        self._said = list(said)
        self._ends = ends
        self.waiting = False

    def news(self) -> bool:
        self.waiting = bool(self._said) or not self._ends
        return self.waiting

    def catch_up(self) -> None:
        if self.waiting and self._said:
            permits(self._robot, self._said.pop(0))


def robot_permits() -> RobotState:
    robot = robot_there(PANEL)
    permits(robot)
    robot.graph.apply_token(server_token(BRIDGE, "SS", "reset", CALL["type"]), True, 0.0)
    robot.graph.apply_token(server_token(BRIDGE, "AS", "count", GOAL["type"]), True, 0.0)
    return robot


def pressed(widget: str, way: Way, late: Late, robot: RobotState) -> Receipt:
    presses = presses_of(PANEL, robot, way, catch_up=late.catch_up, news=late.news)
    return asyncio.run(press_widget(presses, widget, {"message": "x"}, "p1"))


@pytest.mark.parametrize("widget", ["guarded", "reset", "count"])
def test_permission_withdrawn_during_encoding_stops_the_press(widget: str) -> None:
    robot, way = robot_permits(), Way()
    receipt = pressed(widget, way, Late(robot, False), robot)
    assert (receipt.outcome, receipt.cause) == ("refused", "interlock")
    assert "The robot does not permit operation." in str(receipt.reason)
    assert way.sent == []


@pytest.mark.parametrize("widget", ["guarded", "reset", "count"])
def test_nothing_is_sent_while_the_server_ends(widget: str) -> None:
    robot, way = robot_permits(), Way()
    presses = presses_of(PANEL, robot, way)
    presses.close()
    receipt = asyncio.run(press_widget(presses, widget, {"message": "x"}, "p1"))
    assert (receipt.outcome, receipt.cause) == ("refused", "interlock")
    assert "the panel server is shutting down" in str(receipt.reason)
    assert way.sent == []


@pytest.mark.parametrize("widget", ["guarded", "reset", "count"])
def test_permission_given_again_before_sending_permits_the_press(widget: str) -> None:
    robot, way = robot_permits(), Way()
    pressed(widget, way, Late(robot, True, True), robot)
    assert len(way.sent) >= 1


def test_samples_that_arrive_faster_than_they_are_ingested_stop_the_press() -> None:
    robot, way = robot_permits(), Way()
    late = Late(robot, *[True] * (MAX_FINAL_CHECKS + 5), ends=False)
    receipt = pressed("guarded", way, late, robot)
    assert (receipt.outcome, receipt.cause, way.sent) == ("refused", "link", [])


class Recorded:
    """When each value of the permission came into the inbox, and when each press was put: at the last
    look at the inbox in the same step of the event loop, else at the put itself."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.came: list[tuple[float, bool]] = []
        self.put: list[float] = []
        self._looked_at: float | None = None
        add, put = Inbox.put, ZenohSession.put

        def added(inbox: Inbox, key: str, payload: Any, *sent: Any) -> None:
            before = time.monotonic()
            add(inbox, key, payload, *sent)
            if key == "operation_enabled":  # one that is just being added is a doubt: it may be sent
                permitted = bytes(payload)[4] == 1
                self.came.append((before if permitted else time.monotonic(), permitted))

        def looked(link: ZenohSession) -> bool:
            self._looked_at = time.monotonic()
            asyncio.get_running_loop().call_soon(self._end_step)
            return link._inbox.has_immediate

        def was_put(link: ZenohSession, key: str, payload: bytes) -> None:
            if key == "guarded":
                self.put.append(time.monotonic() if self._looked_at is None else self._looked_at)
            put(link, key, payload)

        monkeypatch.setattr(Inbox, "put", added)
        monkeypatch.setattr(ZenohSession, "put", was_put)
        monkeypatch.setattr(ZenohSession, "has_immediate", property(looked))

    def _end_step(self) -> None:
        self._looked_at = None

    def forbidden(self) -> list[float]:
        """Of each put that came after a `false`: how many seconds after."""
        times = [at for at, _ in self.came]
        before = ((at, self.came[bisect(times, at) - 1]) for at in self.put)
        return [at - came_at for at, (came_at, permitted) in before if not permitted]


async def pressing(endpoint: str, over: Callable[[], bool]) -> None:
    """Presses as fast as it can, one after the other."""
    kiosk = wire_session(
        ServerParts(small_panel(), "revision", NullLog()), config_to(endpoint), BRIDGES
    )
    await kiosk.start()
    number = 0
    while not over():
        number += 1
        await press_widget(kiosk.presses, "guarded", {"message": "x"}, f"p{number}")
        await asyncio.sleep(0)
    await kiosk.stop()


def test_false_in_the_inbox_stops_the_press(
    own_bridge: Bridge, own_node: RosNode, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A node permits and forbids 400 times a second, while someone presses all the time."""
    recorded = Recorded(monkeypatch)
    own_node.subscribe("/guarded", "std_msgs/msg/String")
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")

    def over() -> bool:
        return len(recorded.put) >= PRESSES

    async def toggled() -> None:
        pressed = asyncio.ensure_future(pressing(own_bridge.endpoint, over))
        while not pressed.done():
            await asyncio.to_thread(own_node.toggle, "/operation_enabled", 400, 2.0)
        await pressed

    asyncio.run(asyncio.wait_for(toggled(), 120))
    assert recorded.forbidden() == [], f"of {len(recorded.put)} presses"
