"""The page of the history of alarms: found by text, time, priority and group, page by page, with and
without scripts."""

import json
import re
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
from playwright.sync_api import Page, expect

from app.cell.alarms.history import HistoryRow
from app.cell.alarms.store import NAME, AlarmStore
from tests.browser.test_accessibility import violations
from tests.browser.test_alarm_line import SIZES, started
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, follow, place
from tests.support.parts import Server
from tests.web.test_alarms import HEALTHY, server_with

pytestmark = pytest.mark.long("detail")

EVENTS = 120


def written(folder: Path, now: float) -> None:
    """A history in which each minute something happened, and the clock was set back once."""
    store = AlarmStore(folder / NAME, days=1000, size_mb=64)
    rows = []
    for n in range(EVENTS):
        at = now - 60.0 * (EVENTS - n) - (3600.0 if n == EVENTS - 1 else 0.0)
        group, priority = ("Air", 2) if n % 2 else ("Belt", 3)
        about = {"text": f"Pump {n}", "group": group, "unit": "bar"}
        record = json.dumps({"about": about, "value": 4.5, "limit": 5.0})
        row = HistoryRow(at, f"pump{n}", "active", 1, "", "", record, "raised", priority, "", group)
        rows.append(row)
    store.write(rows, {})
    store.close()


def chatter(folder: Path, at: float) -> None:
    """An alarm that was raised five times in 40 s, for 2 s each."""
    store = AlarmStore(folder / NAME, days=1000, size_mb=64)
    record = json.dumps({"about": {"text": "Infeed full", "group": "Belt"}})
    for n in range(5):
        times = ((at + 10.0 * n, "raised", None), (at + 10.0 * n + 2.0, "returned", 2.0))
        store.write(
            [
                HistoryRow(when, "infeed", "active", 1, "", "", record, event, 3, "", "Belt", lasted)
                for when, event, lasted in times
            ],
            {},
        )
    store.close()


@pytest.fixture
def cell(tmp_path: Path) -> Iterator[Server]:
    data = tmp_path / "data"
    data.mkdir()
    written(data, time.time())
    with server_with(tmp_path, HEALTHY, data=data) as server:
        yield server


def shown(page: Page) -> list[str | None]:
    return [row.get_attribute("data-alarm") for row in page.locator("tr[data-event]").all()]


def test_the_history_is_reached_from_the_list_and_has_pages(
    cell: Server, without_scripts: Page
) -> None:
    page = without_scripts
    page.goto(f"{cell.url}/alarms")
    follow(page.get_by_role("link", name="History"))
    assert shown(page)[:2] == ["pump119", "pump118"]
    assert len(shown(page)) == 50
    expect(page.locator(".pager")).to_contain_text("Events 1–50 of 120, newest first")
    follow(page.get_by_role("link", name="Older"))
    follow(page.get_by_role("link", name="Older"))
    assert shown(page)[-1] == "pump0"
    expect(page.locator(".pager")).to_contain_text("Events 101–120 of 120")
    expect(page.get_by_role("link", name="Older")).to_have_count(0)
    follow(page.get_by_role("link", name="Newest"))
    assert shown(page)[0] == "pump119"


def test_events_are_found_by_text_priority_group_and_time(cell: Server, without_scripts: Page) -> None:
    page = without_scripts
    page.goto(f"{cell.url}/alarms/history")
    page.get_by_label("Text").fill("Pump 11")
    page.get_by_label("Group").select_option(label="Air")
    page.get_by_label("Priority").select_option(label="Low")
    follow(page.get_by_role("button", name="Show"))
    expect(page.locator(".entries .empty")).to_have_text("No event has this.")
    page.get_by_label("Priority").select_option(label="all")
    follow(page.get_by_role("button", name="Show"))
    assert shown(page)[:2] == ["pump119", "pump117"]
    page.goto(f"{cell.url}/alarms/history?text=Pump 11&priority=2")
    assert shown(page) == ["pump119", "pump117", "pump115", "pump113", "pump111", "pump11"]
    since = time.strftime("%Y-%m-%dT%H:%M", time.localtime(time.time() - 600))
    page.get_by_label("Text").fill("")
    page.locator(".times summary").click()
    page.get_by_label("From").fill(since)
    follow(page.get_by_role("button", name="Show"))
    assert all(int(str(name)[4:]) >= 109 for name in shown(page))
    assert "pump119" not in shown(page)  # its clock was set back
    expect(page.get_by_role("link", name="CSV")).to_have_attribute(
        "href", re.compile("history.csv[?]since=.*priority=2")
    )


