"""A joystick with a finger on Chromium and a real node behind the real bridge: what it sends, and each
way in which it ends, with zeros and nothing after."""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from tests.support import holds
from tests.support.browser.finger import SCRIPTS, Finger, begun, ended_by
from tests.support.browser.pages import place, widget
from tests.support.holds import QUIET_S, codes
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import kept_running, live_server

pytestmark = [pytest.mark.long("real time"), pytest.mark.promise("hold")]

PANEL: Final = """
title = "Drive"
[[interlock]]
id = "operation"
topic = "/stick_enabled"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "stick"
kind = "joystick"
label = "Drive"
topic = "/stick"
type = "geometry_msgs/msg/Twist"
rate_hz = 50
interlock = "operation"
y_axis = { max = 0.5, unit = "m/s" }
x_axis = { max = -1.0, unit = "rad/s" }
[[page.widget]]
id = "stamped"
kind = "joystick"
label = "Stamped"
topic = "/stamped"
type = "geometry_msgs/msg/TwistStamped"
frame_id = "tool"
interlock = "operation"
shape = "square"
"""
TOPIC: Final = "/stick"
Twist = tuple[float, float]


@pytest.fixture(scope="module")
def robot(node: RosNode) -> Iterator[RosNode]:
    node.subscribe(TOPIC, "geometry_msgs/msg/Twist", depth=1000)
    node.subscribe("/stamped", "geometry_msgs/msg/TwistStamped", depth=1000)
    node.advertise("/stick_enabled", "std_msgs/msg/Bool")
    yield node
    node.withdraw("/stick_enabled")


@pytest.fixture(scope="module")
def running(
    bridge: Bridge, robot: RosNode, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[], Server]]:
    """Gives the kiosk of this file, and another one where a test ended that."""

    def start() -> Server:
        return live_server(bridge, tmp_path_factory.mktemp("stick"), PANEL)

    with kept_running(start) as running:
        yield running


@pytest.fixture
def kiosk(running: Callable[[], Server], robot: RosNode) -> Server:
    mine = running()
    permit(mine, robot, True)
    return mine


def permit(server: Server, robot: RosNode, permitted: bool) -> None:
    holds.permit(server, robot, permitted, "/stick_enabled", "stick")


@pytest.fixture
def thumb(touch_page: Page, kiosk: Server) -> "Thumb":
    return Thumb(touch_page, kiosk)


class Thumb(Finger):
    """A page with joysticks, and a finger on one of them."""

    def __init__(self, page: Page, server: Server, name: str = "stick") -> None:
        self.root = widget(page, name)
        self.pad = self.root.locator(".pad")
        super().__init__(page, server, self.root.locator(".hold"), self.pad)

    def opens(self) -> None:
        super().opens()
        self.far = place(self.pad)["width"] / 2

    def at(self, x: float, y: float) -> tuple[float, float]:
        return self.x + x * self.far, self.y - y * self.far

    def hold(self) -> None:
        self.down()
        self.move(0, 2)  # further than the pad: the finger stays with it

    def move(self, x: float, y: float) -> None:
        self.touch.send("touchMove", self.at(x, y))

    def second(self) -> None:
        self.touch.send("touchStart", self.at(0, 1), (5, 5))

    @property
    def knob(self) -> tuple[float, float]:
        style = "(knob) => ['--x', '--y'].map((name) => Number(knob.style.getPropertyValue(name)))"
        x, y = self.root.locator(".knob").evaluate(style)
        return x, y


def heard(robot: RosNode, before: int = 0) -> list[Twist]:
    """(forward, turn) of what was heard."""
    return [(twist["linear"]["x"], twist["angular"]["z"]) for twist in robot.heard(TOPIC)[before:]]


def stopped(robot: RosNode) -> bool:
    return heard(robot)[-1] == (0.0, 0.0)


def drives(robot: RosNode, before: int) -> bool:
    return (0.5, 0.0) in heard(robot, before)


def driving(thumb: Thumb, robot: RosNode) -> tuple[int, int]:
    """Holds until the robot drives, as `begun`."""
    return begun(thumb, robot, TOPIC, drives)


def drive_ended_by(
    thumb: Thumb, robot: RosNode, cause: Callable[[], Any], code: str, lift: bool = True
) -> None:
    """Drives, lets the cause happen: for that reason it ends, with zeros, and nothing comes after."""
    begin, zeros = partial(driving, thumb, robot), partial(stopped, robot)
    before, _ = ended_by(thumb, begin, cause, code, lift, zeros)
    sent = heard(robot, before)
    drove = sent.index((0.5, 0.0))
    assert sent[drove:] == [(0.5, 0.0)] * (len(sent) - drove - 1) + [(0.0, 0.0)]


TOUCHES: Final = {
    "released": ("up", "hold_released"),
    "second finger": ("second", "hold_by_second_finger"),
}


@pytest.mark.parametrize("cause", TOUCHES)
def test_lifted_finger_ends_the_hold(thumb: Thumb, robot: RosNode, cause: str) -> None:
    name, code = TOUCHES[cause]
    drive_ended_by(thumb, robot, getattr(thumb, name), code)
    assert thumb.knob == (0.0, 0.0)
    expect(thumb.root.locator('[data-axis="y"]')).to_have_text("")


