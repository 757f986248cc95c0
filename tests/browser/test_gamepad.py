"""A gamepad on a joystick: the grip key begins and ends the hold, the stick moves it, and whatever else
ends a hold ends this one. The gamepad is simulated in the page: no machine of the tests has one."""

import json
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, Final

import pytest
from playwright.sync_api import Page, WebSocket, expect

from tests.support.browser.pages import widget
from tests.support.holds import TRIES
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("hold")

PANEL: Final = """
title = "Drive"
mode = "demo"
[[interlock]]
id = "operation"
topic = "/enabled"
[[page]]
id = "drive"
title = "Drive"
[[page.widget]]
id = "stick"
kind = "joystick"
label = "Drive"
topic = "/cmd_vel"
type = "geometry_msgs/msg/Twist"
interlock = "operation"
gamepad = "left"
[demo."/enabled"]
values = [true]
"""
# What the browser says of a gamepad, as a test sets it.
GAMEPAD: Final = """
window.gamepads = [];
navigator.getGamepads = () => window.gamepads;
window.plug = (mapping) => {
  const buttons = Array.from({ length: 17 }, () => ({ pressed: false }));
  window.gamepads = [{ index: 0, connected: true, mapping, axes: [0, 0, 0, 0], buttons }];
  dispatchEvent(new Event("gamepadconnected"));
};
window.unplug = () => {
  window.gamepads = [null];
  dispatchEvent(new Event("gamepaddisconnected"));
};
"""
GRIP: Final = "down => { gamepads[0].buttons[4].pressed = down }"
MOVED: Final = "gamepads[0].axes = [0.5, -1, 0, 0]"
LOOKED: Final = "() => new Promise(done => setTimeout(done, 60))"  # the page has looked at it since


class Pad:
    """A gamepad at the page, and what the page said of its holds."""

    def __init__(self, page: Page, server: Server) -> None:
        self.page, self.said = page, list[dict[str, Any]]()
        page.add_init_script(GAMEPAD)
        page.on("websocket", self._listen)
        page.goto(server.url)
        self.root = widget(page, "stick")
        expect(self.root.locator(".hold")).to_be_enabled()

    def _listen(self, socket: WebSocket) -> None:
        if "/hold" in socket.url:
            socket.on("framesent", lambda text: self.said.append(json.loads(text)))

    def plug(self, mapping: str = "standard") -> None:
        self.page.evaluate("mapping => plug(mapping)", mapping)
        self.page.evaluate(LOOKED)

    def grip(self, down: bool) -> None:
        self.page.evaluate(GRIP, down)
        self.page.evaluate(LOOKED)

    def hold(self) -> None:
        """Again where it ends at once: on a machine that stands still it does, as it should."""
        for _ in range(TRIES):
            self.grip(True)
            with suppress(AssertionError):
                expect(self.root).to_have_attribute("data-hold", "held", timeout=3000)
                return
            self.grip(False)
        raise AssertionError(f"it is not held: {self.said}")

    def ended_by(self, cause: Callable[["Pad"], str]) -> None:
        """Holds until this cause ends it."""
        for _ in range(TRIES):
            self.plug()
            self.hold()
            why = cause(self)
            with suppress(AssertionError):
                until(partial(self.ended, why), f"the end by {why}", within_s=3)
                return
            self.page.reload()
            expect(self.root.locator(".hold")).to_be_enabled()
        raise AssertionError(f"it ended otherwise: {self.said}")

    def ended(self, why: str) -> bool:
        self.page.evaluate("0")
        return any(message["do"] == "end" and message["why"] == why for message in self.said)

    @property
    def deflection(self) -> tuple[float, float]:
        """That of the last heartbeat."""
        self.page.evaluate("0")
        beats = [(message["x"], message["y"]) for message in self.said if message["do"] == "beat"]
        return beats[-1] if beats else (0, 0)

    @property
    def begun(self) -> int:
        self.page.evaluate("0")
        return sum(message["do"] == "begin" for message in self.said)


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    server = demo_server(tmp_path_factory.mktemp("gamepad"), PANEL)
    yield server
    server.end()


@pytest.fixture
def pad(own_page: Page, server: Server) -> Pad:
    return Pad(own_page, server)


def test_the_stick_moves_it_while_the_grip_key_is_held(pad: Pad) -> None:
    expect(pad.root.locator(".gamepad-known")).to_be_hidden()
    pad.plug()
    expect(pad.root.locator(".gamepad-known")).to_be_visible()
    pad.page.evaluate(MOVED)
    pad.page.evaluate(LOOKED)
    assert pad.begun == 0  # the stick alone moves nothing

    def moved_and_released(pad: Pad) -> str:
        pad.page.evaluate(MOVED)
        until(lambda: pad.deflection != (0, 0), "the deflection")
        x, y = pad.deflection
        assert x > 0
        assert y == pytest.approx(2 * x)  # within the circle
        pad.grip(False)
        return "released"

    pad.ended_by(moved_and_released)
    expect(pad.root).not_to_have_attribute("data-hold", "held")


def unplugged(pad: Pad) -> str:
    pad.page.evaluate("unplug()")
    return "gamepad"


def touched(pad: Pad) -> str:
    pad.page.mouse.click(5, 5)
    return "second"


def out_of_focus(pad: Pad) -> str:
    pad.page.evaluate("document.hasFocus = () => false; dispatchEvent(new Event('blur'))")
    return "blur"


def no_number(pad: Pad) -> str:
    pad.page.evaluate("gamepads[0].axes = [NaN, 0, 0, 0]")
    return "gamepad"


@pytest.mark.parametrize("end", [unplugged, touched, out_of_focus, no_number])
def test_what_ends_the_hold(pad: Pad, end: Callable[[Pad], str]) -> None:
    pad.ended_by(end)
    begun = pad.begun
    pad.page.evaluate(LOOKED)
    assert pad.begun == begun  # the grip key that is still down begins no other one


def test_a_grip_key_that_was_down_before_begins_nothing(pad: Pad) -> None:
    pad.plug()
    pad.page.evaluate("gamepads = []")
    pad.page.evaluate(LOOKED)
    pad.page.evaluate("plug('standard'); gamepads[0].buttons[4].pressed = true")
    pad.page.evaluate(LOOKED)
    assert pad.begun == 0
    pad.grip(False)
    pad.hold()
    assert pad.begun >= 1


def test_a_gamepad_whose_keys_are_not_known_moves_nothing(pad: Pad) -> None:
    pad.plug("")
    expect(pad.root.locator(".gamepad-unknown")).to_be_visible()
    pad.grip(True)
    assert pad.begun == 0
