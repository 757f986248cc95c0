"""Hold-to-run with a finger on Debian's Chromium and a real node behind the real bridge.

For each way in which a hold can end: it ends, for that reason, with one last message and none after.
"""

import os
import re
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Error, Page, expect

from tests.support.parts import (
    CHROMIUM,
    CHROMIUM_FLAGS,
    Bridge,
    RosNode,
    Server,
    free_port,
    has_heard,
    live,
    until,
)

pytestmark = pytest.mark.real_time

PANEL: Final = """
title = "Jog"
[[interlock]]
id = "operation"
topic = "/operation_enabled"
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "speed"
kind = "slider"
label = "Speed"
min = 0
max = 1
step = 0.1
default = 0.5
[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/jog"
type = "geometry_msgs/msg/Point"
message = { x = "{speed}", y = 0, z = 0 }
release = { x = 0, y = 0, z = 0 }
rate_hz = 50
interlock = "operation"
"""
TOPIC: Final = "/jog"
TRIES: Final = 5  # on a machine that stands still a hold ends, as it should, before its test does
SOON_S: Final = 2.0
QUIET_S: Final = 0.4  # longer than a lease: what comes after it would show
ENDED: Final = re.compile(r"hold \w+ of jog by .* ended after .* \((\w+)\): (.*)")

# A stream that a test can break, and a page that a test can hide.
BREAKABLE: Final = """
    window.EventSource = class extends EventSource {
      constructor(url) { super(url); window.stream = this; }
    };
"""
HIDE: Final = """() => {
    Object.defineProperty(document, "hidden", { value: true, configurable: true });
    document.dispatchEvent(new Event("visibilitychange"));
}"""


@pytest.fixture(scope="module")
def jogger(node: RosNode) -> Iterator[RosNode]:
    """The robot's node: it listens, and says whether operation is permitted."""
    node.subscribe(TOPIC, "geometry_msgs/msg/Point", depth=1000)
    node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    yield node
    node.withdraw("/operation_enabled")


@pytest.fixture(scope="module")
def running(
    bridge: Bridge, jogger: RosNode, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[], Server]]:
    """Gives the kiosk of this file, and another one where a test ended that."""
    servers: list[Server] = []

    def one() -> Server:
        if not servers or not servers[-1].process.running:
            servers.append(jogging(bridge, jogger, tmp_path_factory.mktemp("jog")))
        return servers[-1]

    yield one
    for server in servers:
        server.end()


@pytest.fixture
def kiosk(running: Callable[[], Server], jogger: RosNode) -> Server:
    mine = running()
    permit(mine, jogger, True)
    return mine


def jogging(bridge: Bridge, node: RosNode, folder: Path, app: str = "app.main:app") -> Server:
    """A server whose robot permits."""
    panel = folder / "jog.toml"
    panel.write_text(PANEL)
    mine = live(bridge.endpoint, folder, app=app, KIOSK_PANEL=str(panel))
    until(mine.ready, "ready")
    permit(mine, node, True)
    return mine


def permit(server: Server, node: RosNode, permitted: bool) -> None:
    def says() -> bool:
        node.publish("/operation_enabled", {"data": permitted})
        return bool(server.widget("jog")["enabled"]) is permitted

    until(says, f"permitted: {permitted}", every_s=0.2)


@pytest.fixture
def touched(chromium: Browser, kiosk: Server) -> Iterator["Finger"]:
    context = chromium.new_context(viewport={"width": 1280, "height": 800}, has_touch=True)
    context.set_default_timeout(10_000)
    yield Finger(context.new_page(), kiosk)
    context.close()


class Finger:
    """A page with the hold, and a finger on its screen."""

    def __init__(self, page: Page, server: Server) -> None:
        self.page = page
        self.server = server
        self._touches = False
        self._touch = page.context.new_cdp_session(page)
        self.button = page.get_by_role("button", name="Jog")
        page.add_init_script(BREAKABLE)
        self.opens()

    def opens(self) -> None:
        """The page again: a cause that was tried before, like a hidden page, is over."""
        self.up()
        self.page.goto(self.server.url)
        expect(self.button).to_be_enabled()
        box = self.button.bounding_box()
        assert box is not None
        self.x, self.y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2

    def _send(self, kind: str, *points: tuple[float, float]) -> None:
        touches = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)]
        self._touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})

    def down(self) -> None:
        self._send("touchStart", (self.x, self.y))
        self._touches = True

    def up(self) -> None:
        if self._touches:
            self._touches = False
            self._send("touchEnd")

    def cancel(self) -> None:
        self._touches = False
        self._send("touchCancel")

    def slide_off(self) -> None:
        self._send("touchMove", (self.x, self.y + 300))

    def second(self) -> None:
        self._send("touchStart", (self.x, self.y), (5, 5))

    def does(self, script: str) -> None:
        self.page.evaluate(script)

    @property
    def state(self) -> str | None:
        return self.page.locator('[data-widget="jog"]').get_attribute("data-hold")