@pytest.mark.parametrize("cause", ["window blurred", "stream lost"])
def test_closed_page_ends_the_hold(thumb: Thumb, robot: RosNode, cause: str) -> None:
    """The other causes end any hold: `test_holds_in_browser`."""
    script, code = SCRIPTS[cause]
    drive_ended_by(thumb, robot, partial(thumb.does, script), code)


def test_lost_permission_ends_the_hold(thumb: Thumb, robot: RosNode) -> None:
    def forbid() -> None:
        robot.publish("/stick_enabled", {"data": False})

    drive_ended_by(thumb, robot, forbid, "interlock_not_permitted", lift=False)
    expect(thumb.button).to_be_disabled()
    expect(thumb.root.locator('[data-text="reason"]')).to_contain_text("does not permit operation")
    count = len(robot.heard(TOPIC))
    permit(thumb.server, robot, True)
    expect(thumb.button).to_be_enabled()
    thumb.move(0, -1)  # the finger rests on it, and moves
    time.sleep(QUIET_S)
    assert len(robot.heard(TOPIC)) == count


def test_knob_follows_the_finger_and_the_page_shows_the_sent_value(
    thumb: Thumb, robot: RosNode
) -> None:
    before = len(robot.heard(TOPIC))
    thumb.down()
    thumb.move(3, 0)
    until(lambda: (0.0, -1.0) in heard(robot, before), "to the right is a negative turn")
    assert thumb.knob == (1.0, 0.0)
    expect(thumb.root.locator('[data-axis="x"]')).to_have_text("−1.00 rad/s")
    expect(thumb.root.locator('[data-axis="y"]')).to_have_text("0.00 m/s")
    thumb.move(0.04, 0.0)
    until(partial(stopped, robot), "the dead zone is zero")
    thumb.up()
    assert thumb.knob == (0.0, 0.0)
    assert all(abs(drive) <= 0.5 and abs(turn) <= 1.0 for drive, turn in heard(robot, before))


def test_arrow_keys_deflect_the_joystick(thumb: Thumb, robot: RosNode) -> None:
    before = len(robot.heard(TOPIC))
    thumb.button.focus()
    thumb.page.keyboard.down("ArrowUp")
    until(lambda: (0.5, 0.0) in heard(robot, before), "it drives")
    thumb.page.keyboard.down("ArrowLeft")
    until(lambda: heard(robot)[-1][1] > 0.7, "it turns to the left as well")
    thumb.page.keyboard.up("ArrowUp")
    until(lambda: heard(robot)[-1] == (0.0, 1.0), "it turns only")
    thumb.page.keyboard.up("ArrowLeft")
    until(partial(stopped, robot), "it stops")
    until(lambda: codes(thumb.server)[-1:] == ["hold_released"], "released")


def test_a_stamped_twist_has_its_time_and_frame(thumb: Thumb, robot: RosNode) -> None:
    stamped = Thumb(thumb.page, thumb.server, "stamped")
    before = len(robot.heard("/stamped"))
    stamped.down()
    stamped.move(2, 2)

    def full() -> list[dict[str, Any]]:
        messages: list[dict[str, Any]] = robot.heard("/stamped")[before:]
        return [message for message in messages if message["twist"]["linear"]["x"] == 1.0]

    until(full, "a square goes to the full value of both")
    message = full()[0]
    assert message["twist"]["angular"]["z"] == -1.0
    assert message["header"]["frame_id"] == "tool"
    assert abs(message["header"]["stamp"]["sec"] - time.time()) < 60
    stamped.up()
    until(lambda: robot.heard("/stamped")[-1]["twist"]["linear"]["x"] == 0.0, "it stops")


def test_finger_that_rests_elsewhere_does_not_move_the_joystick(thumb: Thumb, robot: RosNode) -> None:
    """It follows the finger on it, which came after the other one."""
    before = len(robot.heard(TOPIC))
    thumb.touch.send("touchStart", (5, 5))
    time.sleep(QUIET_S)
    assert len(robot.heard(TOPIC)) == before
    thumb.touch.send("touchStart", (5, 5), thumb.at(0, 1))
    until(lambda: (0.5, 0.0) in heard(robot, before), "it drives")
    driven = len(robot.heard(TOPIC))
    thumb.touch.send("touchMove", (60, 60), thumb.at(0, 1))
    until(lambda: len(robot.heard(TOPIC)) > driven + 5, "it drives on")
    assert {*heard(robot, driven)} == {(0.5, 0.0)}
    thumb.touch.send("touchMove", (60, 60), thumb.at(1, 0))
    until(lambda: (0.0, -1.0) in heard(robot, driven), "it turns")
    thumb.touch.send("touchEnd")
    until(partial(stopped, robot), "it stops")


def test_hold_without_scripts_is_locked_with_a_reason(without_scripts: Page, kiosk: Server) -> None:
    without_scripts.goto(kiosk.url)
    stick = widget(without_scripts, "stick")
    expect(stick.locator("button")).to_be_disabled()
    expect(stick.locator('[data-text="reason"]')).to_contain_text("needs JavaScript")


def test_joystick_is_large_enough_for_gloves(thumb: Thumb) -> None:
    box = place(thumb.button)
    assert min(box["width"], box["height"]) * 0.22 >= 59.9
