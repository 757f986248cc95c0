"""A map as an operator uses it: fingers, the wheel and keys move it; an old pose looks old."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.finger import Touch
from tests.support.browser.pages import DRAWN, HIDE, middle, place, widget
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_map import PANEL, SILENT
from tests.web.test_map_files import put_files

pytestmark = pytest.mark.promise("values")

VERSION: Final = re.compile("[0-9a-f]{16}")
# Where the map's first tile and the robot are, in pixels of the view, and how large a cell is.
STATE: Final = """(root) => {
  const view = root.querySelector(".map-view").getBoundingClientRect();
  const [tile, robot] = [".map-tiles img", ".map-robot circle"].map((part) =>
    root.querySelector(part).getBoundingClientRect());
  return {
    left: tile.left - view.left, right: tile.right - view.left, width: tile.width, view: view.width,
    x: robot.left + robot.width / 2 - view.left, robot: robot.width,
  };
}"""


@pytest.fixture(scope="module")
def shuttle(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("shuttle"), PANEL) as server:
        yield server


def opened(page: Page, server: Server) -> Page:
    page.goto(server.url)
    expect(widget(page, "hall")).to_have_attribute("data-version", VERSION)
    page.evaluate(DRAWN)
    return page


def state(page: Page) -> dict[str, float]:
    page.evaluate(DRAWN)
    return dict(widget(page, "hall").evaluate(STATE))


def key(page: Page, name: str) -> None:
    widget(page, "hall").get_by_role("button", name=name).tap()


def test_the_whole_map_is_shown_at_first_and_again(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    first = state(page)
    assert 0 < first["left"] < first["right"] < first["view"]
    key(page, "Enlarge")
    assert state(page)["width"] == pytest.approx(1.5 * first["width"], rel=0.01)
    page.set_viewport_size({"width": 800, "height": 480})
    key(page, "Show the whole map")
    small = state(page)
    assert 0 < small["left"] < small["right"] < small["view"]


def test_it_follows_the_robot_until_a_finger_moves_it(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    key(page, "Follow the robot")
    follow = widget(page, "hall").get_by_role("button", name="Follow the robot")
    expect(follow).to_have_attribute("aria-pressed", "true")
    for _ in range(3):
        now = state(page)
        assert now["x"] == pytest.approx(now["view"] / 2, abs=1)
    x, y = middle(page.locator(".map-view"))
    touch = Touch(page)
    touch.send("touchStart", (x, y))
    touch.send("touchMove", (x + 60, y))
    touch.send("touchEnd")
    expect(follow).to_have_attribute("aria-pressed", "false")


def test_one_finger_moves_it_and_two_enlarge_it(shuttle: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttle)
    first, (x, y) = state(page), middle(page.locator(".map-view"))
    touch = Touch(page)
    touch.send("touchStart", (x, y))
    touch.send("touchMove", (x + 80, y))
    touch.send("touchEnd")
    until(
        lambda: state(page)["left"] == pytest.approx(first["left"] + 80, abs=1),
        "it moves by the finger",
    )
    moved = state(page)
    touch.send("touchStart", (x - 50, y), (x + 50, y))
    touch.send("touchMove", (x - 100, y), (x + 100, y))
    touch.send("touchEnd")
    until(
        lambda: state(page)["width"] == pytest.approx(2 * moved["width"], rel=0.03),
        "two fingers enlarge it",
    )


def test_the_wheel_enlarges_at_the_pointer_and_arrow_keys_move_it(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    first, (_, y) = state(page), middle(page.locator(".map-view"))
    box = place(page.locator(".map-view"))
    page.mouse.move(box["x"] + first["left"], y)
    page.mouse.wheel(0, -200)
    until(lambda: state(page)["width"] > 1.3 * first["width"], "the wheel enlarges it")
    assert state(page)["left"] == pytest.approx(first["left"], abs=2)
    before = state(page)["left"]
    page.locator(".map-view").focus()
    page.keyboard.press("ArrowRight")
    until(lambda: state(page)["left"] < before, "an arrow moves it")


def test_a_map_without_a_connection_is_old(shuttle: Server, page: Page) -> None:
    opened(page, shuttle)
    expect(widget(page, "hall")).to_have_attribute("data-state", "live")
    page.evaluate(HIDE)
    expect(widget(page, "hall")).to_have_attribute("data-state", "old")


def test_a_robot_that_is_not_known_is_not_drawn(tmp_path: Path, page: Page) -> None:
    with demo_server(tmp_path, PANEL + SILENT) as server:
        opened(page, server)
        expect(page.locator(".map-robot")).to_be_hidden()
        expect(widget(page, "hall").locator(".note")).to_contain_text(
            "No transform from map to base_link"
        )


def test_a_map_whose_tile_does_not_come_is_not_shown_as_unknown_floor(
    shuttle: Server, own_page: Page
) -> None:
    own_page.route("**/map/**", lambda route: route.abort())
    own_page.goto(shuttle.url)
    root = widget(own_page, "hall")
    expect(root.locator(".broken")).to_be_visible()
    expect(own_page.locator(".map-robot")).to_be_hidden()
    own_page.unroute_all()
    expect(root).to_have_attribute("data-version", VERSION)
    expect(root.locator(".broken")).to_be_hidden()
    expect(own_page.locator(".map-robot")).to_be_visible()


# What another script of the page does: it counts draws, and takes the first finger on the map.
OTHER_SCRIPT: Final = """async (root) => {
  const scripts = performance.getEntriesByType("resource");
  const { name } = scripts.find(({ name }) => name.endsWith("/kinds/map.js"));
  const view = (await import(name)).viewOf(root);
  const seen = window.seen = { version: view.version, draws: 0, taken: 0, ended: 0, at: null };
  view.onDraw(() => seen.draws++);
  view.onPointer((event) => {
    const point = view.pointAt(event);
    seen.at = view.at(point.x, point.y);
    seen.taken++;
    return () => seen.ended++;
  });
}"""


def test_another_script_can_take_a_finger_until_a_second_one_enlarges_the_map(
    shuttle: Server, touchscreen: Page
) -> None:
    page = opened(touchscreen, shuttle)
    widget(page, "hall").evaluate(OTHER_SCRIPT)
    first, (x, y) = state(page), middle(page.locator(".map-view"))
    box = place(page.locator(".map-view"))
    touch = Touch(page)
    touch.send("touchStart", (x, y))
    touch.send("touchMove", (x + 80, y))
    touch.send("touchEnd")
    until(lambda: page.evaluate("seen.taken") == 1, "the script has the finger")
    assert state(page)["left"] == pytest.approx(first["left"], abs=1)
    touch.send("touchStart", (x - 50, y))
    touch.send("touchStart", (x - 50, y), (x + 50, y))
    touch.send("touchMove", (x - 100, y), (x + 100, y))
    touch.send("touchEnd")
    until(
        lambda: state(page)["width"] == pytest.approx(2 * first["width"], rel=0.03),
        "two fingers enlarge it",
    )
    seen = page.evaluate("seen")
    assert (seen["taken"], seen["ended"]) == (2, 1)
    assert seen["at"]["x"] == pytest.approx(x - 50 - box["x"], abs=1)
    assert seen["draws"] > 0
    assert VERSION.fullmatch(seen["version"])


LAYERS: Final = """
[[page.widget.layer]]
shows = "scan"
topic = "/scan"
[[page.widget.layer]]
shows = "path"
topic = "/plan"
[[page.widget.layer]]
shows = "costmap"
topic = "/costmap"
[[page.widget.layer]]
shows = "covariance"
topic = "/amcl_pose"
[demo]
"/amcl_pose" = { silent = true }
"""
# How many pixels of the canvas are drawn on.
DRAWN_PIXELS: Final = """(canvas) => {
  const { data } = canvas.getContext("2d").getImageData(0, 0, canvas.width, canvas.height);
  return data.reduce((drawn, value, at) => drawn + (at % 4 === 3 && value > 0), 0);
}"""


@pytest.fixture(scope="module")
def layered(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("layered"), PANEL + LAYERS) as server:
        yield server


def pixels(page: Page) -> int:
    page.evaluate(DRAWN)
    return int(page.locator("canvas.map-points").evaluate(DRAWN_PIXELS))


def test_layers_are_drawn_and_what_is_missing_is_named(layered: Server, page: Page) -> None:
    opened(page, layered)
    root = widget(page, "hall")
    expect(root.locator(".map-shapes polyline")).to_have_attribute("points", re.compile(r"^\d+ \d+ "))
    expect(root.locator(".map-costs img")).to_have_count(1)
    until(lambda: pixels(page) > 100, "the scan is drawn")
    expect(root.locator(".map-note")).to_have_text("Position uncertainty: waiting for data")


def test_a_layer_that_the_operator_hides_stays_hidden_in_this_browser(
    layered: Server, page: Page
) -> None:
    opened(page, layered)
    root = widget(page, "hall")
    until(lambda: pixels(page) > 100, "the scan is drawn")
    root.get_by_role("button", name="Layers").click()
    for name in ("Laser scan", "Costmap", "Position uncertainty"):
        row = root.get_by_role("group", name="Layers").get_by_role("button", name=name)
        expect(row).to_have_attribute("aria-pressed", "true")
        assert place(row)["height"] >= 44
        row.click()
        expect(row).to_have_attribute("aria-pressed", "false")
    until(lambda: pixels(page) == 0, "the scan is hidden")
    expect(root.locator(".map-costs img")).to_be_hidden()
    expect(root.locator(".map-note")).to_be_hidden()
    page.reload()
    expect(root).to_have_attribute("data-version", VERSION)
    expect(root.locator(".map-shapes polyline")).to_have_count(1)
    assert pixels(page) == 0
    expect(root.locator(".map-note")).to_be_hidden()
    root.get_by_role("button", name="Layers").click()
    root.get_by_role("button", name="Laser scan").click()
    until(lambda: pixels(page) > 100, "the scan is drawn again")


def test_the_list_of_layers_is_used_by_keys(layered: Server, page: Page) -> None:
    opened(page, layered)
    root = widget(page, "hall")
    opener = root.get_by_role("button", name="Layers")
    expect(opener).to_have_attribute("aria-expanded", "false")
    opener.focus()
    page.keyboard.press("Enter")
    expect(opener).to_have_attribute("aria-expanded", "true")
    page.keyboard.press("Tab")
    scan = root.get_by_role("button", name="Laser scan")
    expect(scan).to_be_focused()
    page.keyboard.press("Space")
    expect(scan).to_have_attribute("aria-pressed", "false")
    page.keyboard.press("Escape")
    expect(opener).to_be_focused()
    expect(scan).to_be_hidden()


# Where the plan's lower left corner is, and the map's point (-2, -1), in pixels of the view.
PLAN_AT: Final = """async (root) => {
  const scripts = performance.getEntriesByType("resource");
  const { name } = scripts.find(({ name }) => name.endsWith("/kinds/map.js"));
  const { x, y } = (await import(name)).viewOf(root).at(-2, -1);
  const view = root.querySelector(".map-view").getBoundingClientRect();
  const plan = root.querySelector(".map-plan img");
  const box = plan.getBoundingClientRect();
  return { x, y, left: box.left - view.left, bottom: box.bottom - view.top, width: plan.naturalWidth };
}"""


def test_routes_and_a_plan_of_files_are_in_their_place_and_can_be_hidden(
    tmp_path: Path, touchscreen: Page
) -> None:
    panel = put_files(tmp_path).replace("-1.0, 0.5]", "-1.0, 0.0]")
    with demo_server(tmp_path, panel) as server:
        page = opened(touchscreen, server)
        routes, plan = page.locator(".map-routes"), page.locator(".map-plan")
        expect(routes).to_have_attribute("data-edges", "3")
        until(lambda: routes.evaluate(DRAWN_PIXELS) > 500, "the routes are drawn")
        until(lambda: widget(page, "hall").evaluate(PLAN_AT)["width"] == 40, "the plan is loaded")
        page.evaluate(DRAWN)
        at = widget(page, "hall").evaluate(PLAN_AT)
        assert (at["left"], at["bottom"]) == (
            pytest.approx(at["x"], abs=2),
            pytest.approx(at["y"], abs=2),
        )
        key(page, "Layers")
        for name, mark in (("Routes", routes), ("Plan", plan)):
            key(page, name)
            expect(mark).to_be_hidden()
        page.reload()
        expect(widget(page, "hall")).to_have_attribute("data-version", VERSION)
        expect(routes).to_have_attribute("data-edges", "3")
        expect(routes).to_be_hidden()
        expect(plan).to_be_hidden()
