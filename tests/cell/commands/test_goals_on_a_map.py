"""Presses that send a place: exactly what was judged, with its name; nothing where a doubt comes."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from app.cell.commands.receipts import Receipt
from app.cell.robot.state import RobotState
from app.panel.model import Panel
from tests.cell.permission.test_goal_places import cell_with, put_map, touched
from tests.support.builders import INTERFACES, NOW, FakeTransport, press_widget, presses_of

pytestmark = pytest.mark.promise("places")

POSE = "geometry_msgs/msg/PoseStamped"


class Sent(FakeTransport):
    """It keeps what was sent."""

    def __init__(self) -> None:
        self.messages: list[Any] = []

    def has_reader(self, key: str) -> bool:
        return True

    def put(self, key: str, payload: bytes) -> None:
        self.messages.append(INTERFACES.decode(POSE, payload))


def pressed(
    panel: Panel,
    robot: RobotState,
    value: Any,
    now: Callable[[], float] = lambda: NOW,
    late: Callable[[], None] | None = None,
) -> tuple[Receipt, list[Any]]:
    """The receipt of a press, and what was sent. `late` happens after the press was judged."""
    way, looks = Sent(), [False, True] if late else []
    presses = presses_of(
        panel,
        robot,
        way,
        monotonic=now,
        catch_up=lambda: late() if late and not looks else None,
        news=lambda: bool(looks) and looks.pop(0) is not None,
    )
    receipt = asyncio.run(press_widget(presses, "drive", {"goal": value}, "p1"))
    return receipt, way.messages


def test_the_pose_of_the_place_is_sent_in_the_map_s_frame_and_named() -> None:
    panel, robot, _, version = cell_with()
    receipt, (message,) = pressed(panel, robot, "dock")
    assert (receipt.outcome, receipt.cause) == ("published", "")
    assert str(receipt.reason).startswith("Dock: ")
    assert message.header.frame_id == "map"
    assert (message.pose.position.x, message.pose.position.y) == (2.0, 3.0)
    receipt, (message,) = pressed(panel, robot, touched(version))
    assert str(receipt.reason).startswith("x 2.50 m, y 1.25 m: ")
    assert (message.pose.position.x, message.pose.position.y) == (2.5, 1.25)
    assert message.pose.orientation.z == pytest.approx(0.7068, abs=1e-3)


@pytest.mark.parametrize("value", ["wall", "stairs", "old", "odom"])
def test_a_place_that_may_not_be_sent_is_refused_as_by_an_interlock(value: str) -> None:
    panel, robot, _, _ = cell_with()
    receipt, messages = pressed(panel, robot, value)
    assert (receipt.outcome, receipt.cause, messages) == ("refused", "interlock", [])


@pytest.mark.parametrize("value", ["gone", "x=1 y=2", 7])
def test_a_value_that_chooses_nothing_is_bad_input(value: Any) -> None:
    panel, robot, _, _ = cell_with()
    receipt, messages = pressed(panel, robot, value)
    assert (receipt.outcome, receipt.cause, messages) == ("refused", "input", [])


def test_an_old_position_refuses_the_press() -> None:
    panel, robot, _, _ = cell_with()
    receipt, messages = pressed(panel, robot, "dock", lambda: NOW + 6)
    assert (receipt.outcome, receipt.cause, messages) == ("refused", "interlock", [])


def test_a_map_that_comes_before_the_message_is_sent_stops_it() -> None:
    panel, robot, _, version = cell_with()

    def changed() -> None:
        put_map(robot, unknown=True)

    for value in ("dock", touched(version)):
        receipt, messages = pressed(panel, robot, value, late=changed)
        assert (receipt.outcome, receipt.cause, messages) == ("refused", "interlock", []), value
        put_map(robot)


def test_the_same_press_again_sends_nothing_more() -> None:
    panel, robot, _, _ = cell_with()
    way = Sent()
    presses = presses_of(panel, robot, way)

    async def twice() -> tuple[Receipt, Receipt]:
        first = await press_widget(presses, "drive", {"goal": "dock"}, "p1")
        return first, await press_widget(presses, "drive", {"goal": "dock"}, "p1")

    first, second = asyncio.run(twice())
    assert first == second
    assert len(way.messages) == 1
