"""The contrast of every text with what is behind it, as the browser draws it: 7:1 (WCAG 2.2 AAA), of
large texts and those in an alarm's colour 4.5:1."""

from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from app.web.pages.display_choice import CHOICES, COOKIE
from tests.support.browser.browsers import sized
from tests.support.parts import Server

pytestmark = pytest.mark.long("every screen")

# Each group of a panel's page, each view of diagnostics, the pages of alarms, and the log.
PATHS: Final = (
    "/pages/cell",
    "/pages/operation",
    "/pages/recipe",
    "/pages/robot",
    "/pages/watch",
    "/log",
    "/help",
    "/alarms",
    "/alarms/history",
    *(f"/diagnostics?view={view}" for view in ("links", "topics", "graph")),
)
TALL: Final = (1280, 2400)  # nothing has to be scrolled to
# [text, colour, what is behind it, contrast] of the texts whose contrast is too small. A picture of the
# browser's own (an option, a placeholder) and a drawing's text, whose shape is behind it, are left out.
POOR: Final = """() => {
  const parts = (colour) => (colour.match(/[\\d.]+/g) ?? []).map(Number);
  const luminance = (colour) => {
    const [r, g, b] = parts(colour).map((part) => {
      const value = part / 255;
      return value <= 0.04045 ? value / 12.92 : ((value + 0.055) / 1.055) ** 2.4;
    });
    return 0.2126 * r + 0.7152 * g + 0.0722 * b;
  };
  const isOpaque = (colour) => parts(colour).length === 3 || parts(colour)[3] === 1;
  const probe = document.body.appendChild(document.createElement("i"));
  probe.style.color = "var(--alarm)";
  const alarm = getComputedStyle(probe).color;
  probe.remove();
  const poor = [];
  const walker = document.createTreeWalker(document.body, NodeFilter.SHOW_TEXT);
  for (let node; (node = walker.nextNode()); ) {
    const element = node.parentElement;
    const isShown = element.checkVisibility({ opacityProperty: true, visibilityProperty: true });
    if (!node.data.trim() || !isShown || element.closest("svg, option, script, style")) continue;
    const style = getComputedStyle(element);
    const range = document.createRange();
    range.selectNodeContents(node);
    const box = [...range.getClientRects()].find(({ width, height }) => width > 1 && height > 1);
    if (!box || style.clipPath !== "none") continue;
    const behind = document.elementsFromPoint(box.x + box.width / 2, box.y + box.height / 2)
      .concat(document.documentElement)
      .map((each) => getComputedStyle(each))
      .find(({ backgroundColor, backgroundImage }) =>
        isOpaque(backgroundColor) || backgroundImage !== "none");
    if (!behind || behind.backgroundImage !== "none") continue;
    const both = [luminance(style.color), luminance(behind.backgroundColor)];
    const ratio = (Math.max(...both) + 0.05) / (Math.min(...both) + 0.05);
    const size = parseFloat(style.fontSize);
    const isLarge = size >= 24 || (size >= 18.66 && Number(style.fontWeight) >= 600);
    if (ratio < (isLarge || style.color === alarm ? 4.5 : 7))
      poor.push([node.data.trim().slice(0, 40), style.color, behind.backgroundColor, ratio.toFixed(2)]);
  }
  return poor;
}"""


@pytest.mark.parametrize("theme", CHOICES["theme"])
def test_texts_of_every_page_have_the_contrast_of_aaa(shipped: Server, page: Page, theme: str) -> None:
    page.context.add_cookies([{"name": COOKIE.format("theme"), "value": theme, "url": shipped.url}])
    sized(page, *TALL)
    poor: dict[str, Any] = {}
    for path in PATHS:
        page.goto(shipped.url + path)
        expect(page.locator("html")).to_have_attribute("data-theme", theme)
        expect(page.locator("[data-widget=stop] > button:not(.more)")).to_be_enabled()
        assert page.evaluate("document.body.innerText.length") > 100
        if texts := page.evaluate(POOR):
            poor[path] = texts
    page.goto(f"{shipped.url}/pages/cell")
    expect(page.locator("[data-widget=stop] > button:not(.more)")).to_be_enabled()
    page.evaluate("pageGuard.fail('as the test says')")  # all is old and locked
    expect(page.locator("body[data-locked]")).to_be_attached()
    if texts := page.evaluate(POOR):
        poor["locked"] = texts
    assert poor == {}
