"""The shipped panel of a mobile robot, as an operator uses it: choose a place, send, arrive; a way
that is blocked; cancel."""

from collections.abc import Iterator
from contextlib import suppress
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from app.system.settings import panel_path
from tests.support.browser.pages import place, widget
from tests.support.holds import TRIES
from tests.support.parts import ROOT, Server
from tests.support.servers import ready

pytestmark = pytest.mark.promise("demo")

ARRIVES_MS: Final = 60_000


@pytest.fixture(scope="module")
def shuttle() -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(panel_path("mobile-robot")), KIOSK_MODE="demo")) as server:
        yield server


def opened(page: Page, server: Server) -> Page:
    page.goto(f"{server.url}/pages/map")
    expect(widget(page, "hall")).to_have_attribute("data-state", "live")
    return page


def put_box(page: Page, server: Server, position: str) -> None:
    """Something in the robot's way, or nothing."""
    page.goto(f"{server.url}/pages/status")
    switch = widget(page, "obstacle").locator(f"[data-position={position}]")
    switch.click()
    expect(switch).to_have_attribute("aria-pressed", "true")


def send(page: Page, place: str) -> None:
    """Again where it is refused: on a slow machine the state changes while it is pressed."""
    for _ in range(TRIES):
        with suppress(AssertionError):
            return press(page, place)
    press(page, place)


def press(page: Page, place: str) -> None:
    card = widget(page, "goal").locator(".place-card dd").first
    if not card.is_visible():
        widget(page, "goal").locator(f"[data-place={place}]").click()
        expect(card).to_be_visible(timeout=5000)
    widget(page, "send").locator("button[type=submit]").first.click()
    expect(widget(page, "send")).to_have_attribute("data-busy", "", timeout=5000)


def state(page: Page, word: str) -> None:
    expect(page.locator(".machine-state")).to_contain_text(word, timeout=ARRIVES_MS)


def test_robot_drives_to_a_place_that_is_chosen_and_the_receipt_says_so(
    shuttle: Server, page: Page
) -> None:
    opened(page, shuttle)
    send(page, "charger")
    state(page, "DRIVING")
    expect(widget(page, "send")).to_contain_text("Succeeded at", timeout=ARRIVES_MS)
    state(page, "WAITING")


@pytest.mark.long("real time")
def test_blocked_way_is_an_alarm_and_the_goal_says_why_it_ends(shuttle: Server, page: Page) -> None:
    put_box(page, shuttle, "on")
    opened(page, shuttle)
    send(page, "wrapper")
    state(page, "BLOCKED")
    expect(page.locator(".alarm-line")).to_contain_text("Way blocked")
    expect(widget(page, "send")).to_contain_text("The way is blocked (105)", timeout=ARRIVES_MS)
    put_box(page, shuttle, "off")


def test_speed_limit_is_a_step_that_the_robot_reports(shuttle: Server, page: Page) -> None:
    page.goto(f"{shuttle.url}/pages/status")
    limit = widget(page, "speed_limit")
    expect(limit).to_contain_text("100")
    expect(widget(page, "collision_lamp")).to_contain_text("Free")
    limit.locator("button").first.click()
    expect(limit).to_contain_text("80")
    limit.locator("button").last.click()
    expect(limit).to_contain_text("100")


