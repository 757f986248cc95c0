"""A fault of the shipped panel's cell, and its end by a finger on the screen."""

import re
from collections.abc import Iterator

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.support.browser.browsers import opened
from tests.support.browser.pages import place, widget
from tests.support.browser.touch import SIZES
from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.servers import ready

pytestmark = pytest.mark.long("detail")


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


def switch(page: Page, name: str, position: str) -> None:
    """Touches a position of a switch, which moves when the robot reports it."""
    key = widget(page, name).locator(f"[data-position={position}]")
    expect(widget(page, name).locator("[aria-busy]")).to_have_count(0)  # so soon it is the same press
    expect(key).to_be_enabled()
    key.tap()
    expect(widget(page, name)).to_have_attribute("data-at", position)


def states(steps: Locator) -> list[str | None]:
    return [row.get_attribute("data-now") for row in steps.locator("li:visible").all()]


def test_a_visitor_clears_the_fault_of_an_open_door_by_the_steps_on_the_screen(
    cell: Server, tab: Page
) -> None:
    tab.goto(f"{cell.url}/pages/cell")
    steps, state = widget(tab, "steps"), widget(tab, "machine_state")
    heading, far = steps.get_by_role("heading"), steps.locator(".far")
    expect(state).to_contain_text("RUNNING")
    expect(heading).to_have_text("Cycle")
    expect(far).to_have_text(re.compile(r"step [1-5] of 5"))

    switch(tab, "door", "off")
    expect(state).to_contain_text("FAULT")
    expect(heading).to_have_text("How to go on")
    expect(far).to_have_text("step 1 of 4")
    rows = steps.locator("li")
    for number, text in enumerate(("no one is in the cell", "Close", "Touch Reset", "Touch Start")):
        expect(rows.nth(number)).to_contain_text(text)
    assert states(steps) == ["now", "now", "next", "next"]
    for name in ("start", "reset"):
        expect(widget(tab, name).locator("[type=submit]")).to_be_disabled()

    switch(tab, "door", "on")
    expect(far).to_have_text("step 3 of 4")
    assert states(steps) == ["past", "done", "now", "next"]
    press(tab, "reset")
    tab.get_by_role("dialog").locator(".yes").tap()
    expect(far).to_have_text("step 4 of 4")
    assert states(steps) == ["past", "done", "done", "now"]
    press(tab, "start")
    expect(heading).to_have_text("Cycle")
    expect(state).to_contain_text("RUNNING")


def test_the_work_light_is_on_when_the_robot_says_so(cell: Server, tab: Page) -> None:
    tab.goto(f"{cell.url}/pages/cell")
    switch(tab, "light", "on")
    assert cell.widget("light")["at"] == "on"
    switch(tab, "light", "off")
    assert cell.widget("light")["at"] == "off"


def test_the_air_is_drawn_at_once_and_goes_on(cell: Server, tab: Page) -> None:
    """By the server in the page; its script comes when the page is at rest."""
    scripts: list[str] = []
    tab.on("request", lambda request: scripts.append(request.url))
    tab.goto(f"{cell.url}/pages/cell")
    line = widget(tab, "air_trend").locator("svg .line.pen-0").last
    expect(line).to_have_attribute("d", re.compile("M"))
    expect(widget(tab, "light").locator("[data-position=on]")).to_be_enabled()
    assert not [url for url in scripts if url.endswith("/kinds/trend.js")]
    drawn = line.get_attribute("d")
    expect(line).not_to_have_attribute("d", drawn or "", timeout=20_000)


def test_progress_that_is_not_known_is_not_nothing(cell: Server, tab: Page) -> None:
    tab.goto(f"{cell.url}/pages/cell")
    bar = widget(tab, "pallet").locator("progress")
    image = "(bar) => getComputedStyle(bar).backgroundImage"
    assert "repeating-linear-gradient" in bar.evaluate(image)
    # In one step: the next update of the robot shows again that it is not known.
    at_zero = "(bar) => { bar.value = 0; return getComputedStyle(bar).backgroundImage; }"
    assert bar.evaluate(at_zero) == "none"


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_the_buttons_of_the_cell_are_whole_on_each_screen(
    cell: Server, tab: Page, width: int, height: int
) -> None:
    tab.set_viewport_size({"width": width, "height": height})
    tab.goto(f"{cell.url}/pages/cell")
    assert place(widget(tab, "plan").locator(".board"))["height"] > 40
    expect(widget(tab, "stop")).to_be_visible()
    for name in ("plan", "pause"):
        box = place(widget(tab, name))
        assert box["y"] + box["height"] <= height
        assert box["x"] + box["width"] <= width
