"""Places and goals as an operator uses them: the list, fingers on the map, the card, the press."""

import re
from collections.abc import Iterator
from typing import Any, Final

import pytest
from playwright.sync_api import Page, Route, expect

from tests.browser.test_accessibility import violations
from tests.support.browser.finger import Touch
from tests.support.browser.pages import DRAWN, HIDE, place, widget
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_places import PANEL

pytestmark = pytest.mark.promise("places")

CHOSEN: Final = "(select) => select.value"


@pytest.fixture(scope="module")
def shuttle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("shuttle"), PANEL) as server:
        until(lambda: server.widget("hall")["state"] == "live", "the map is there")
        yield server


def opened(page: Page, server: Server) -> Page:
    page.goto(server.url)
    expect(widget(page, "hall")).to_have_attribute("data-version", re.compile(".+"))
    expect(page.locator(".map-places > g")).to_have_count(3)
    expect(widget(page, "drive").locator("button[type=submit]")).to_be_enabled()
    page.evaluate(DRAWN)
    return page


def chosen(page: Page) -> str:
    return str(page.locator("#input-goal").evaluate(CHOSEN))


def card(page: Page) -> Any:
    return widget(page, "goal").locator(".place-card")


def send(page: Page) -> None:
    widget(page, "drive").locator("button[type=submit]").click()


def receipt(page: Page) -> Any:
    return widget(page, "drive").locator(".receipt")


def touch_and_drag(page: Page, across: float = 0.5, down: float = 0.3) -> None:
    """A finger on free floor that drags upwards: to the north."""
    view = place(page.locator(".map-view"))
    x, y = view["x"] + across * view["width"], view["y"] + down * view["height"]
    touch = Touch(page)
    touch.send("touchStart", (x, y))
    touch.send("touchMove", (x, y - 30))
    touch.send("touchMove", (x, y - 60))
    touch.send("touchEnd")


