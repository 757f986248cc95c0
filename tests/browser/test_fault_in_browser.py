"""A fault of the shipped panel's cell, and its end by a finger on the screen."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browser.browsers import opened
from tests.support.browser.pages import place, widget
from tests.support.browser.touch import SIZES
from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.servers import ready


@pytest.fixture(scope="module")
def cell() -> Iterator[Server]:
    """The shipped panel, whose cell runs."""
    with ready(Server(ROOT, KIOSK_PANEL=str(SHIPPED))) as mine:
        yield mine


@pytest.fixture
def tab(chromium: Browser) -> Iterator[Page]:
    context = opened(chromium, has_touch=True)
    yield context.new_page()
    context.close()


def press(page: Page, name: str) -> None:
    """Touches a button as soon as it is free."""
    button = widget(page, name).locator("[type=submit]")
    expect(button).to_be_enabled()
    button.tap()


def test_a_visitor_clears_the_fault_of_an_open_door_by_the_screen(cell: Server, tab: Page) -> None:
    tab.goto(f"{cell.url}/pages/cell")
    checks, state = widget(tab, "checks"), widget(tab, "machine_state")
    expect(state).to_contain_text("RUNNING")
    expect(checks).to_have_attribute("data-shape", "met")
    expect(checks.locator(".all")).to_have_text("All conditions met")
    expect(checks.locator("li").first).to_be_hidden()

    press(tab, "door_open")
    expect(state).to_contain_text("FAULT")
    expect(checks).to_have_attribute("data-shape", "unmet")
    rows = checks.locator("li:visible")
    expect(rows.nth(0)).to_contain_text("Guard door closed")
    expect(rows.nth(0)).to_contain_text("not met")
    expect(rows.nth(1)).to_contain_text("No fault")
    expect(widget(tab, "start").locator("[type=submit]")).to_be_disabled()
    expect(widget(tab, "reset").locator("[type=submit]")).to_be_disabled()

    press(tab, "door_close")
    expect(rows.nth(0)).to_contain_text("No fault")
    press(tab, "reset")
    tab.get_by_role("dialog").locator(".yes").tap()
    expect(checks).to_have_attribute("data-shape", "met")
    press(tab, "start")
    expect(state).to_contain_text("RUNNING")


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_buttons_of_the_cell_are_whole_on_each_screen(
    cell: Server, tab: Page, width: int, height: int
) -> None:
    tab.set_viewport_size({"width": width, "height": height})
    tab.goto(f"{cell.url}/pages/cell")
    assert place(widget(tab, "plan").locator(".board"))["height"] > 40
    for name in ("plan", "pause"):
        box = place(widget(tab, name))
        assert box["y"] + box["height"] <= height
        assert box["x"] + box["width"] <= width
