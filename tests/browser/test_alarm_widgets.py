"""Alarms of a group on a page: a list and a line, whose buttons act as those of the frame."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.browser.test_accessibility import violations
from tests.browser.test_alarm_line import CONTROL, SIZES, started
from tests.support.browser.browsers import sized
from tests.support.browser.finger import Touch
from tests.support.browser.pages import DRAWN, HIDE, follow, middle, place
from tests.support.parts import ENOUGH_S, TAP_AGAIN_MS, Server, until
from tests.support.servers import demo_server
from tests.web.test_alarms import LOW, PANEL, act, listed

pytestmark = pytest.mark.long("detail")


WIDGETS: Final = """
[[page.widget]]
id = "air_list"
kind = "alarm_list"
label = "Alarms of the air"
group = "Air"
span = 6
[[page.widget]]
id = "all_list"
kind = "alarm_list"
label = "All alarms"
span = 6
lines = 1
[[page.widget]]
id = "air_line"
kind = "alarm_line"
label = "Newest alarm of the air"
group = "Air"
[[page.widget]]
id = "high_line"
kind = "alarm_line"
label = "Newest high alarm"
priorities = [1]
[demo]
"""
AIR_LIST: Final = '[data-widget="air_list"]'
ALL_LIST: Final = '[data-widget="all_list"]'
AIR_LINE: Final = '[data-widget="air_line"]'
HIGH_LINE: Final = '[data-widget="high_line"]'


def cell_with(folder: Path, more: str = "") -> Server:
    server = demo_server(folder, PANEL.replace("[demo]\n", WIDGETS) % LOW + more)
    until(lambda: len(listed(server)) == 2, "the alarms are raised")
    return server


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    """`air_latched` of high priority and no group, and `air_low` of medium priority are active."""
    with cell_with(tmp_path) as server:
        yield server


def names(page: Page, widget: str) -> list[str | None]:
    return [row.get_attribute("data-alarm") for row in page.locator(f"{widget} li").all()]


def test_widgets_show_the_alarms_of_their_group_and_priorities(cell: Server, page: Page) -> None:
    for scripts in (True, False):
        html = cell.http.get("/").text
        assert html.count('data-alarm="air_low"') == 2
        if scripts:
            started(page, cell.url)
            expect(page.locator(AIR_LINE)).to_have_attribute("data-alarm", "air_low")
            expect(page.locator(HIGH_LINE)).to_have_attribute("data-alarm", "air_latched")
            assert names(page, AIR_LIST) == ["air_low"]
            assert names(page, ALL_LIST) == ["air_latched"]
            expect(page.locator(f"{ALL_LIST} .rest")).to_contain_text("1")


def test_a_tap_in_the_list_acknowledges_that_alarm_then_resets_it(
    cell: Server, touch_page: Page
) -> None:
    page = started(touch_page, cell.url)
    button = page.locator(f"{AIR_LIST} .row-act")

    def acknowledged() -> bool:
        """A page on a machine that stands still loses its stream: then it is tapped again."""
        if not listed(cell)["air_low"]["acknowledged"] and button.is_visible() and button.is_enabled():
            button.tap()
        return bool(listed(cell)["air_low"]["acknowledged"])

    until(acknowledged, "the alarm is acknowledged", every_s=2)
    expect(button).to_be_hidden()
    expect(page.locator(AIR_LINE)).to_have_attribute("data-alarm", "")
    assert not listed(cell)["air_latched"]["acknowledged"]
    page.locator(f"{HIGH_LINE} > button").tap()
    expect(page.locator(HIGH_LINE)).to_have_attribute("data-alarm", "")
    assert listed(cell)["air_latched"]["acknowledged"]


def test_a_row_that_came_under_the_finger_is_not_acknowledged(cell: Server, touch_page: Page) -> None:
    page = started(touch_page, cell.url)
    touch = Touch(page)
    expect(page.locator(f"{ALL_LIST} .row-act[data-path]")).to_be_enabled()  # of the first event
    with page.expect_response("**/acknowledge", timeout=1000 * ENOUGH_S) as answer:
        touch.send("touchStart", middle(page.locator(f"{ALL_LIST} .row-act")))
        act(cell, "air_latched", "acknowledge", occurrence=1)
        expect(page.locator(f'{ALL_LIST} [data-alarm="air_low"]')).to_be_visible()
        touch.send("touchEnd")
        page.locator(f"{ALL_LIST} .row-act").dispatch_event("click", {"detail": 1})
    assert answer.value.url == f"{cell.url}/alarms/air_latched/acknowledge"
    assert not listed(cell)["air_low"]["acknowledged"]


def test_without_scripts_the_buttons_are_forms(cell: Server, chromium: Browser) -> None:
    with chromium.new_context(java_script_enabled=False) as context:
        page = context.new_page()
        for widget, alarm in ((AIR_LIST, "air_low"), (HIGH_LINE, "air_latched")):
            page.goto(cell.url)
            page.wait_for_timeout(TAP_AGAIN_MS)  # sooner it counts as a second tap
            follow(page.locator(f"{widget} button:not(.more-acts)"))
            assert page.url.startswith(f"{cell.url}/pages/main")
            assert listed(cell)[alarm]["acknowledged"]


def test_widgets_are_locked_without_a_connection_and_without_control(
    tmp_path: Path, own_page: Page, page: Page
) -> None:
    with cell_with(tmp_path, CONTROL) as cell:
        started(own_page, cell.url)
        expect(own_page.locator(f"{AIR_LINE} button")).to_be_enabled()  # it has control
        started(page, cell.url)
        for widget in (AIR_LIST, AIR_LINE):
            expect(own_page.locator(f"{widget} button:not(.more-acts)")).to_be_enabled()
            expect(page.locator(f"{widget} button:not(.more-acts)")).to_be_disabled()
            expect(page.locator(f"{widget} .by-control")).to_be_visible()
        own_page.evaluate(HIDE)
        for widget in (AIR_LIST, AIR_LINE):
            expect(own_page.locator(f"{widget} button:not(.more-acts)")).to_be_disabled()
            expect(own_page.locator(f"{widget} .by-loss")).to_be_visible()
        own_page.evaluate(HIDE, False)
        for widget in (AIR_LIST, AIR_LINE):
            expect(own_page.locator(f"{widget} button:not(.more-acts)")).to_be_enabled()


def test_widgets_fit_every_screen_and_axe_finds_nothing(cell: Server, axe_page: Page) -> None:
    started(axe_page, cell.url)
    for width, height in SIZES:
        sized(axe_page, width, height).evaluate(DRAWN)
        for button in axe_page.locator(f"{AIR_LIST} .row-act, {AIR_LINE} > button").all():
            size = place(button)
            assert size["height"] >= 44
            assert size["x"] + size["width"] <= width
    assert violations(axe_page) == []


FIVE: Final = "".join(
    f"""