def test_a_tap_right_after_a_quick_drag_on_the_map_is_taken(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    view = place(page.locator(".map-view"))
    x, y = view["x"] + 0.5 * view["width"], view["y"] + 0.3 * view["height"]
    finger = Touch(page)
    for _ in range(12):  # without the cure every third is lost
        finger.send("touchStart", (x, y))
        finger.send("touchMove", (x, y - 30))
        finger.send("touchMove", (x, y - 60))
        finger.send("touchEnd")
        expect(card(page)).to_be_visible()
        key = place(card(page).locator(".unchoose"))
        finger.send("touchStart", (key["x"] + key["width"] / 2, key["y"] + key["height"] / 2))
        finger.send("touchEnd")
        expect(card(page)).to_be_hidden(timeout=5000)


def test_a_place_of_the_list_is_chosen_shown_and_sent_once(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    goal = widget(page, "goal")
    goal.locator('[data-place="dock"]').tap()
    expect(card(page)).to_be_visible()
    expect(card(page)).to_contain_text("x 2.00 m, y 1.50 m")
    expect(goal.locator(".places")).to_be_hidden()
    assert chosen(page) == "dock"
    send(page)
    expect(receipt(page)).to_contain_text("Dock: ")
    expect(card(page)).to_be_hidden()  # it is sent: pressed again, nothing is chosen
    assert chosen(page) == ""


def begin_by_keys(page: Page) -> None:
    """Begins the crosshair, by one key on a map that is shown."""
    hall, view = widget(page, "hall"), page.locator(".map-view")
    expect(view).to_have_attribute("role", "application")
    view.focus()
    expect(view).to_be_focused()
    page.keyboard.press("Enter")
    expect(hall).to_have_attribute("data-crosshair", "")


def test_a_goal_is_set_and_sent_by_keys_alone(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    hall = widget(page, "hall")
    begin_by_keys(page)
    said = hall.locator(".map-crosshair")
    first = "x 0.00 m, y 0.00 m"
    expect(said).to_contain_text(first)
    expect(said).to_contain_text("Enter sets it")
    assert violations(page) == []
    expect(hall.locator(".map-goal")).to_have_attribute("data-touched", "")
    page.keyboard.press("Escape")
    expect(said).to_have_text("")
    page.keyboard.press("Enter")
    expect(said).to_contain_text(first)
    for _ in range(3):
        page.keyboard.press("PageUp")
    page.keyboard.press("ArrowUp")
    page.keyboard.press("Shift+ArrowRight")
    expect(said).not_to_contain_text(first)
    page.keyboard.press("Enter")
    expect(card(page)).to_be_focused()
    expect(said).to_have_text("")
    assert chosen(page).startswith("x=")
    drive = widget(page, "drive").locator("button[type=submit]")
    for _ in range(6):
        page.keyboard.press("Tab")
        if drive.evaluate("(key) => key === document.activeElement"):
            break
    expect(drive).to_be_focused()
    page.keyboard.press("Enter")
    expect(receipt(page)).to_contain_text("x ")
    assert chosen(page) == ""


def test_the_crosshair_is_offered_once_the_map_is_shown(shuttle: Server, page: Page) -> None:
    held: list[Route] = []

    def hold(route: Route) -> None:
        held.append(route)

    page.route("**/map/*/*.png*", hold)
    page.goto(shuttle.url)
    hall, view = widget(page, "hall"), page.locator(".map-view")
    expect(page.locator(".map-goal")).to_be_attached()  # the scripts of places are there
    until(lambda: page.evaluate(DRAWN) and held, "a tile of the map is asked for")
    view.focus()
    page.keyboard.press("Enter")
    expect(view).to_have_attribute("role", "img")
    assert hall.get_attribute("data-crosshair") is None
    for route in held:
        route.continue_()
    begin_by_keys(page)


def test_keys_move_the_crosshair_by_steps_and_the_map_at_its_edge(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    mark = widget(page, "hall").locator(".map-goal > circle")
    begin_by_keys(page)
    expect(mark).to_be_visible()

    def x() -> float:
        page.evaluate(DRAWN)
        box = place(mark)
        return box["x"] + box["width"] / 2

    before = x()
    page.keyboard.press("ArrowRight")
    step = x() - before
    assert step == pytest.approx(20 / 0.22, abs=2)
    page.keyboard.press("Shift+ArrowRight")
    assert x() - before - step == pytest.approx(2 / 0.22, abs=1)
    for _ in range(30):
        page.keyboard.press("ArrowRight")
    view = place(page.locator(".map-view"))
    assert x() <= view["x"] + view["width"] - 20
    said = widget(page, "hall").locator(".map-crosshair")
    expect(said).not_to_have_text("")
    for _ in range(30):
        page.keyboard.press("ArrowUp")

    def is_below() -> bool:
        page.evaluate(DRAWN)
        words, box = place(said), place(mark)
        return bool(box["y"] + box["height"] / 2 > words["y"] + words["height"])

    until(is_below, "what is said does not cover it")


def test_nothing_chosen_is_nothing_sent(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    send(page)
    expect(receipt(page)).to_have_attribute("data-outcome", "refused")


def test_a_locked_place_says_why_and_is_not_chosen(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    pit = widget(page, "goal").locator('[data-place="pit"]')
    expect(pit).to_have_attribute("aria-disabled", "true")
    expect(pit).to_contain_text("Stairs")
    pit.tap(force=True)
    page.evaluate(DRAWN)
    assert chosen(page) == ""


def test_a_finger_sets_a_pose_with_its_direction(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    touch_and_drag(page)
    expect(card(page)).to_contain_text("90°, to the north")
    value = chosen(page)
    version = widget(page, "hall").get_attribute("data-version")
    assert value.endswith(f"yaw=1.57 map={version}")
    expect(page.locator(".map-goal")).not_to_have_attribute("data-refused", "")
    send(page)
    x, y = (part.partition("=")[2] for part in value.split()[:2])
    expect(receipt(page)).to_contain_text(f"x {x} m, y {y} m: ")
    expect(card(page)).to_be_hidden()


def test_a_touch_where_the_robot_may_not_go_is_chosen_and_refused(
    shuttle: Server, touchscreen: Page
) -> None:
    page = opened(touchscreen, shuttle)
    touch_and_drag(page, 0.5, 0.02)  # above the wall
    expect(card(page).locator(".refusal")).to_contain_text("outside the map")
    send(page)
    expect(receipt(page)).to_have_attribute("data-outcome", "refused")
    expect(card(page)).to_be_visible()
    card(page).locator(".unchoose").click()
    expect(card(page)).to_be_hidden()


def test_a_second_finger_ends_the_touch_and_moves_the_map(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    view = place(page.locator(".map-view"))
    x, y = view["x"] + view["width"] / 2, view["y"] + view["height"] / 3
    touch = Touch(page)
    touch.send("touchStart", (x, y))
    touch.send("touchStart", (x, y), (x + 60, y))
    touch.send("touchMove", (x - 30, y), (x + 90, y))
    touch.send("touchEnd")
    page.evaluate(DRAWN)
    assert chosen(page) == ""
    expect(page.locator(".map-goal")).to_have_attribute("hidden", "")


def test_a_tap_on_a_symbol_chooses_its_place(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    circle = page.locator(".map-places > g").first.locator("circle")
    expect(circle).to_be_visible()
    symbol = place(circle)
    touch = Touch(page)
    touch.send("touchStart", (symbol["x"] + symbol["width"] / 2, symbol["y"] + symbol["height"] / 2))
    touch.send("touchEnd")
    expect(card(page)).to_be_visible()
    assert chosen(page) == "dock"


def test_a_cut_between_touch_and_send_sends_nothing(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    touch_and_drag(page)
    expect(card(page)).to_be_visible()
    page.evaluate(HIDE)
    expect(widget(page, "drive").locator("button[type=submit]")).to_be_disabled()
    expect(widget(page, "goal")).to_have_attribute("data-state", "old")


def test_without_an_answer_nothing_is_chosen(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    page.route("**/widgets/goal/place*", lambda route: route.abort())
    try:
        widget(page, "goal").locator('[data-place="dock"]').tap()
        expect(widget(page, "goal").locator(".no-answer")).not_to_be_empty()
        assert chosen(page) == ""
    finally:
        page.unroute("**/widgets/goal/place*")


def test_arrow_keys_go_through_the_list_and_enter_chooses(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    widget(page, "goal").locator('[data-place="pit"]').focus()
    page.keyboard.press("ArrowDown")  # from the last to the first
    page.keyboard.press("Enter")
    expect(card(page)).to_be_focused()
    assert chosen(page) == "dock"
    card(page).locator(".unchoose").focus()
    page.keyboard.press("Enter")
    expect(widget(page, "goal").locator('[data-place="dock"]')).to_be_focused()


def test_axe_finds_nothing_in_the_list_and_on_the_card(shuttle: Server, axe_page: Page) -> None:
    opened(axe_page, shuttle)
    assert violations(axe_page) == []
    widget(axe_page, "goal").locator('[data-place="dock"]').click()
    expect(card(axe_page)).to_be_visible()
    assert violations(axe_page) == []


def test_a_phone_shows_the_map_and_the_places_and_chooses_nothing(
    shuttle: Server, touchscreen: Page
) -> None:
    touchscreen.set_viewport_size({"width": 390, "height": 844})
    page = opened(touchscreen, shuttle)
    expect(widget(page, "goal").locator('[data-place="dock"]')).to_be_visible()
    touch_and_drag(page)
    page.evaluate(DRAWN)
    assert chosen(page) == ""
    expect(widget(page, "drive")).to_be_hidden()
