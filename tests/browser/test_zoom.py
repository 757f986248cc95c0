"""A browser that shows the page at 200 % (WCAG 2.2): what starts, stops and resets stays in view."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from app.system.texts.catalogue import files as languages
from app.web.language import COOKIE as LANGUAGE
from tests.support.browser.browsers import ReusedPage
from tests.support.browser.pages import DRAWN, place
from tests.support.parts import Server

pytestmark = pytest.mark.long("every screen")

WIDTH, HEIGHT = 640, 400  # of 1280x800
TOUCH: Final = 44
# Whether the button itself, or its face, is what a finger in its middle reaches.
ON_TOP: Final = """(button) => {
  const { x, y, width, height } = button.getBoundingClientRect();
  const there = document.elementFromPoint(x + width / 2, y + height / 2);
  return there?.closest("[data-widget]") === button.closest("[data-widget]");
}"""


@pytest.fixture(scope="module")
def zoomed_page(chromium: Browser) -> Iterator[ReusedPage]:
    mine = ReusedPage(chromium, device_scale_factor=2)
    yield mine
    mine.close()


@pytest.fixture
def zoomed(zoomed_page: ReusedPage, request: pytest.FixtureRequest) -> Iterator[Page]:
    with zoomed_page.taken(request.node) as page:
        page.set_viewport_size({"width": WIDTH, "height": HEIGHT})
        yield page


@pytest.mark.parametrize("language", sorted(languages()))
def test_start_stop_and_reset_stay_in_view_at_200_percent(
    shipped: Server, zoomed: Page, language: str
) -> None:
    zoomed.context.add_cookies([{"name": LANGUAGE, "value": language, "url": shipped.url}])
    zoomed.goto(f"{shipped.url}/pages/cell")
    expect(zoomed.locator("[data-widget=stop] > button:not(.more)")).to_be_enabled()
    zoomed.evaluate(DRAWN)
    for widget in ("start", "pause", "reset", "stop"):
        button = zoomed.locator(f"[data-widget={widget}] > button:not(.more)")
        box = place(button)
        assert min(box["width"], box["height"]) >= TOUCH, widget
        assert 0 <= box["x"] <= WIDTH - box["width"], widget
        assert 0 <= box["y"] <= HEIGHT - box["height"], widget
        assert button.evaluate(ON_TOP), widget
    menu = place(zoomed.locator(".menu-key"))
    assert menu["x"] + menu["width"] <= WIDTH
