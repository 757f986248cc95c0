"""Hold-to-run with a finger on Debian's Chromium and a real node behind the real bridge.

For each way in which a hold can end: it ends, for that reason, with one last message and none after.
"""

import os
import re
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, expect

from tests.support.browser.finger import SCRIPTS, Finger, ended_by, jogged, own_chromium
from tests.support.holds import (
    QUIET_S,
    TOPIC,
    TRIES,
    codes,
    ended,
    has_ended,
    jogging,
    permit,
)
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import kept_running

pytestmark = [pytest.mark.long("real time"), pytest.mark.promise("hold")]

SOON_S: Final = 2.0


@pytest.fixture(scope="module")
def running(
    bridge: Bridge, jogger: RosNode, tmp_path_factory: pytest.TempPathFactory
) -> Iterator[Callable[[], Server]]:
    """Gives the kiosk of this file, and another one where a test ended that."""
    with kept_running(lambda: jogging(bridge, jogger, tmp_path_factory.mktemp("jog"))) as running:
        yield running


@pytest.fixture
def kiosk(running: Callable[[], Server], jogger: RosNode) -> Server:
    mine = running()
    permit(mine, jogger, True)
    return mine


@dataclass(frozen=True, slots=True)
class Times:
    """Seconds from the cause to the last message that moves, and to the one that stops."""

    last: float
    stop: float


def measured(
    finger: Finger, node: RosNode, cause: Callable[[], Any], code: str, lift: bool = True
) -> Times:
    """Holds, lets the cause happen, and gives the times, if that is what ended the hold."""
    return times(node, *ended_by(finger, partial(jogged, finger, node), cause, code, lift))


def times(node: RosNode, before: int, began: float) -> Times:
    """The times of one hold, after checking that it is moves and then one stop."""
    xs = [point["x"] for point in node.heard(TOPIC)[before:]]
    at = node.heard_at(TOPIC)[before:]
    assert xs == [0.5] * (len(xs) - 1) + [0.0]
    return Times(at[-2] - began, at[-1] - began)


def soon(cause: str, times: Times) -> None:
    assert times.last < SOON_S, cause
    assert times.stop < SOON_S, cause


TOUCHES: Final = {
    "released": ("up", "hold_released"),
    "pointer cancelled": ("cancel", "hold_by_cancel"),
    "slid off": ("slide_off", "hold_by_sliding"),
    "second finger": ("second", "hold_by_second_finger"),
}


@pytest.mark.parametrize("cause", TOUCHES)
def test_lifted_finger_ends_the_hold(finger: Finger, jogger: RosNode, cause: str) -> None:
    name, code = TOUCHES[cause]
    soon(cause, measured(finger, jogger, getattr(finger, name), code))
    assert finger.state is None
    sentence = "Released at" if code == "hold_released" else "Release and press again."
    expect(finger.page.locator("#receipt-jog")).to_contain_text(sentence)


@pytest.mark.parametrize("cause", SCRIPTS)
def test_closed_page_ends_the_hold(finger: Finger, jogger: RosNode, cause: str) -> None:
    script, code = SCRIPTS[cause]
    soon(cause, measured(finger, jogger, partial(finger.does, script), code))
    assert finger.state is None


def test_lost_permission_ends_the_hold_until_a_new_press(finger: Finger, jogger: RosNode) -> None:
    def forbid() -> None:
        jogger.publish("/operation_enabled", {"data": False})

    def allow_after() -> None:
        permit(finger.server, jogger, True)

    times = measured(finger, jogger, forbid, "interlock_not_permitted", lift=False)
    soon("permission lost", times)
    expect(finger.page.locator("#receipt-jog")).to_contain_text("does not permit operation")
    heard = len(jogger.heard(TOPIC))
    allow_after()
    expect(finger.button).to_be_enabled()
    time.sleep(QUIET_S)
    assert len(jogger.heard(TOPIC)) == heard  # the finger still rests on it
    finger.up()
    finger.down()
    until(lambda: len(jogger.heard(TOPIC)) > heard, "a new press begins again")
    finger.up()


@pytest.mark.parametrize(
    ("cause", "number", "code"),
    [
        ("browser frozen", signal.SIGSTOP, "hold_by_heartbeat"),
        ("browser killed", signal.SIGKILL, "hold_by_closing"),
    ],
)
def test_closed_browser_ends_the_hold(
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
            before, ends = jogged(finger, jogger)
            began = time.monotonic()
            os.killpg(group, number)
            until(partial(has_ended, kiosk, ends), "it ends")
            time.sleep(QUIET_S)
        if codes(kiosk, ends) == [code]:
            soon(cause, times(jogger, before, began))
            return
    raise AssertionError(f"it ended otherwise: {ended(kiosk)}")


def test_the_servers_end_stops_the_robot_first(finger: Finger, jogger: RosNode) -> None:
    before, ends = jogged(finger, jogger)
    began = time.monotonic()
    finger.server.process.send(signal.SIGTERM)
    finger.server.process.wait(10)
    time.sleep(QUIET_S)
    soon("server ended", times(jogger, before, began))
    assert codes(finger.server, ends) == ["hold_by_shutdown"]
    expect(finger.page.locator("#receipt-jog")).to_contain_text("the panel server is shutting down")
    expect(finger.button).to_be_disabled()
    assert finger.state is None


def test_from_a_killed_server_nothing_more_comes(finger: Finger, jogger: RosNode) -> None:
    """The robot's own deadline has to act: no one is left to say stop."""
    before, _ = jogged(finger, jogger)
    began = time.monotonic()
    finger.server.process.kill()
    time.sleep(QUIET_S)
    heard, at = jogger.heard(TOPIC)[before:], jogger.heard_at(TOPIC)[before:]
    assert {point["x"] for point in heard} == {0.5}
    assert at[-1] - began < SOON_S
    expect(finger.page.locator("#receipt-jog")).to_contain_text("was lost while this was held")
    expect(finger.button).to_be_disabled()


def test_long_touch_holds_and_shows_its_duration(finger: Finger, jogger: RosNode) -> None:
    """Longer than browsers take to see a long touch, with its menu and selection."""
    for _ in range(TRIES):
        ends = len(codes(finger.server))
        finger.down()
        finger.page.wait_for_timeout(1500)
        state, pressed = finger.state, finger.button.get_attribute("aria-pressed")
        seconds = finger.page.locator(".held-for").inner_text()
        colour = finger.button.evaluate("(button) => getComputedStyle(button).backgroundColor")
        finger.up()
        until(partial(has_ended, finger.server, ends), "it ends")
        if codes(finger.server)[ends] == "hold_released":
            break
    assert (state, pressed, colour) == ("held", "true", "rgb(18, 23, 27)")
    assert re.fullmatch(r"[1-9]\.[05] s", seconds), seconds
    expect(finger.page.locator(".held-for")).to_be_empty()
    assert finger.page.evaluate("() => getSelection().toString()") == ""
    expect(finger.page.locator("#receipt-jog")).to_contain_text(re.compile(r"after 1\.[4-9] s|after 2"))
