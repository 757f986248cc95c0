"""A hold ends when the page changes under the finger, which stays where it is."""

from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.browsers import sized
from tests.support.browser.finger import Touch
from tests.support.browser.pages import middle
from tests.support.browser.touch import loaded
from tests.support.holds import PATIENT, TRIES, codes, has_ended
from tests.support.parts import Server, until
from tests.support.servers import demo_server

pytestmark = pytest.mark.promise("hold")

PANEL: Final = """
title = "Jog"
mode = "demo"
[[interlock]]
id = "operation"
topic = "/operation_enabled"
type = "std_msgs/msg/Bool"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/operation1"
type = "std_msgs/msg/String"
message = { data = "left" }
release = { data = "stopped" }
interlock = "operation"

[[page.widget]]
id = "drive"
kind = "joystick"
label = "Drive"
topic = "/stick"
type = "geometry_msgs/msg/Twist"
interlock = "operation"
y_axis = { max = 0.5, unit = "m/s" }
"""


def turned(page: Page, _: str) -> None:
    page.set_viewport_size({"width": 800, "height": 1280})


def lowered(page: Page, _: str) -> None:
    """As by the keyboard of a tablet."""
    page.set_viewport_size({"width": 1280, "height": 600})


def scripted(script: str) -> Callable[[Page, str], None]:
    """A change by a script, of the widget's root."""
    return lambda page, widget: page.locator(f"[data-widget={widget}]").evaluate(script)


CHANGES: Final[dict[str, Callable[[Page, str], None]]] = {
    "the window is turned": turned,
    "the window gets lower": lowered,
    "the widget is not displayed": scripted("(root) => (root.style.display = 'none')"),
    "the page is not displayed": scripted("(root) => (root.closest('main').hidden = true)"),
    "the widget is taken away": scripted("(root) => root.remove()"),
    "something comes above it": scripted(
        "(root) => root.closest('main').prepend(Object.assign(document.createElement('p'),"
        " { style: 'height: 60px' }))"
    ),
    "it is moved": scripted("(root) => (root.style.translate = '0 40px')"),
    "it is covered": scripted(
        "() => document.body.append(Object.assign(document.createElement('div'),"
        " { style: 'position: fixed; inset: 0; z-index: 99' }))"
    ),
}


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("jog"), PANEL, app=PATIENT) as server:
        until(lambda: server.widget("jog")["enabled"], "the robot permits")
        yield server


@pytest.mark.long("table")
@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("widget", ["jog", "drive"])
def test_a_change_of_the_page_under_the_finger_ends_the_hold(
    touchscreen: Page, cell: Server, widget: str, change: str
) -> None:
    ends = held(touchscreen, cell, widget)
    CHANGES[change](touchscreen, widget)
    until(partial(has_ended, cell, ends), "it ends")
    assert codes(cell, ends) == ["hold_by_moved_button"]


def held(page: Page, cell: Server, widget: str) -> int:
    """How many holds had ended before the one that the page shows as held."""
    for _ in range(TRIES):
        loaded(sized(page, 1280, 800), cell)
        surface = page.locator(f"[data-widget={widget}] .hold")
        expect(surface).to_be_enabled()
        ends, touch = len(codes(cell)), Touch(page)
        touch.send("touchStart", middle(surface))
        with suppress(AssertionError):
            expect(page.locator(f"[data-widget={widget}][data-hold=held]")).to_be_attached(timeout=3000)
            return ends
        touch.send("touchEnd")
    raise AssertionError("it is never held")
