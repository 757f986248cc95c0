"""No text of the shipped panel and of the examples is cut or broken inside a word, at any size and in
any language."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from app.system.texts.catalogue import sentences
from tests.browser.test_widths_in_browser import opened
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN, settled
from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.servers import ready
from tests.support.users import add_user

pytestmark = pytest.mark.promise("layout")

SIZES: Final = ((1920, 1080), (1280, 800), (1024, 600), (800, 480), (800, 1280))
PANELS: Final = {
    "shipped": SHIPPED,
    "example": ROOT / "docs/examples/palletizer.toml",
    "oven": ROOT / "docs/examples/oven.toml",
    "plan": ROOT / "docs/examples/plan/panel.toml",
    "gripper": ROOT / "docs/examples/lab-gripper/panel.toml",
    "mobile": ROOT / "docs/examples/mobile-robot/panel.toml",
    "welding": ROOT / "docs/examples/welding-cell/panel.toml",
}
# Texts beyond the box that cuts them, and tabs that are broken inside a word. Left out: what a touch
# shows whole (reasons and receipts), who has control beside its sign, a title beside a long state,
# limits of parameters, words of gauges, cells of tables, all but the first line of an alarm's action.
CUT: Final = """() => {
  const LEFT_OUT =
    "h1, .who, .why, .reasons, .receipt, .result, [data-kind=parameter] .limits, .said, td, " +
    ".alarm-line [data-text=action], script, template";
  const found = [];
  const texts = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  const rects = (element) => {
    const range = document.createRange();
    range.selectNodeContents(element);
    return [...range.getClientRects()].filter(({ width }) => width);
  };
  const isHidden = (element) => getComputedStyle(element).clipPath === "inset(50%)";
  const cuts = (element) => {
    const { display, overflow } = getComputedStyle(element);
    return display !== "inline" && overflow !== "visible" && !/auto|scroll/.test(overflow);
  };
  while (texts.nextNode()) {
    const element = texts.currentNode.parentElement;
    if (!texts.currentNode.data.trim() || !element.checkVisibility()) continue;
    if (!element.getBoundingClientRect().width && element.closest("svg")) continue;
    if (element.closest(LEFT_OUT)) continue;
    let box = element;
    while (box !== document.body && !cuts(box) && !isHidden(box)) box = box.parentElement;
    if (box === document.body || isHidden(box)) continue;
    const { left, right, bottom } = box.getBoundingClientRect();
    const end = element.closest(".places") ? Infinity : bottom - 4;  // a list of places scrolls
    const isCut = (rect) => rect.right > right + 1.5 || rect.left < left - 1.5 || rect.top > end;
    const text = texts.currentNode;
    if (rects(text).some(isCut)) found.push(`${box.className}: ${text.data.trim()}`);
  }
  for (const tab of document.querySelectorAll(".pages a span")) {
    const lines = new Set(rects(tab).map(({ top }) => Math.round(top)));
    if (lines.size > 1 && !/[ \\u00ad]/.test(tab.textContent)) found.push(`tab: ${tab.textContent}`);
  }
  return found;
}"""


@pytest.fixture(scope="module", params=PANELS)
def server(request: pytest.FixtureRequest) -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(PANELS[request.param]))) as mine:
        yield mine


@pytest.mark.long("every screen")
@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_no_text_is_cut_at_any_size(server: Server, page: Page, language: str) -> None:
    page.context.add_cookies([{"name": "kiosk_language", "value": language, "url": server.url}])
    page.goto(server.url)
    paths = page.locator(".pages a").evaluate_all("(tabs) => tabs.map((tab) => tab.href)")
    for path in paths or [server.url]:
        opened(page, server, language, path.removeprefix(server.url))
        for width, height in SIZES:
            sized(page, width, height).evaluate(DRAWN)
            tabs = page.locator(".group-tab:visible")
            for number in range(max(1, tabs.count())):
                if tabs.count():
                    tabs.nth(number).click()
                assert settled(page, CUT) == [], (path, width, height, number)


CUT_REASONS: Final = """() => [...document.querySelectorAll("[data-widget] .why")]
  .filter((why) => why.checkVisibility({ visibilityProperty: true }))
  .map((why) => {
    const range = document.createRange();
    range.selectNodeContents(why);
    const { right, bottom } = why.getBoundingClientRect();
    const rects = [...range.getClientRects()].filter(({ width }) => width);
    const isCut = rects.some((rect) => rect.right > right + 1 || rect.top > bottom - 4);
    return [why.closest("[data-widget]").dataset.widget, why.textContent.trim(), isCut];
  })"""


@pytest.mark.long("detail")
@pytest.mark.parametrize("language", ["en", "ja", "de"])
def test_the_lock_of_a_role_is_whole_on_every_button(tmp_path: Path, page: Page, language: str) -> None:
    data = tmp_path / "data"
    data.mkdir(mode=0o700)
    add_user(data, "M. Sato", "engineer", pin="2580")
    page.context.clear_cookies()
    with ready(Server(ROOT, KIOSK_PANEL=str(SHIPPED), KIOSK_DATA=str(data))) as server:
        page.context.add_cookies([{"name": "kiosk_language", "value": language, "url": server.url}])
        cut, seen = [], 0
        parts = sentences(language)["role_needed"].split("{role}")
        for path in ("/pages/cell", "/pages/recipe", "/pages/operation"):
            opened(page, server, language, path)
            needed = page.locator('[data-widget] [data-text="reason"]', has_text=max(parts, key=len))
            expect(needed.first).to_be_attached()
            for width, height in SIZES:
                sized(page, width, height).evaluate(DRAWN)
                tabs = page.locator(".group-tab:visible")
                for number in range(max(1, tabs.count())):
                    if tabs.count():
                        tabs.nth(number).click()
                        page.evaluate(DRAWN)
                    # On a busy machine a page may have lost its server for a moment.
                    reasons = page.evaluate(CUT_REASONS)
                    shown = [why for why in reasons if all(part in why[1] for part in parts)]
                    seen += len(shown)
                    cut += [
                        f"{path} {width}x{height} {w}: {text}" for w, text, is_cut in shown if is_cut
                    ]
        assert not cut, "\n".join(cut)
        assert seen > 20
