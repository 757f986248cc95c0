"""Switches: what a press sends, and how the robot's report ends it."""

import asyncio
import itertools
import time
from typing import Any, Final

import pytest

from app.cell.commands import confirmations
from app.cell.commands.confirmations import Confirmations
from app.cell.commands.receipts import Receipt
from app.cell.view.view import build_view
from app.panel.widgets.switch import Switch
from app.records.entry import IDLE
from app.ros.dialects import bridge_dialect
from tests.cell.commands.test_presses import Way
from tests.support.builders import (
    BOOL,
    BRIDGE,
    INTERFACES,
    endpoint,
    panel_of,
    press_widget,
    presses_of,
    robot_there,
    says,
)
from tests.support.waiting import turns, when
from tests.support.words import english

SET_BOOL: Final = "std_srvs/srv/SetBool"
LIGHT: Final = {
    "id": "light",
    "kind": "switch",
    "label": "Light",
    "confirm_s": 0.2,
    "reported": {"topic": "/light", "type": BOOL, "max_age_s": 5.0},
}
BY_TOPIC: Final = {
    "topic": "/light_set",
    "type": BOOL,
    "on_message": {"data": True},
    "off_message": {"data": False},
}
BY_SERVICE: Final = {
    "service": "/light_set",
    "type": SET_BOOL,
    "on_request": {"data": True},
    "off_request": {"data": False},
}


class Line(Way):
    """A link whose calls are answered by hand."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[tuple[bytes, asyncio.Future[bytes | None]]] = []

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        future: asyncio.Future[bytes | None] = asyncio.get_running_loop().create_future()
        self.calls.append((payload, future))
        return future

    def answer(self, **fields: Any) -> None:
        self.calls[-1][1].set_result(INTERFACES.encode(f"{SET_BOOL}_Response", fields))


class Desk:
    """A switch, and a robot that is there."""

    def __init__(self, **keys: Any) -> None:
        self.now = time.monotonic()  # as of results
        self.panel = panel_of(LIGHT | keys)
        self.robot, self.line = robot_there(self.panel), Line()
        endpoint(self.robot, "MP", "/light", BOOL)
        server = bridge_dialect.server_token(BRIDGE, "SS", "light_set", SET_BOOL)
        self.robot.graph.apply_token(server, True)
        self.confirmations = Confirmations(self.robot, lambda _: None)
        self.presses = presses_of(
            self.panel,
            self.robot,
            self.line,
            confirmations=self.confirmations,
            monotonic=lambda: self.now,
        )
        self._seq = itertools.count(1)

    def press(self, on: Any) -> "asyncio.Task[Receipt]":
        self.now += 10  # a server that has just begun is not called
        return asyncio.create_task(press_widget(self.presses, "light", {"light": on}, "p1"))

    def reports(self, on: bool) -> None:
        self.now += 0.1
        says(self.robot, "/light", on, BOOL, at=self.now, seq=next(self._seq))
        self.confirmations.update(self.robot.key("/light"), self.robot.reading("/light"))

    @property
    def shown(self) -> Any:
        return english(build_view(self.panel, self.robot, self.now).view["widgets"]["light"])

    @property
    def switch(self) -> Switch:
        return self.panel.widget("light", Switch)


async def sent(desk: Desk) -> None:
    """Waits until a press was sent."""
    await when(lambda: desk.line.sent or desk.line.calls, "a press is sent")


@pytest.mark.parametrize("on", [True, False])
def test_a_press_publishes_and_waits_for_the_report(on: bool) -> None:
    async def pressed() -> None:
        desk = Desk(**BY_TOPIC)
        desk.reports(not on)
        press = desk.press(on)
        await sent(desk)
        assert [INTERFACES.decode(BOOL, payload).data for _, payload in desk.line.sent] == [on]
        before, after = ("off", "on") if on else ("on", "off")
        assert (desk.shown["awaited"], desk.shown["enabled"]) == (after, False)
        desk.now -= 10
        assert desk.shown["at"] == before
        desk.now += 10
        desk.reports(on)
        assert (await press).outcome == "confirmed"
        assert (desk.shown["at"], desk.shown["awaited"], desk.shown["enabled"]) == (after, "", True)

    asyncio.run(pressed())


def test_a_report_that_does_not_come_is_said_and_a_late_one_counts(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(confirmations, "LATE_S", 5.0)

    async def pressed() -> None:
        desk = Desk(**BY_TOPIC)
        desk.reports(False)
        receipt = await desk.press(True)
        assert receipt.outcome == "unknown"
        assert "The robot did not confirm it within 0.2 s." in str(receipt.reason)
        assert (desk.shown["awaited"], desk.shown["outcome"]) == ("", "unknown")
        desk.reports(True)
        await asyncio.sleep(0)
        assert (desk.shown["at"], desk.shown["outcome"]) == ("on", "confirmed")

    asyncio.run(pressed())


@pytest.mark.parametrize("is_early", [True, False])
def test_a_call_waits_for_the_report_too(is_early: bool) -> None:
    """The report may come before the service's response."""

    async def pressed() -> None:
        desk = Desk(**BY_SERVICE)
        desk.reports(False)
        press = desk.press(True)
        await sent(desk)
        (payload, _) = desk.line.calls[0]
        assert INTERFACES.decode(f"{SET_BOOL}_Request", payload).data is True
        if is_early:
            desk.reports(True)
        desk.line.answer(success=True)
        await turns()
        if not is_early:
            assert not press.done()
            assert desk.shown["awaited"] == "on"
            desk.reports(True)
        assert (await press).outcome == "confirmed"

    asyncio.run(pressed())


