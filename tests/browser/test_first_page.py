"""The first page that a browser shows: its fonts come after the first button that works."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Browser, BrowserContext, Page, Route, expect

from tests.support.parts import Server, until

FONTS: Final = "/fonts/"
LOADED: Final = """() => [...document.fonts]
  .filter(({ status }) => status === "loaded")
  .map(({ family }) => family.replaceAll('"', ""))"""
PRESSED: Final = "[type=submit], .hold, input, select"
PLACES: Final = f"""() => [...document.querySelectorAll("{PRESSED}")].map((button) => {{
  const {{ left, top, right, bottom }} = button.getBoundingClientRect();
  return [left, top, right, bottom];
}})"""


@pytest.fixture
def new_browser(chromium: Browser) -> Iterator[BrowserContext]:
    """Has no cookie, and nothing in its cache."""
    context = chromium.new_context(locale="en", viewport={"width": 1280, "height": 800})
    yield context
    context.close()


def requests_of(page: Page) -> list[str]:
    urls: list[str] = []
    page.on("request", lambda request: urls.append(request.url))
    return urls


def test_fonts_come_after_the_events_and_are_shown_where_no_button_moves(
    shipped: Server, new_browser: BrowserContext
) -> None:
    page = new_browser.new_page()
    urls = requests_of(page)
    held: list[Route] = []
    page.route("**/fonts/**", lambda route: held.append(route))
    page.goto(f"{shipped.url}/pages/operation")
    button = page.get_by_role("button", name="Publish", exact=True)
    expect(button).to_be_enabled()
    until(lambda: page.evaluate("true") and len(held) == 2, "both fonts are requested")
    first_font = next(place for place, url in enumerate(urls) if FONTS in url)
    assert any("/events" in url for url in urls[:first_font])
    expect(page.locator("html[data-fonts]")).to_have_count(0)
    before = page.evaluate(PLACES)
    for route in held:
        route.continue_()
    expect(page.locator("html[data-fonts]")).to_be_attached()
    assert page.evaluate(LOADED) == 2 * ["IBM Plex Sans"]
    for old, new in zip(before, page.evaluate(PLACES), strict=True):
        assert new == pytest.approx(old, abs=1)


def test_the_next_page_comes_with_its_fonts(shipped: Server, new_browser: BrowserContext) -> None:
    page = new_browser.new_page()
    page.goto(f"{shipped.url}/pages/operation")
    until(lambda: page.evaluate("document.cookie") == "kiosk_fonts=kept", "it has the fonts")
    page.goto(f"{shipped.url}/pages/recipe")
    expect(page.locator("html[data-fonts]")).to_be_attached()
    preloads = page.locator("link[rel=preload][as=font]")
    expect(preloads).to_have_count(2)
