"""The widths that `check` computes are those of the browser: of texts, and of the places for them."""

import re
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from app.panel import Panel, load_panel
from app.panel.widgets.tiles import Screen
from app.panel.widths.boxes import Box
from app.panel.widths.cut_texts import KIOSK_SCREENS, boxes
from app.panel.widths.fonts import text_width
from app.panel.widths.texts import MANY
from app.system.texts import render
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN
from tests.support.parts import ROOT, SHIPPED, Server, until
from tests.support.servers import ready

pytestmark = pytest.mark.long("every screen")

PANELS: Final = (SHIPPED, ROOT / "docs/examples/palletizer.toml")
TEXTS: Final = (
    "Abbrechen",
    "Palette ausfahren",
    "Verteilung AV To Ta, VA.",
    "Größe über 144 Kartons − „Halt“",
    "−71.5 kPa",
    "The robot does not permit automatic operation.",
    "運転中",
    "「リセット」に触れます。",
    "エアー圧が十分 5.2 bar",
)
MEASURED: Final = """async (samples) => {
  const family = getComputedStyle(document.body).fontFamily;
  for (const weight of [400, 700]) await document.fonts.load(`${weight} 17px ${family}`, "aあ");
  const element = document.createElement("span");
  element.style.cssText = "position: absolute; white-space: pre;";
  document.body.append(element);
  const widths = samples.map(([text, size, bold]) => {
    element.style.fontSize = `${size}px`;
    element.style.fontWeight = bold ? 700 : 400;
    element.textContent = text;
    return element.getBoundingClientRect().width;
  });
  element.remove();
  return widths;
}"""
# Puts each text into its place and says whether it is cut there: beyond what is inside the box that
# cuts it, or a word in two lines. null: the place is not shown.
CUTS: Final = """(samples) => {
  const textNodes = (element) => {
    const walker = document.createTreeWalker(element, NodeFilter.SHOW_TEXT);
    const found = [];
    while (walker.nextNode()) if (walker.currentNode.data.trim()) found.push(walker.currentNode);
    return found;
  };
  const rects = (node, from, to) => {
    const range = document.createRange();
    range.setStart(node, from);
    range.setEnd(node, to);
    return [...range.getClientRects()].filter(({ width }) => width);
  };
  const lines = (node, { 0: word, index }) =>
    new Set(rects(node, index, index + word.length).map(({ top }) => Math.round(top))).size;
  const words = (node) => [...node.data.matchAll(/[^\\s\\u2e80-\\uffff]+/g)];
  const isBroken = (node) => words(node).some((word) => lines(node, word) > 1);
  const clips = (element) => {
    const { overflow, display } = getComputedStyle(element);
    const isBox = element.matches("button, a, .switch, body");
    return isBox || (overflow !== "visible" && display !== "inline");
  };
  const isCut = (element, keepsWords) => {
    if (element.matches("input")) return element.scrollWidth > element.clientWidth;
    let box = element;
    while (!clips(box)) box = box.parentElement;
    const style = getComputedStyle(box);
    const { left, right, bottom } = box.getBoundingClientRect();
    const begin = left + parseFloat(style.paddingLeft) + parseFloat(style.borderLeftWidth);
    const end = right - parseFloat(style.paddingRight) - parseFloat(style.borderRightWidth);
    const isBeyond = (rect) =>
      rect.right > end + 0.5 || rect.left < begin - 0.5 || rect.top > bottom - 4;
    const isWhole = (node) => !rects(node, 0, node.length).some(isBeyond);
    return textNodes(element).some((node) => !isWhole(node) || (keepsWords && isBroken(node)));
  };
  return samples.map(({ group, widget, selector, inner, text, after, locked, keepsWords }) => {
    for (const each of document.querySelectorAll(".group")) {
      each.classList.toggle("shown", Number(each.dataset.group) === group);
      delete each.dataset.said; // one reason for all its buttons, in place of the note
    }
    const root = widget ? document.querySelector(`[data-widget="${widget}"]`) : document;
    const button = root.querySelector?.(".key > button:not(.more), :scope > button:not(.more)");
    const isLocked = button?.disabled;
    if (button) button.disabled = locked;
    const reason = locked ? root.querySelector?.('.why [data-text="reason"]') : null;
    const said = reason?.textContent;
    if (reason && !said) reason.textContent = "…"; // a label has one line beside a reason
    if (widget) root.dataset.enabled = String(!locked);
    if (widget && "level" in root.dataset) root.dataset.level = "low"; // with its mark
    const element = root.querySelector(selector);
    const step = element?.closest("li[data-now]");
    if (step) [step.dataset.now, root.dataset.state] = ["now", "live"];
    if (element?.matches("[aria-pressed]")) element.ariaPressed = "true"; // with bold letters
    if (!element) return `${widget}: no ${selector}`;
    const place = inner ? element.querySelector(inner) : element;
    const kept = [element, element.cloneNode(true)];
    if (place.matches("input")) place.value = text;
    else place.textContent = text;
    if (after) element.querySelector('small, [data-text="rest"]').textContent = after;
    const isShown = element.checkVisibility() && place.checkVisibility();
    const result = isShown ? isCut(element, keepsWords) : null;
    kept[0].replaceWith(kept[1]);
    if (reason?.isConnected) reason.textContent = said;
    if (button) button.disabled = isLocked;
    return result;
  });
}"""
LETTERS: Final = {"en": "Start", "de": "Größe", "ja": "転"}
NEAR: Final = 2.0  # pixels
SETTLED_S: Final = 3.0
# Where a text stands, and where its letters are: by the kind of the widget and the part, or the part.
SPOTS: Final = {
    "label": ("h3", ""),
    "interlock": (".why", '[data-text="reason"]'),
    "note": (".face > .note", ""),
    "value": (".value", '[data-text="text"]'),
    "states": (".value", ""),
    "steps": ("li > p > span", ""),
    "number value": ("input", ""),
    "switch on": ('[data-position="on"]', ""),
    "switch off": ('[data-position="off"]', ""),
    "toggle off": (".off", ""),
    "link label": ("span", ""),
    **{f"{kind} label": (".face > .label", "") for kind in ("publish", "call", "hold", "action")},
    **{f"{kind} label": (".named > label", "") for kind in ("number", "slider")},
    **{f"{kind} label": (":scope > label", "") for kind in ("select", "text", "toggle")},
}
NOT_HERE: Final = (
    "label label",
    "table states",
    "conditions label",
    "parameter label",
    "sequence steps",
    "trend label",
)


