"""A finger that holds a control on a touch screen, and each way in which its page can go away."""

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, Final

from playwright.sync_api import Browser, Error, Locator, Page, expect

from tests.support.browser.pages import HIDE, middle
from tests.support.holds import QUIET_S, TOPIC, TRIES, codes, has_ended
from tests.support.parts import (
    CHROMIUM,
    CHROMIUM_FLAGS,
    RosNode,
    Server,
    free_port,
    has_heard,
    until,
)

# A stream that a test can break.
BREAKABLE: Final = """
    window.EventSource = class extends EventSource {
      constructor(url) { super(url); window.stream = this; }
    };
"""
# How a page can go: the script, and the code of the end.
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
# Whether the script of a hold listens to its button: it lets no touch open a menu.
LISTENS: Final = """
    (button) => !button.dispatchEvent(new Event("touchstart", { cancelable: true }))
"""


class Touch:
    """Touches on the screen of a page, as its browser receives them."""

    def __init__(self, page: Page) -> None:
        self._session = page.context.new_cdp_session(page)

    def send(self, kind: str, *points: tuple[float, float]) -> None:
        """Sends an event, such as "touchStart", with all fingers that are on the screen."""
        touches = [{"x": x, "y": y, "id": n} for n, (x, y) in enumerate(points)]
        self._session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": touches})

    def lift(self, number: int, point: tuple[float, float]) -> None:
        """Lifts one of several fingers, which is at `point`; the others stay."""
        x, y = point
        touches = [{"x": x, "y": y, "id": number}]
        self._session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": touches})


class Finger:
    """A page with a hold, and a finger on its screen. `surface` is what the finger touches."""

    def __init__(
        self,
        page: Page,
        server: Server,
        button: Locator | None = None,
        surface: Locator | None = None,
    ) -> None:
        self.page = page
        self.server = server
        self.touch = Touch(page)
        self.button = button or page.get_by_role("button", name="Jog")
        self._surface = surface or self.button
        self._touches = False
        page.add_init_script(BREAKABLE)
        self.opens()

    def opens(self) -> None:
        """Opens the page again, to undo an earlier cause, such as a hidden page."""
        self.up()
        self.page.goto(self.server.url)
        expect(self.button).to_be_enabled()
        until(lambda: self.button.evaluate(LISTENS), "the script of the hold is there")
        self._surface.scroll_into_view_if_needed()
        self.x, self.y = middle(self._surface)

    def down(self) -> None:
        self.touch.send("touchStart", (self.x, self.y))
        self._touches = True

    def hold(self) -> None:
        """Makes the robot move."""
        self.down()

    def up(self) -> None:
        if self._touches:
            self._touches = False
            self.touch.send("touchEnd")

    def cancel(self) -> None:
        self._touches = False
        self.touch.send("touchCancel")

    def slide_off(self) -> None:
        self.touch.send("touchMove", (self.x, self.y + 300))

    def second(self) -> None:
        self.touch.send("touchStart", (self.x, self.y), (5, 5))

    def does(self, script: str) -> None:
        self.page.evaluate(script)

    @property
    def state(self) -> str | None:
        return self.page.locator('[data-widget="jog"]').get_attribute("data-hold")


def jogged(finger: Finger, node: RosNode) -> tuple[int, int]:
    """Holds until the robot jogs, as `begun`."""
    return begun(finger, node, TOPIC, lambda node, before: has_heard(node, TOPIC, before + 5))


def begun(
    finger: Finger, node: RosNode, topic: str, moves: Callable[[RosNode, int], bool]
) -> tuple[int, int]:
    """Holds until the robot moves. Returns how much was received before, and how many holds ended."""
    for _ in range(TRIES):
        before, ends = len(node.heard(topic)), len(codes(finger.server))
        finger.hold()
        with suppress(AssertionError):
            until(partial(moves, node, before), "it moves", within_s=3)
            return before, ends
        finger.up()
    raise AssertionError(f"it never moved: {finger.server.process.text}")


def ended_by(
    finger: Finger,
    begin: Callable[[], tuple[int, int]],
    cause: Callable[[], Any],
    code: str,
    lift: bool = True,
    stopped: Callable[[], bool] = lambda: True,
) -> tuple[int, float]:
    """Holds and triggers the cause, until this cause ended the hold. Returns how much was received
    before that hold, and when (`time.monotonic`) the cause began."""
    for attempt in range(TRIES):
        if attempt:
            finger.opens()
        before, ends = begin()
        began = time.monotonic()
        cause()
        until(partial(has_ended, finger.server, ends), "it ends")
        until(stopped, "it stops")
        time.sleep(QUIET_S)
        if lift:
            finger.up()
        if codes(finger.server, ends) == [code]:
            return before, began
    raise AssertionError(f"it ended otherwise: {codes(finger.server, ends)}")


@contextmanager
def own_chromium(chromium: Browser, folder: Path) -> Iterator[tuple[Browser, int]]:
    """A browser for one test, in a separate process group: (browser, its group)."""
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
