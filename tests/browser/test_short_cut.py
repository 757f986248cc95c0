"""A short cut of the link to the server: the page locks and says so, and nothing on it moves."""

from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from app.system.texts.catalogue import files as languages
from app.web.language import COOKIE as LANGUAGE
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, HIDE
from tests.support.parts import Server

pytestmark = pytest.mark.long("every screen")

SIZES: Final = ((1920, 1080), (1280, 800), (1024, 600), (800, 480), (640, 400), (390, 844))
# The places of the frame's and the page's parts. Why Acknowledge is locked stands on the button.
PLACES: Final = """() => {
  const shown = (part) => part.checkVisibility({ visibilityProperty: true })
    && getComputedStyle(part).clipPath === "none";
  const parts = [...document.querySelectorAll(
    "header > *, .alarm-line, .alarm-line > :not(.act-lock), .group, .cell, .frame-keys > *"
    + ", .pages > *")];
  return Object.fromEntries(parts.flatMap((part, number) => {
    if (!part.matches(".count") && !shown(part)) return [];
    const { x, y, width, height } = part.getBoundingClientRect();
    const isText = part.matches(".says"); // it is as high as its text
    const place = isText ? [x, width] : [x, y, width, height];
    return [[`${number} ${part.className || part.tagName}`, place]];
  }));
}"""


@pytest.mark.parametrize("language", sorted(languages()))
def test_nothing_moves_when_the_link_is_cut(shipped: Server, page: Page, language: str) -> None:
    page.context.add_cookies([{"name": LANGUAGE, "value": language, "url": shipped.url}])
    page.goto(shipped.url)
    expect(page.locator("html[data-floor]")).to_be_attached()
    for width, height in SIZES:
        expect(page.locator("body:not([data-cut])")).to_be_attached()
        sized(page, width, height).evaluate(DRAWN)
        before = page.evaluate(PLACES)
        page.evaluate(HIDE)
        expect(page.locator("body[data-cut]")).to_be_attached()
        page.evaluate(DRAWN)
        after = page.evaluate(PLACES)
        assert moved(before, after) == {}, (width, height)
        menu = page.locator(".menu-key")
        expect(menu).to_be_in_viewport(ratio=1)
        page.evaluate(HIDE, False)


def moved(before: dict[str, Any], after: dict[str, Any]) -> dict[str, Any]:
    names = before.keys() | after.keys()
    pairs = {name: (before.get(name), after.get(name)) for name in names}
    return {name: pair for name, pair in pairs.items() if not near(*pair)}


def near(first: list[float] | None, second: list[float] | None) -> bool:
    """Whether a part is where it was, to the pixel."""
    if first is None or second is None:
        return False
    return all(abs(before - after) < 1 for before, after in zip(first, second, strict=True))
