"""Widgets whose label is not seen: it is still their name. Shipped panels say nothing twice."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from app.panel import load_panel
from app.system.texts.text import alike
from app.web.pages.display_choice import CHOICES
from tests.browser.test_accessibility import reused_page, violations
from tests.support.parts import ROOT, SHIPPED, Server
from tests.support.servers import demo_server

__all__ = ["reused_page"]

WIDGET: Final = "[[page.group.widget]]\n"
KEYS: Final = ("publish", "call", "action", "hold")
EXAMPLES: Final = (SHIPPED, *sorted((ROOT / "docs/examples").rglob("*.toml")))
# The texts of labels that are seen, of widgets whose label must not be.
SEEN: Final = """() => [...document.querySelectorAll(".unlabelled [data-widget]")].flatMap((widget) => {
  const isSeen = (part) => {
    const { width, height } = part.getBoundingClientRect();
    return part.checkVisibility({ opacityProperty: true }) && width > 1 && height > 1;
  };
  const onFace = widget.matches(".key, .action") ? ", .face > .label" : "";
  const labels = widget.querySelectorAll(`h3, label:not(.switch)${onFace}`);
  const isSequence = widget.matches('[data-kind="sequence"]:not([data-mode="usual"])');
  return isSequence ? [] : [...labels].filter(isSeen).map((label) => label.textContent);
})"""


def unlabelled() -> str:
    """The shipped panel, whose buttons have icons, with no label that is seen."""

    def without(block: str) -> str:
        kind = re.search(r'^kind = "(\w+)"', block, re.MULTILINE)
        assert kind is not None
        if kind[1] == "label" or "\nshow_label = " in block.partition("\n\n")[0]:
            return block
        has_icon = "\nicon = " in block.partition("\n\n")[0] or kind[1] not in KEYS
        icon = "" if has_icon else 'icon = "upload"\n'
        return block.replace(kind[0], f"{kind[0]}\nshow_label = false\n{icon}", 1)

    first, *blocks = SHIPPED.read_text().split(WIDGET)
    return WIDGET.join([first, *map(without, blocks)])


@pytest.fixture(scope="module")
def bare(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("panel"), unlabelled()) as mine:
        yield mine


HIDDEN_LABEL: Final = "label-title-only"  # that an input has no label which is seen, as the panel says


@pytest.mark.long("detail")
def test_a_label_that_is_not_seen_is_still_the_name(bare: Server, page: Page) -> None:
    for described in load_panel(SHIPPED).pages:
        page.goto(f"{bare.url}/pages/{described.id}")
        expect(page.locator("[data-widget=stop] > button:not(.more)")).to_be_enabled()
        expect(page.locator(".unlabelled").first).to_be_attached()
        assert page.evaluate(SEEN) == [], described.id
        others = [v for v in violations(page, CHOICES["theme"][:1]) if v[1] != HIDDEN_LABEL]
        assert others == [], described.id
    page.goto(f"{bare.url}/pages/cell")
    for name in ("Start", "Pause", "Reset", "Pallet out", "Back"):
        button = page.locator(".unlabelled").get_by_role("button", name=name, exact=True)
        expect(button).to_be_attached()
        expect(button.locator("xpath=..").locator(".face > .icon")).to_be_visible()
    expect(page.get_by_role("group", name="Boxes", exact=True)).to_be_attached()
    expect(page.get_by_label("Speed", exact=True)).to_be_attached()


@pytest.mark.long("table")
@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_no_shipped_panel_says_its_group_twice(path: Path) -> None:
    twice: list[Any] = [
        (page.id, widget.id)
        for page in load_panel(path).pages
        for group in page.parts
        for widget in group.widgets
        if group.title and widget.show_label and alike(group.title, widget.label)
    ]
    assert twice == []
