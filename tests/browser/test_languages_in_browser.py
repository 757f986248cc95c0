"""The frame in each language: no word is broken or cut, and a new state moves nothing beside it."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from app.system.texts import render, say
from app.system.texts.catalogue import files
from app.web.language import COOKIE
from tests.browser.test_layout_in_browser import PANEL
from tests.browser.test_screen_in_browser import CUT, OVERFLOWS
from tests.support.browser.pages import DRAWN, settled
from tests.support.parts import Server
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("every screen")

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
STATES: Final = ("online", "unknown", "lost")
# What reaches out of the header: a word that is broken into its characters does.
BEYOND: Final = """() => {
  const end = document.querySelector("header").getBoundingClientRect().bottom;
  return [...document.querySelectorAll("header > *, .control > button")]
    .filter((one) => one.checkVisibility())
    .filter((one) => {
      const { top, bottom } = one.getBoundingClientRect();
      return top < 0 || bottom > end + 1;
    })
    .map((one) => one.textContent.trim());
}"""
# Where what is beside the state begins, with each of these words.
BESIDE: Final = """(words) => {
  const state = document.querySelector("#state b"), before = state.textContent;
  const places = words.map((word) => {
    state.textContent = word;
    return document.querySelector("#banner").getBoundingClientRect().left;
  });
  state.textContent = before;
  return places;
}"""
LINES: Final = """(one) => {
  const text = document.createRange();
  text.selectNodeContents(one);
  return text.getClientRects().length;
}"""
# How many lines of a long text a key's face has room for; the key may be locked or not.
PAINTED: Final = """(texts) => {
  for (const one of texts) one.textContent = "操作権を持つパネルがありません。".repeat(20);
  const seen = texts.find((one) => one.checkVisibility());
  return seen.clientHeight / parseFloat(getComputedStyle(seen).lineHeight);
}"""


@pytest.fixture(scope="module")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), PANEL) as mine:
        yield mine


@pytest.fixture(params=sorted(files()))
def language(request: pytest.FixtureRequest, server: Server, page: Page) -> str:
    page.context.add_cookies([{"name": COOKIE, "value": request.param, "url": server.url}])
    return str(request.param)


def test_the_frame_has_room_for_its_words(server: Server, page: Page, language: str) -> None:
    page.goto(server.url)
    expect(page.locator("#banner")).to_have_text(render(say("simulated"), language))
    words = [render(say(f"state_{state}"), language) for state in STATES]
    for width, height in SIZES:
        page.set_viewport_size({"width": width, "height": height})
        page.evaluate(DRAWN)
        assert settled(page, OVERFLOWS) == [], width
        assert settled(page, CUT) == [], width
        assert page.evaluate(BEYOND) == [], width
        assert len(set(page.evaluate(BESIDE, words))) == 1, width


def test_a_word_of_the_menu_is_not_broken_in_japanese(server: Server, page: Page) -> None:
    page.context.add_cookies([{"name": COOKIE, "value": "ja", "url": server.url}])
    page.set_viewport_size({"width": 800, "height": 480})
    page.goto(server.url)
    page.locator(".menu-key").click()
    key = page.locator('#menu button[value="contrast"]')
    expect(key).to_be_visible()
    assert key.evaluate(LINES) == 1


def test_lock_reason_shows_at_most_two_lines(server: Server, page: Page) -> None:
    page.context.add_cookies([{"name": COOKIE, "value": "ja", "url": server.url}])
    page.goto(server.url)
    texts = page.locator('[data-widget="allow"]').locator(".receipt, .why")
    assert texts.evaluate_all(PAINTED) == pytest.approx(2, abs=0.05)
