"""A Stop that can't be sent says first what to use instead, whole on its button, and the menu stays on
the screen: without the robot and without the panel server, in each language, at each size."""

from collections.abc import Iterator
from itertools import product
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Browser, Page, expect

from app.system.texts import render, say
from app.system.texts.catalogue import files
from tests.support.browser.browsers import opened
from tests.support.parts import ROOT, SHIPPED, Server

pytestmark = pytest.mark.promise("stop")

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
NOWHERE: Final = '{ mode: "peer", connect: { endpoints: ["tcp/127.0.0.1:1"] } }'
# The place of the hint's last letter on the button, and where the button's text ends.
HINT: Final = """([why, length]) => {
  const text = why.querySelector('[data-text="reason"]').firstChild, range = document.createRange();
  range.setStart(text, length - 1);
  range.setEnd(text, length);
  const last = range.getBoundingClientRect(), box = why.getBoundingClientRect();
  return { below: last.bottom - box.bottom, beyond: last.right - box.right, text: text.data };
}"""


@pytest.fixture
def server(tmp_path: Path) -> Iterator[Server]:
    """With a robot that can't be reached."""
    zenoh = tmp_path / "zenoh.json5"
    zenoh.write_text(NOWHERE)
    mine = Server(ROOT, KIOSK_MODE="live", KIOSK_PANEL=str(SHIPPED), KIOSK_ZENOH=str(zenoh))
    yield mine
    mine.end()


@pytest.fixture
def pages(chromium: Browser) -> Iterator[list[tuple[str, Page]]]:
    contexts, made = [], []
    for (width, height), language in product(SIZES, sorted(files())):
        options: dict[str, Any] = {"viewport": {"width": width, "height": height}, "locale": language}
        contexts.append(opened(chromium, **options))
        made.append((language, contexts[-1].new_page()))
    yield made
    for context in contexts:
        context.close()


def check(page: Page, language: str) -> None:
    why = page.locator('.frame-keys [data-role="stop"] .why')
    expect(page.locator("#state")).to_have_attribute("data-state", "lost")
    hint = render(say("stop_hint"), language)
    expect(why.locator('[data-text="reason"]')).to_contain_text(hint)
    place = page.evaluate(HINT, [why.element_handle(), len(hint)])
    assert place["text"].startswith(hint)
    size = page.viewport_size
    assert max(place["below"], place["beyond"]) < 1, (size, language, place)
    menu = page.locator(".menu-key").bounding_box()
    assert menu is not None
    assert size is not None
    assert menu["x"] + menu["width"] <= size["width"], (size, language)
    assert page.evaluate("document.documentElement.scrollWidth") == size["width"]


def test_stop_says_first_what_to_use_and_the_menu_stays(
    server: Server, pages: list[tuple[str, Page]]
) -> None:
    for _, page in pages:
        page.goto(server.url)
    for language, page in pages:
        check(page, language)
    server.process.kill()
    for language, page in pages:
        expect(page.locator("body[data-cut]")).to_be_attached()
        check(page, language)
