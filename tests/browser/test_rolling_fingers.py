"""A stop button bears a finger that rolls off, opens nothing, and has a receipt of a few words."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_stop_in_browser import STOP, pressed, stop_server, stops
from tests.support.browser.finger import Touch
from tests.support.browser.pages import place
from tests.support.browser.touch import MM_PER_PX, touched
from tests.support.parts import Server


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with stop_server(tmp_path_factory.mktemp("stop")) as server:
        yield server


@pytest.fixture
def page(touchscreen: Page, cell: Server) -> Page:
    return touched(touchscreen, cell)


@pytest.mark.parametrize("way", ["finger", "mouse"])
@pytest.mark.parametrize(("beyond_mm", "presses"), [(1, 1), (7, 1), (10, 0)])
def test_a_finger_that_rolls_off_by_8_mm_presses_and_nothing_opens(
    page: Page, cell: Server, way: str, beyond_mm: float, presses: int
) -> None:
    before, stop = stops(cell), place(page.locator(STOP))
    x, y = stop["x"] + stop["width"] - 1, stop["y"] + stop["height"] / 2
    if way == "finger":
        touch = Touch(page)
        touch.send("touchStart", (x, y))
        touch.send("touchMove", (x + beyond_mm / MM_PER_PX, y))
        touch.send("touchEnd")
    else:
        page.mouse.move(x, y)
        page.mouse.down()
        page.mouse.move(x + beyond_mm / MM_PER_PX, y)
        page.mouse.up()
    expect(page.locator(f"{STOP}:not([aria-busy])")).to_be_attached()
    expect(page.locator(":popover-open")).to_have_count(0)
    if presses:
        pressed(cell, before)
    page.locator(STOP).tap()
    pressed(cell, before + presses)
    # A few words and the time, whole on the button, with nothing beside it that could be touched.
    receipt = page.locator("[data-widget=stop] .receipt")
    expect(receipt).to_have_text(re.compile(r"^Stop sent \d\d:\d\d:\d\d$"))
    assert receipt.evaluate("(text) => text.scrollHeight <= text.clientHeight + 1")
    expect(page.locator("[data-widget=stop] .more")).to_be_hidden()