@pytest.fixture(scope="module", params=PANELS, ids=["shipped", "example"])
def path(request: pytest.FixtureRequest) -> Path:
    return Path(request.param)


@pytest.fixture(scope="module")
def server(path: Path) -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(path), KIOSK_MODE="demo")) as mine:
        yield mine


def opened(page: Page, server: Server, language: str, path: str = "") -> None:
    """The page in a language, drawn with the panel's own fonts."""
    page.context.add_cookies([{"name": "kiosk_language", "value": language, "url": server.url}])
    width = """() => {
      const element = document.createElement("span");
      element.style.cssText = "position: absolute; font-size: 100px";
      element.innerHTML = "agW<b>agW</b>";
      document.body.append(element);
      return [element.getBoundingClientRect().width, element.remove()][0];
    }"""

    def has_fonts() -> bool:
        """A font that came late is used by the next visit."""
        page.goto(server.url + path)
        shown: float = page.evaluate(width)
        return abs(shown - text_width("agW", 100) - text_width("agW", 100, bold=True)) < NEAR

    until(has_fonts, "its fonts are there", every_s=0.3)
    expect(page.locator("html[data-floor]")).to_be_attached()


@pytest.mark.long("detail")
def test_a_text_is_as_wide_as_computed(server: Server, page: Page) -> None:
    opened(page, server, "ja")
    samples = [[text, size, bold] for text in TEXTS for size in (14, 17, 26) for bold in (False, True)]
    for (text, size, bold), width in zip(samples, page.evaluate(MEASURED, samples), strict=True):
        assert text_width(text, size, bold=bold) == pytest.approx(width, abs=1.5), (text, size, bold)


def text_of_width(box: Box, language: str, width: float) -> str:
    """The longest text without spaces that is no wider than this."""
    letters, text = LETTERS[language], ""
    while (
        text_width(longer := text + letters[len(text) % len(letters)], box.size, bold=box.bold) <= width
    ):
        text = longer
    return text