def test_cancel_ends_the_goal_and_the_robot_stands(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    send(page, "palletizer_1")
    state(page, "DRIVING")
    widget(page, "send").locator(".cancel").click()
    expect(widget(page, "send")).to_contain_text("Canceled at")
    state(page, "WAITING")


@pytest.mark.parametrize("size", [(1280, 800), (1024, 600), (800, 480)], ids=str)
def test_card_of_a_place_is_wholly_seen(shuttle: Server, page: Page, size: tuple[int, int]) -> None:
    page.set_viewport_size({"width": size[0], "height": size[1]})
    opened(page, shuttle)
    if size[0] == 800:
        page.get_by_text("Places", exact=True).first.click()
    goal = widget(page, "goal")
    goal.locator("[data-place=wrapper]").click()
    expect(goal.locator(".place-card dd").first).to_be_visible()
    parts = ("h3", "dd >> nth=-1", ".unchoose")
    card, *boxes = (
        place(goal.locator(part)) for part in (".place-card", *(f".place-card {p}" for p in parts))
    )
    bottom = card["y"] + card["height"]
    assert [box["height"] >= 18 and box["y"] + box["height"] <= bottom for box in boxes] == [True] * 3


def test_a_robot_at_a_place_is_over_its_symbol(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    marks = widget(page, "hall").locator(".map-marks > g")
    names = marks.evaluate_all("(marks) => marks.map((mark) => mark.getAttribute('class'))")
    assert names.index("map-places") < names.index("map-robot") < names.index("map-goal")


def test_symbols_of_places_stay_while_the_robot_drives(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    symbol = page.locator(".map-places > g").first
    symbol.evaluate("(symbol) => { symbol.isFirst = true; }")
    distance = widget(page, "goal").locator("[data-place=charger] .distance")
    before = distance.inner_text()
    send(page, "wrapper")
    expect(distance).not_to_have_text(before)
    assert symbol.evaluate("(symbol) => symbol.isFirst")
    widget(page, "send").locator(".cancel").click()
    expect(widget(page, "send")).to_contain_text("Canceled at")


# What is cut of the texts on a button.
CUT: Final = """(face) => [...face.querySelectorAll(":scope > :is(.label, p)")]
  .filter((text) => text.checkVisibility() && text.textContent.trim())
  .filter((text) => {
    const [box, within] = [text.getBoundingClientRect(), face.getBoundingClientRect()];
    return box.height < parseFloat(getComputedStyle(text).fontSize)
      || box.top < within.top || box.bottom > within.bottom;
  })
  .map((text) => text.className)"""


def test_locked_button_on_a_low_screen_has_its_whole_name_and_reason_beside_a_result(
    shuttle: Server, page: Page
) -> None:
    opened(page, shuttle)
    send(page, "palletizer_1")
    widget(page, "send").locator(".cancel").click()
    expect(widget(page, "send")).to_contain_text("Canceled at")
    page.set_viewport_size({"width": 800, "height": 480})
    page.get_by_text("Places", exact=True).first.click()
    face = widget(page, "send").locator(".face").first
    expect(face.locator(".result")).to_be_visible()
    assert face.evaluate(CUT) == []
    by_hand(page, shuttle, "on")
    opened(page, shuttle)
    page.get_by_text("Places", exact=True).first.click()
    expect(face.locator(".why")).to_contain_text("Driven by hand.")
    expect(face.locator(".why")).to_be_visible()
    assert face.evaluate(CUT) == []
    by_hand(page, shuttle, "off")


def by_hand(page: Page, server: Server, position: str) -> None:
    page.goto(f"{server.url}/pages/drive")
    page.get_by_text("Manual drive", exact=True).first.click()
    switch = widget(page, "by_hand").locator(f"[data-position={position}]")
    switch.click()
    expect(switch).to_have_attribute("aria-pressed", "true")


def test_all_places_are_wholly_seen_on_a_small_screen(shuttle: Server, page: Page) -> None:
    page.set_viewport_size({"width": 1024, "height": 600})
    opened(page, shuttle)
    places = widget(page, "goal").locator(".places")
    box, last = place(places), place(places.locator("button").last)
    assert last["y"] + last["height"] <= box["y"] + box["height"]


def test_phone_scrolls_a_page_that_fits_and_shows_its_lists_and_pictures_whole(
    shuttle: Server, page: Page
) -> None:
    page.set_viewport_size({"width": 390, "height": 844})
    opened(page, shuttle)
    assert place(widget(page, "goal").locator(".places"))["height"] > 200
    keys = [place(key)["y"] for key in widget(page, "hall").locator(".map-keys > button").all()]
    assert len(set(keys)) == 1
    page.goto(f"{shuttle.url}/pages/drive")
    assert place(widget(page, "front"))["height"] >= 150