[[alarm]]
id = "air_{number}"
topic = "/air"
type = "std_msgs/msg/Float64"
text = "Air {number}"
group = "Air"
low = 5.0
"""
    for number in range(5)
)
OUT_OF_SIGHT: Final = """list => [...list.children].filter(item => {
  const { top, bottom } = item.getBoundingClientRect();
  return (top + bottom) / 2 > list.getBoundingClientRect().bottom;
}).length"""


@pytest.mark.parametrize(("width", "height"), SIZES)
def test_a_list_says_how_many_rows_are_below_its_edge(
    tmp_path: Path, page: Page, width: int, height: int
) -> None:
    with demo_server(tmp_path, PANEL.replace("[demo]\n", WIDGETS) % LOW + FIVE) as server:
        until(lambda: len(listed(server)) == 7, "the alarms are raised")
        page.set_viewport_size({"width": width, "height": height})
        started(page, server.url)
        rows, rest = page.locator(f"{AIR_LIST} ol.alarms"), page.locator(f"{AIR_LIST} .rest")
        expect(rows.locator("li")).to_have_count(6)
        expect(page.locator(f"{AIR_LINE} .count")).to_contain_text("6 active")
        hidden = rows.evaluate(OUT_OF_SIGHT)
        assert hidden > 0
        expect(rest).to_have_text(f"{hidden} more below: scroll the list.")
        rows.evaluate("list => list.scrollTo(0, list.scrollHeight)")
        expect(rest).to_have_text("")
