"""With a finger that rests on the glass every other finger presses what it touches, as Stop does."""

from collections.abc import Callable, Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_fast_keys import PANEL, presses
from tests.support.browser.browsers import sized
from tests.support.browser.finger import Touch
from tests.support.browser.pages import middle
from tests.support.browser.touch import loaded
from tests.support.parts import Server, until
from tests.support.servers import demo_server

RESTS: Final = (1270.0, 790.0)
# What the second finger touches, and how the page shows that it did.
TOUCHED: Final[dict[str, tuple[str, Callable[[Page], None]]]] = {
    "a press": (
        "[data-widget=go] > button",
        lambda page: expect(page.locator("[data-widget=go] .receipt")).not_to_be_empty(),
    ),
    "a press that asks": (
        "[data-widget=asked] > button",
        lambda page: expect(page.locator("dialog.ask:popover-open")).to_be_visible(),
    ),
    "a hold": (
        "[data-widget=jog] .hold",
        lambda page: expect(page.locator("[data-widget=jog][data-hold]")).to_be_attached(),
    ),
    "a joystick": (
        "[data-widget=drive] .hold",
        lambda page: expect(page.locator("[data-widget=drive][data-hold]")).to_be_attached(),
    ),
    "a toggle": (
        "#input-light",
        lambda page: expect(page.locator("#input-light")).to_be_checked(),
    ),
    "a step": (
        "[data-widget=speed] button.step >> nth=1",
        lambda page: expect(page.locator("[data-widget=speed] input")).to_have_value("6"),
    ),
    "a number": (
        "[data-widget=speed] input",
        lambda page: expect(page.locator(".keypad")).to_be_visible(),
    ),
    "the menu": (".menu-key", lambda page: expect(page.locator("#menu")).to_be_visible()),
    "a tab": (
        "nav.pages a >> nth=1",
        lambda page: expect(page.get_by_role("heading", name="Asks")).to_be_visible(),
    ),
}


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL) as server:
        server.http.post("/widgets/stop", json={"inputs": {}})
        until(lambda: server.widget("jog")["enabled"], "the robot permits")
        yield server


@pytest.fixture
def page(touchscreen: Page, cell: Server) -> Page:
    return loaded(sized(touchscreen, 1280, 800), cell, "/pages/plain")


@pytest.mark.parametrize("name", TOUCHED)
def test_a_second_finger_acts(page: Page, name: str) -> None:
    selector, shown = TOUCHED[name]
    touch, point = Touch(page), middle(page.locator(selector))
    touch.send("touchStart", RESTS)
    touch.send("touchStart", RESTS, point)
    if ".hold" not in selector:
        touch.lift(1, point)
    shown(page)
    expect(page.locator("[data-down]:not(.hold)")).to_have_count(0)


def test_two_fingers_on_two_buttons_press_both_once(page: Page, cell: Server) -> None:
    touch, sent = Touch(page), presses(cell)
    go, stop = (middle(page.locator(f"[data-widget={name}] > button")) for name in ("go", "stop"))
    touch.send("touchStart", go)
    touch.send("touchStart", go, stop)
    touch.lift(0, go)
    touch.lift(1, stop)
    until(lambda: presses(cell) >= sent + 2, "both are pressed")
    page.wait_for_timeout(600)
    assert presses(cell) == sent + 2


def test_a_finger_whose_touch_is_taken_away_says_why(page: Page, cell: Server) -> None:
    touch, sent = Touch(page), presses(cell)
    touch.send("touchStart", RESTS)
    touch.send("touchStart", RESTS, middle(page.locator("[data-widget=go] > button")))
    touch.send("touchCancel")
    expect(page.locator(".page-report")).to_have_text("Lift the other finger, then touch again.")
    assert presses(cell) == sent