def sample_texts(box: Box, language: str) -> tuple[str, str]:
    """A text that has just room in its place, and one that is just cut. Japanese without spaces may
    begin on the second line."""
    width = box.width - (box.width_beside(language) if box.beside else 0.0)
    if box.wraps and language == "ja":
        rows = [int((width - indent) / box.size) for indent in (box.indent, *[0.0] * (box.lines - 1))]
        return "転" * (rows[0] - 1), "転" * (sum(rows) + 1) if box.lines < MANY else ""
    room = width
    if not box.wraps:
        after = render(box.after, language)
        room -= text_width(after, box.after_size or box.size, bold=box.after_bold)
    letters = LETTERS[language]
    fits, cut = (text_of_width(box, language, room + more) for more in (-NEAR, NEAR))
    return fits, cut + letters[len(cut) % len(letters)]


def places(panel: Panel, number: int, screen: Screen) -> Iterator[tuple[dict[str, Any], Box]]:
    """(where it is on the page, the place) of each text of a page."""
    page = panel.pages[number]
    for place, box in boxes(panel, screen):
        at = [int(each) for each in re.findall(r"\d+", place)]
        if place == f"page[{number}]":
            yield {"selector": f".pages a:nth-child({number + 1}) > span"}, box
        elif place.startswith(f"page[{number}].") and "widget" not in place:
            tab, heading = f'.group-tab[data-shows="{at[1]}"]', f'[data-group="{at[1]}"] > .head > h2'
            if box.part == "title":
                yield {"selector": tab if box.name == "tab" else heading, "group": at[1]}, box
        elif place.startswith((f"page[{number}].", "frame")):
            owner = page.groups[at[1]] if "page" in place else panel.frame
            widget = owner.widgets[at[-1]]
            part = re.split(r"[\[.]", box.part)[0]
            name = f"{widget.kind} {part}"
            spot = None if name in NOT_HERE else SPOTS.get(name) or SPOTS.get(part)
            if spot is not None:
                locked = part == "interlock" or box.locked
                where = {"widget": widget.id, "selector": spot[0], "inner": spot[1], "locked": locked}
                yield {**where, "group": at[1] if "page" in place else 0, "part": part}, box


def samples(panel: Panel, number: int, screen: Screen, language: str) -> Iterator[dict[str, Any]]:
    """A text that is cut and one that is not, for each place of a page."""
    for where, box in places(panel, number, screen):
        for text, cut in zip(sample_texts(box, language), (False, True), strict=True):
            if not text:
                continue
            yield {
                "group": 0,
                "widget": "",
                "inner": "",
                **where,
                "text": text,
                "after": render(box.after, language) if not box.wraps else "",
                "locked": where.get("locked", False),
                "keepsWords": box.wraps,
                "cut": cut,
            }


def compared(page: Page, wanted: Sequence[Mapping[str, Any]]) -> tuple[int, list[str]]:
    """How many samples are on the page, and those that are not as computed once that is so for some
    seconds: an event may change the page after it was sized."""
    ends = time.monotonic() + SETTLED_S
    while True:
        cuts = page.evaluate(CUTS, wanted)
        unlike = [
            f"{sample['widget']} {sample['selector']}: {sample['text']}: {cut}"
            for sample, cut in zip(wanted, cuts, strict=True)
            if cut not in (None, sample["cut"])
        ]
        if not unlike or time.monotonic() > ends:
            return sum(cut is not None for cut in cuts), unlike
        page.wait_for_timeout(100)


@pytest.mark.parametrize("language", ["en", "de", "ja"])
def test_what_check_calls_cut_is_cut_on_the_page_and_nothing_else(
    path: Path, server: Server, page: Page, language: str
) -> None:
    panel = load_panel(path)
    wrong: list[str] = []
    seen = 0
    for number, described in enumerate(panel.pages):
        opened(page, server, language, f"/pages/{described.id}")
        for size in KIOSK_SCREENS:
            screen = Screen.from_size(size, panel.mm_per_px)
            sized(page, screen.width, screen.height).evaluate(DRAWN)
            wanted = list(samples(panel, number, screen, language))
            shown, unlike = compared(page, wanted)
            seen += shown
            wrong += [f"{size} {text}" for text in unlike]
    assert not wrong, "\n".join(wrong)
    assert seen > 100
