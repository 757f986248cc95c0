"""Saving a place as an operator does it: a finger, the keyboard of the screen."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, expect

from tests.browser.test_accessibility import violations
from tests.browser.test_places_in_browser import card, chosen, opened, touch_and_drag
from tests.support.browser.pages import widget, without_its_time
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_saved_places import SAVES

pytestmark = pytest.mark.promise("places")


@pytest.fixture(scope="module")
def shuttle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("shuttle"), SAVES) as server:
        until(lambda: server.widget("hall")["state"] == "live", "the map is there")
        yield server


def test_a_place_is_named_by_the_keyboard_of_the_screen_saved_and_deleted(
    shuttle: Server, touchscreen: Page
) -> None:
    page = opened(touchscreen, shuttle)
    widget(page, "goal").get_by_role("link", name="Save the robot's position").tap()
    expect(page.locator("#place-title")).to_have_text("Save this place")
    without_its_time(page)
    page.locator("#name").tap()
    keyboard = page.locator(".keyboard")
    for key in "bay 7":
        keyboard.locator(f'[data-key="{key}"]').tap()
    keyboard.locator(".set-entry").tap()
    page.get_by_role("button", name="Save this place").tap()
    expect(page.locator(".said")).to_contain_text("bay 7 saved: x ")
    page.get_by_role("link", name="Back").tap()
    expect(widget(page, "goal").locator('[data-place="bay_7"]')).to_contain_text("bay 7")
    # Another client deletes it: it goes from the list of this browser.
    answer = shuttle.http.post("/places/goal/delete", json={"place": "bay_7"})
    assert answer.json()["done"]
    expect(widget(page, "goal").locator('[data-place="bay_7"]')).to_have_count(0)


def test_a_touched_pose_is_saved_as_it_was_touched_and_can_be_chosen(
    shuttle: Server, touchscreen: Page
) -> None:
    page = opened(touchscreen, shuttle)
    touch_and_drag(page)
    expect(card(page)).to_be_visible()
    x, y, yaw = (float(part.partition("=")[2]) for part in chosen(page).split()[:3])
    card(page).get_by_role("link", name="Save this place").click()
    expect(page.locator(".facts")).to_contain_text(f"x {x:.2f} m, y {y:.2f} m")
    without_its_time(page)
    page.locator("#name").fill("Gate")
    page.get_by_role("button", name="Save this place").tap()
    expect(page.locator(".said")).to_contain_text(f"Gate saved: x {x:.2f} m, y {y:.2f} m")
    page.get_by_role("link", name="Back").tap()
    widget(page, "goal").locator('[data-place="gate"]').tap()
    expect(card(page)).to_contain_text("Gate")
    (saved,) = (place for place in shuttle.widget("goal")["places"] if place["id"] == "gate")
    assert saved["pose"] == pytest.approx([x, y, yaw], abs=0.006)
    assert shuttle.http.post("/places/goal/delete", json={"place": "gate"}).json()["done"]


def test_the_pages_of_saved_places_work_by_keyboard_and_axe_finds_nothing(
    shuttle: Server, axe_page: Page
) -> None:
    page = axe_page
    page.goto(f"{shuttle.url}/places/goal?mode=save")
    assert violations(page) == []
    without_its_time(page)
    page.locator("#name").fill("Rack")
    page.keyboard.press("Enter")
    expect(page.locator(".said")).to_contain_text("Rack saved: x ")
    assert violations(page) == []
    page.locator('[data-row="rack"] a').press("Enter")
    expect(page.locator("#place-title")).to_have_text("Rack")
    page.get_by_role("link", name="Delete place").press("Enter")
    expect(page.locator(".sure")).to_contain_text("Delete Rack?")
    assert violations(page) == []
    without_its_time(page)
    page.get_by_role("button", name="Delete place").press("Enter")
    expect(page.locator(".said")).to_contain_text("Rack deleted")
