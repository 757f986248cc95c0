"""The other robots on a map as an operator uses them: a finger or the keyboard opens a robot's page."""

import re
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, Final

import pytest
from playwright.sync_api import Error, Page, expect

from tests.support.browser.finger import Touch
from tests.support.browser.pages import DRAWN, widget
from tests.support.parts import Server, until
from tests.support.servers import demo_server
from tests.web.test_map_robots import MAP, ROBOTS

pytestmark = pytest.mark.promise("values")

VERSION: Final = re.compile("[0-9a-f]{16}")
OTHER: Final = ".map-others > [data-state='live']:not([hidden])"
# A place on the other robot, on the side that is away from the page's own: both move.
BESIDE: Final = """(root) => {
  const [own, other] = [".map-robot > circle", ".map-others circle"].map((part) => {
    const box = root.querySelector(part).getBoundingClientRect();
    return { x: box.left + box.width / 2, y: box.top + box.height / 2 };
  });
  const turn = Math.atan2(other.y - own.y, other.x - own.x);
  return [other.x + 9 * Math.cos(turn), other.y + 9 * Math.sin(turn)];
}"""


@pytest.fixture(scope="module")
def shuttles(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("shuttles"), ROBOTS + MAP) as server:
        yield server


def opened(page: Page, server: Server) -> Page:
    page.goto(f"{server.url}/robots/left/pages/main")
    expect(widget(page, "hall")).to_have_attribute("data-version", VERSION)
    expect(page.locator(OTHER)).to_have_count(1)
    return page


def key(page: Page) -> Any:
    return widget(page, "hall").get_by_role("button", name="Robots on this map")


def test_the_other_robot_has_its_name(shuttles: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttles)
    expect(page.locator(f"{OTHER} .map-name")).to_have_text("Shuttle 2")


def test_without_the_server_no_robot_is_shown_as_live(shuttles: Server, page: Page) -> None:
    opened(page, shuttles)
    arrow = page.locator(f"{OTHER} path")
    expect(arrow).to_be_visible()
    page.evaluate("document.body.dataset.cut = ''")
    expect(arrow).to_be_hidden()
    expect(page.locator(f"{OTHER} text").first).to_be_visible()


def test_a_finger_on_the_other_robot_opens_its_page(shuttles: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttles)
    touch = Touch(page)

    def is_opened() -> bool:
        with suppress(Error):  # the page is left
            touch.send("touchStart", tuple(widget(page, "hall").evaluate(BESIDE)))
            touch.send("touchEnd")
            page.evaluate(DRAWN)
        return page.url == f"{shuttles.url}/robots/right/pages/main"

    until(is_opened, "the robot's page is open")
    expect(widget(page, "hall")).to_have_attribute("data-version", VERSION)


def test_a_finger_beside_the_robots_moves_the_map(shuttles: Server, touchscreen: Page) -> None:
    page = opened(touchscreen, shuttles)
    box = page.locator(".map-view").bounding_box()
    assert box is not None
    corner = box["x"] + 12, box["y"] + 12
    touch = Touch(page)
    touch.send("touchStart", corner)
    touch.send("touchEnd")
    page.evaluate(DRAWN)
    assert page.url == f"{shuttles.url}/robots/left/pages/main"


def test_the_keyboard_opens_the_list_and_a_robots_page(shuttles: Server, page: Page) -> None:
    opened(page, shuttles)
    key(page).focus()
    page.keyboard.press("Enter")
    expect(key(page)).to_have_attribute("aria-expanded", "true")
    row = page.get_by_role("link", name="Shuttle 2", exact=True).and_(page.locator("[data-on-map]"))
    expect(row).to_be_visible()
    row.focus()
    page.keyboard.press("Escape")
    expect(row).to_be_hidden()
    expect(key(page)).to_be_focused()
    page.keyboard.press("Enter")
    row.focus()
    page.keyboard.press("Enter")
    expect(page).to_have_url(f"{shuttles.url}/robots/right/pages/main")
