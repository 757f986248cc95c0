"""A tour of the shipped panel of a mobile robot by finger: it runs, its current pose moves on in the
list and on the map, one is missed and named, and it is canceled."""

import re
from collections.abc import Iterator
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from app.system.settings import panel_path
from tests.browser.test_accessibility import violations
from tests.support.browser.pages import DRAWN, place, squeezed, widget
from tests.support.parts import ROOT, Server, until
from tests.support.servers import ready

pytestmark = pytest.mark.promise("places")

DRIVES_MS: Final = 60_000
STATES: Final = "(rows) => rows.map((row) => row.dataset.state)"


@pytest.fixture(scope="module")
def shuttle() -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(panel_path("mobile-robot")), KIOSK_MODE="demo")) as server:
        until(lambda: server.widget("drive_round")["enabled"], "the robot is on the map")
        yield server


def opened(page: Page, server: Server) -> Page:
    page.goto(f"{server.url}/pages/tour")
    expect(widget(page, "hall_of_tour")).to_have_attribute("data-version", re.compile(".+"))
    expect(widget(page, "drive_round").locator("button[type=submit]").first).to_be_enabled()
    return page


def rows(page: Page) -> Any:
    return widget(page, "round").locator("li")


def marks(page: Page) -> Any:
    return page.locator(".map-tour > g > g")


def states(page: Page) -> list[str]:
    return list(rows(page).evaluate_all(STATES))


def put_box(server: Server, *, there: bool) -> None:
    """Something in the robot's way, or nothing."""
    receipt = server.http.post("/widgets/obstacle", json={"inputs": {"obstacle": there}})
    assert receipt.status_code == 200, receipt.text


def test_a_tour_runs_and_its_current_pose_moves_on(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    expect(rows(page)).to_have_count(4)
    assert states(page) == ["planned"] * 4
    expect(marks(page)).to_have_count(4)
    widget(page, "drive_round").locator("button[type=submit]").first.tap()
    current = rows(page).nth(0)
    expect(current).to_have_attribute("data-state", "current")
    expect(current).to_have_attribute("aria-current", "step")
    expect(widget(page, "round").locator(".tour-title")).to_have_text("Waypoint 1 of 4.")
    expect(marks(page).nth(0)).to_have_attribute("data-state", "current")
    expect(marks(page).nth(1)).to_have_attribute("data-state", "to_come")
    wider, other = (float(marks(page).nth(n).locator("circle").get_attribute("r")) for n in (0, 1))
    assert wider > other  # not by colour alone
    assert not violations(page)
    current.evaluate("(row) => { row.isFirst = true; }")
    expect(rows(page).nth(1)).to_have_attribute("data-state", "current", timeout=DRIVES_MS)
    assert states(page) == ["passed", "current", "to_come", "to_come"]
    assert current.evaluate("(row) => row.isFirst === true")
    expect(current).not_to_have_attribute("aria-current", "step")
    expect(marks(page).nth(1)).to_have_attribute("data-state", "current")
    widget(page, "drive_round").locator(".cancel").tap()
    expect(widget(page, "round").locator(".tour-title")).to_have_text("Canceled.")
    assert states(page) == ["passed", "left", "left", "left"]


@pytest.mark.long("real time")
def test_a_pose_whose_way_is_blocked_is_missed_and_named(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    put_box(shuttle, there=True)
    widget(page, "drive_round").locator("button[type=submit]").first.tap()
    expect(page.locator(".machine-state")).to_contain_text("BLOCKED", timeout=DRIVES_MS)
    blocked = states(page).index("current")
    missed = rows(page).nth(blocked)
    expect(missed).to_have_attribute("data-state", "passed", timeout=DRIVES_MS)
    put_box(shuttle, there=False)
    expect(missed).to_have_attribute("data-state", "missed", timeout=2 * DRIVES_MS)
    expect(missed.locator(".word")).to_have_text("Missed")
    expect(missed.locator("small")).to_contain_text("The way is blocked (105).")
    expect(widget(page, "round").locator(".tour-title")).to_have_text("1 of 4 missed.")
    expect(widget(page, "drive_round")).to_contain_text(f"1 missed: waypoints {blocked + 1}.")


def test_without_scripts_the_tour_is_a_list_and_is_sent(shuttle: Server, page: Page) -> None:
    browser = page.context.browser
    assert browser is not None
    context = browser.new_context(java_script_enabled=False)
    plain = context.new_page()
    plain.goto(f"{shuttle.url}/pages/tour")
    names = widget(plain, "round").locator("li > b").all_inner_texts()
    assert names == ["Palletizer 2", "Palletizer 1", "Wrapper", "Gate 3"]
    assert place(widget(plain, "round").locator("ol"))["height"] > 100
    assert place(widget(plain, "hall_of_tour").locator(".map-view"))["height"] > 300

    def is_sent() -> bool:
        widget(plain, "drive_round").locator("button[type=submit]").first.click()
        return bool(shuttle.widget("drive_round")["busy"])

    until(is_sent, "it is sent: not before the page is there for a while", every_s=1.5)
    assert shuttle.http.post("/widgets/drive_round/cancel", json={}).status_code == 200
    until(lambda: not shuttle.widget("drive_round")["busy"], "it is canceled")
    context.close()


@pytest.mark.parametrize("page_id", ["map", "tour", "drive", "status"])
def test_what_a_phone_shows_has_room(shuttle: Server, touchscreen: Page, page_id: str) -> None:
    touchscreen.set_viewport_size({"width": 390, "height": 844})
    touchscreen.goto(f"{shuttle.url}/pages/{page_id}")
    touchscreen.evaluate(DRAWN)
    assert squeezed(touchscreen) == []


def test_a_phone_shows_the_tour_and_nothing_to_press(shuttle: Server, touchscreen: Page) -> None:
    touchscreen.set_viewport_size({"width": 390, "height": 844})
    touchscreen.goto(f"{shuttle.url}/pages/tour")
    for row in rows(touchscreen).all():
        expect(row).to_be_visible()
    expect(widget(touchscreen, "hall_of_tour")).to_be_visible()
    expect(widget(touchscreen, "drive_round")).to_be_hidden()
    assert violations(touchscreen) == []