@dataclass(frozen=True, slots=True)
class Times:
    """Seconds from the cause to the last message that moves, and to the one that stops."""

    last: float
    stop: float


def ended(server: Server) -> list[tuple[str, str]]:
    """(code, sentence) of every end that the log tells."""
    found = map(ENDED.search, list(server.process.lines))
    return [(one[1], one[2]) for one in found if one]


def has_ended(server: Server, ends: int) -> bool:
    return len(ended(server)) > ends


def begun(finger: Finger, node: RosNode) -> tuple[int, int]:
    """Holds until it moves: how much was heard before that, and how many holds had ended."""
    for _ in range(TRIES):
        before, ends = len(node.heard(TOPIC)), len(ended(finger.server))
        finger.down()
        with suppress(AssertionError):
            until(partial(has_heard, node, TOPIC, before + 5), "it moves", within_s=3)
            return before, ends
        finger.up()
    raise AssertionError(f"it never moved: {finger.server.process.text}")


def measured(
    finger: Finger, node: RosNode, cause: Callable[[], Any], code: str, lift: bool = True
) -> Times:
    """Holds, lets the cause happen, and gives the times, if that is what ended the hold."""
    for attempt in range(TRIES):
        if attempt:
            finger.opens()
        before, ends = begun(finger, node)
        began = time.monotonic()
        cause()
        until(partial(has_ended, finger.server, ends), "it ends")
        time.sleep(QUIET_S)
        if lift:
            finger.up()
        found = ended(finger.server)[ends:]
        if [one for one, _ in found] == [code]:
            return times(node, before, began)
    raise AssertionError(f"it ended otherwise: {found}")


def times(node: RosNode, before: int, began: float) -> Times:
    """The times of one hold, after checking that it is moves and then one stop."""
    xs = [point["x"] for point in node.heard(TOPIC)[before:]]
    at = node.heard_at(TOPIC)[before:]
    assert xs == [0.5] * (len(xs) - 1) + [0.0]
    return Times(at[-2] - began, at[-1] - began)


def soon(cause: str, found: Times) -> None:
    assert found.last < SOON_S, cause
    assert found.stop < SOON_S, cause


TOUCHES: Final = {
    "released": ("up", "hold_released"),
    "pointer cancelled": ("cancel", "hold_by_cancel"),
    "slid off": ("slide_off", "hold_by_sliding"),
    "second finger": ("second", "hold_by_second"),
}
SCRIPTS: Final = {
    "window blurred": ("() => window.dispatchEvent(new Event('blur'))", "hold_by_blur"),
    "page hidden": (HIDE, "hold_by_hiding"),
    "page left": ("() => window.dispatchEvent(new Event('pagehide'))", "hold_by_leaving"),
    "stream lost": ("() => window.stream.dispatchEvent(new Event('error'))", "hold_by_lock"),
    "menu": (
        "() => document.querySelector('.hold').dispatchEvent("
        "new MouseEvent('contextmenu', { bubbles: true, cancelable: true }))",
        "hold_by_menu",
    ),
    "Escape": (
        "() => window.dispatchEvent(new KeyboardEvent('keydown', { key: 'Escape' }))",
        "hold_by_escape",
    ),
}


@pytest.mark.parametrize("cause", TOUCHES)
def test_a_finger_that_goes_ends_it(touched: Finger, jogger: RosNode, cause: str) -> None:
    name, code = TOUCHES[cause]
    soon(cause, measured(touched, jogger, getattr(touched, name), code))
    assert touched.state is None
    sentence = "Released at" if code == "hold_released" else "Release and press again."
    expect(touched.page.locator("#receipt-jog")).to_contain_text(sentence)


@pytest.mark.parametrize("cause", SCRIPTS)
def test_a_page_that_goes_ends_it(touched: Finger, jogger: RosNode, cause: str) -> None:
    script, code = SCRIPTS[cause]
    soon(cause, measured(touched, jogger, partial(touched.does, script), code))
    assert touched.state is None