def test_a_row_says_that_the_clock_was_set_back(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms/history")
    expect(page.locator("tr[data-event] .clock-back")).to_have_count(1)
    expect(page.locator("tr[data-alarm=pump119]")).to_contain_text("Clock set back by 59 min 00 s")
    expect(page.locator(".pager")).to_contain_text("The clock was set back")


def test_axe_finds_nothing_and_nothing_is_cut_at_any_size(cell: Server, axe_page: Page) -> None:
    started(axe_page, f"{cell.url}/alarms/history")
    for width, height in (*SIZES, (390, 844)):
        sized(axe_page, width, height).evaluate(DRAWN)
        assert axe_page.evaluate("document.documentElement.scrollWidth") == width
        assert violations(axe_page) == [], width


def test_the_page_has_the_figures_of_the_chosen_time(cell: Server, page: Page) -> None:
    started(page, f"{cell.url}/alarms/history")
    figures = page.locator(".alarm-figures")
    expect(figures).to_contain_text(re.compile("Alarms per hour, limit 6\\s*5\\s*most"))
    expect(figures.locator("[data-over]")).to_contain_text("most 11, over the limit")
    assert page.locator(".alarm-plot rect").count() in (24, 25)
    expect(page.locator(".ranking ol li")).to_have_count(10)
    expect(page.locator(".ranking")).to_contain_text("10 of 120")
    expect(page.locator(".ranking")).to_contain_text("No alarm chatters.")
    follow(page.locator(".ranking ol a").first)
    assert len(shown(page)) == 1
    follow(page.get_by_role("link", name="Show all alarms"))
    follow(page.get_by_role("link", name="7 days"))
    expect(page.locator(".plot-head").first).to_contain_text("Raised in each day")
    assert page.locator(".alarm-plot rect").count() in (7, 8)


def test_an_alarm_that_chatters_is_shown_with_its_delay(tmp_path: Path, page: Page) -> None:
    data = tmp_path / "data"
    data.mkdir()
    chatter(data, time.time() - 600)
    with server_with(tmp_path, HEALTHY, data=data) as server:
        started(page, f"{server.url}/alarms/history")
        row = page.locator("[data-chatters=infeed]")
        expect(row).to_contain_text("5 in 40 s at ")
        expect(row).to_contain_text("off_delay_s = 9 would leave 1.")
        expect(row).to_contain_text("on_delay_s = 3 would leave 0.")


@pytest.mark.parametrize("path", ["/alarms/history", "/log"])
def test_the_keyboard_writes_what_to_search_for(cell: Server, touch_page: Page, path: str) -> None:
    page = started(touch_page, cell.url + path)
    for width, height in SIZES:
        sized(page, width, height).evaluate(DRAWN)
        text = page.locator("#text")
        text.tap()
        keyboard = page.locator(".sheet.keyboard")
        expect(keyboard).to_be_visible()
        keys, field = place(keyboard), place(text)
        assert keys["y"] + keys["height"] <= height
        assert field["y"] + field["height"] <= keys["y"] or keys["y"] + keys["height"] <= field["y"]
        keyboard.get_by_role("button", name="q", exact=True).tap()
        keyboard.locator(".set-entry").tap()
        expect(keyboard).to_be_hidden()
    expect(text).to_have_value(re.compile("^q+$", re.IGNORECASE))
    page.locator("form.filter button[type=submit]").tap()
    expect(page).to_have_url(re.compile(r"text=q+", re.IGNORECASE))