def test_a_call_that_the_robot_rejects_waits_for_no_report() -> None:
    async def pressed() -> Receipt:
        desk = Desk(**BY_SERVICE)
        press = desk.press(True)
        await sent(desk)
        desk.line.answer(success=False, message="no power")
        return await press

    receipt = asyncio.run(pressed())
    assert receipt.outcome == "rejected"
    assert "no power" in str(receipt.reason)


@pytest.mark.parametrize("way", [BY_TOPIC, BY_SERVICE], ids=["topic", "service"])
@pytest.mark.parametrize("on", [True, False])
def test_the_position_that_is_reported_is_not_sent_again(on: bool, way: Any) -> None:
    async def pressed() -> None:
        desk = Desk(**way)
        desk.now += 10
        desk.reports(on)
        receipt = await press_widget(desk.presses, "light", {"light": on}, "p1")
        assert (receipt.outcome, receipt.cause) == ("refused", "interlock")
        assert "already" in english(receipt.reason)
        assert (desk.line.sent, desk.line.calls, desk.shown["enabled"]) == ([], [], True)

    asyncio.run(pressed())


def test_only_true_and_false_are_positions() -> None:
    async def pressed() -> tuple[Receipt, int]:
        desk = Desk(**BY_TOPIC)
        return await desk.press("yes"), len(desk.line.sent)

    receipt, count = asyncio.run(pressed())
    assert (receipt.outcome, count) == ("refused", 0)


def test_a_report_that_is_missing_old_or_neither_is_not_known_and_does_not_lock() -> None:
    desk = Desk(**BY_TOPIC)
    assert (desk.shown["state"], desk.shown["at"], desk.shown["text"]) == ("waiting", "", "not known")
    assert desk.shown["enabled"]
    desk.reports(True)
    assert (desk.shown["state"], desk.shown["at"], desk.shown["text"]) == ("live", "on", "On")
    desk.now += 6
    assert (desk.shown["state"], desk.shown["at"], desk.shown["text"]) == ("old", "", "not known")
    assert desk.shown["enabled"]


def test_a_value_that_is_neither_position_is_said() -> None:
    desk = Desk(
        **BY_TOPIC,
        on_value="ON",
        off_value="OFF",
        reported={"topic": "/light", "type": "std_msgs/msg/String"},
    )
    endpoint(desk.robot, "MP", "/light", BOOL, alive=False)
    says(desk.robot, "/light", "BROKEN", "std_msgs/msg/String")
    assert (desk.shown["at"], desk.shown["note"]) == ("", "The robot reports BROKEN, which is neither.")
    assert desk.robot.command_status.get("light", IDLE) is IDLE


def test_the_panel_knows_what_a_switch_publishes_calls_and_listens_to() -> None:
    by_topic, by_service = Desk(**BY_TOPIC), Desk(**BY_SERVICE)
    assert by_topic.panel.publications() == {"/light_set": BOOL}
    assert by_service.panel.publications() == {}
    for desk in (by_topic, by_service):
        assert desk.panel.subscriptions()["/light"] == BOOL
        assert ("MP", "/light") in set(desk.switch.endpoints())