def test_lost_permission_ends_it_and_only_a_new_press_begins_again(
    touched: Finger, jogger: RosNode
) -> None:
    def forbid() -> None:
        jogger.publish("/operation_enabled", {"data": False})

    def allow_after() -> None:
        permit(touched.server, jogger, True)

    found = measured(touched, jogger, forbid, "forbidden", lift=False)
    soon("permission lost", found)
    expect(touched.page.locator("#receipt-jog")).to_contain_text("does not permit operation")
    heard = len(jogger.heard(TOPIC))
    allow_after()
    expect(touched.button).to_be_enabled()
    time.sleep(QUIET_S)
    assert len(jogger.heard(TOPIC)) == heard  # the finger still rests on it
    touched.up()
    touched.down()
    until(lambda: len(jogger.heard(TOPIC)) > heard, "a new press begins again")
    touched.up()


@contextmanager
def own_chromium(chromium: Browser, folder: Path) -> Iterator[tuple[Browser, int]]:
    """A browser of the test's own, in a process group of its own: (browser, its group)."""
    port = free_port()
    process = subprocess.Popen(
        [CHROMIUM, *CHROMIUM_FLAGS, "--headless=new", f"--remote-debugging-port={port}",
         f"--user-data-dir={folder / 'profile'}", "about:blank"],
        start_new_session=True, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
    )  # fmt: skip
    try:

        def connect() -> Browser | None:
            try:
                return chromium.browser_type.connect_over_cdp(f"http://127.0.0.1:{port}")
            except Error:  # it does not listen yet
                return None

        yield until(connect, "the browser listens", every_s=0.2), process.pid
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.mark.parametrize(
    ("cause", "number", "code"),
    [
        ("browser frozen", signal.SIGSTOP, "hold_by_heartbeat"),
        ("browser killed", signal.SIGKILL, "hold_by_closing"),
    ],
)
def test_a_browser_that_goes_ends_it(
    chromium: Browser,
    kiosk: Server,
    jogger: RosNode,
    tmp_path: Path,
    cause: str,
    number: signal.Signals,
    code: str,
) -> None:
    for attempt in range(TRIES):
        folder = tmp_path / str(attempt)
        with own_chromium(chromium, folder) as (browser, group):
            finger = Finger(browser.new_context(has_touch=True).new_page(), kiosk)
            before, ends = begun(finger, jogger)
            began = time.monotonic()
            os.killpg(group, number)
            until(partial(has_ended, kiosk, ends), "it ends")
            time.sleep(QUIET_S)
        if [one for one, _ in ended(kiosk)[ends:]] == [code]:
            soon(cause, times(jogger, before, began))
            return
    raise AssertionError(f"it ended otherwise: {ended(kiosk)}")


def test_the_servers_end_stops_the_robot_first(touched: Finger, jogger: RosNode) -> None:
    before, ends = begun(touched, jogger)
    began = time.monotonic()
    touched.server.process.send(signal.SIGTERM)
    touched.server.process.wait(10)
    time.sleep(QUIET_S)
    soon("server ended", times(jogger, before, began))
    assert [code for code, _ in ended(touched.server)[ends:]] == ["hold_by_stopping"]
    expect(touched.page.locator("#receipt-jog")).to_contain_text("the panel server is shutting down")
    expect(touched.button).to_be_disabled()
    assert touched.state is None


def test_from_a_killed_server_nothing_more_comes(touched: Finger, jogger: RosNode) -> None:
    """The robot's own deadline has to act: no one is left to say stop."""
    before, _ = begun(touched, jogger)
    began = time.monotonic()
    touched.server.process.kill()
    time.sleep(QUIET_S)
    heard, at = jogger.heard(TOPIC)[before:], jogger.heard_at(TOPIC)[before:]
    assert {point["x"] for point in heard} == {0.5}
    assert at[-1] - began < SOON_S
    expect(touched.page.locator("#receipt-jog")).to_contain_text("was lost while this was held")
    expect(touched.button).to_be_disabled()


def test_a_long_touch_is_held_as_long_as_it_is_and_shows_it(touched: Finger, jogger: RosNode) -> None:
    """Longer than browsers take to see a long touch, with its menu and selection."""
    for _ in range(TRIES):
        ends = len(ended(touched.server))
        touched.down()
        touched.page.wait_for_timeout(1500)
        state, pressed = touched.state, touched.button.get_attribute("aria-pressed")
        colour = touched.button.evaluate("(button) => getComputedStyle(button).backgroundColor")
        touched.up()
        until(partial(has_ended, touched.server, ends), "it ends")
        if ended(touched.server)[ends][0] == "hold_released":
            break
    assert (state, pressed, colour) == ("held", "true", "rgb(18, 23, 27)")
    assert touched.page.evaluate("() => getSelection().toString()") == ""
    expect(touched.page.locator("#receipt-jog")).to_contain_text(
        re.compile(r"after 1\.[4-9] s|after 2")
    )
