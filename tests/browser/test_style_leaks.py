"""Parts of the frame and of widgets look alike on every page: style sheets reach no other's parts."""

from typing import Final

import pytest
from playwright.sync_api import Page, expect

from tests.support.parts import Server

PAGES: Final = ("/", "/log", "/alarms", "/diagnostics")
STOP_WITHIN: Final = 6  # presses of Tab: what the header and the line of alarms have comes before it
SHAPES: Final = """(state) => {
  state.dataset.shape = "cross";
  return [...state.querySelectorAll(".lamp > *")]
    .filter((shape) => getComputedStyle(shape).display !== "none")
    .map((shape) => shape.getAttribute("class"));
}"""
FOCUSED: Final = "() => document.activeElement.closest('[data-widget]')?.dataset.widget ?? ''"
MESSAGE_INSET: Final = """(text) => {
  const range = document.createRange();
  range.selectNodeContents(text);
  return range.getBoundingClientRect().x - text.getBoundingClientRect().x;
}"""


def test_the_state_has_one_shape_and_stop_is_early_on_every_page(shipped: Server, page: Page) -> None:
    for path in PAGES:
        page.goto(shipped.url + path)
        expect(page.locator("html[data-floor]")).to_be_attached()
        assert page.locator(".machine-state").evaluate(SHAPES) == ["cross"], path
        reached = []
        for _ in range(STOP_WITHIN):
            page.keyboard.press("Tab")
            reached.append(page.evaluate(FOCUSED))
        assert "stop" in reached, path


@pytest.mark.long("detail")
def test_what_a_node_writes_begins_beside_its_name(shipped: Server, page: Page) -> None:
    page.set_viewport_size({"width": 1920, "height": 1080})
    page.goto(f"{shipped.url}/pages/watch")
    text = page.locator("[data-kind=log] .line > .text").first
    expect(text).to_be_visible()
    assert text.evaluate(MESSAGE_INSET) < 1
