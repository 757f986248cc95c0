"""What `app.check` computes of pages that fit, held against a browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from app.panel import Panel, load_panel
from app.panel.checks.fit import group_width, page_height, page_width, reason, row_heights
from app.panel.widgets.tiles import LOW_SCREEN, TOUCH, Screen
from tests.support.browser.pages import DRAWN, ROWS, place
from tests.support.parts import ROOT, Server
from tests.support.servers import ready

pytestmark = pytest.mark.promise("layout")

PALLETIZER: Final = ROOT / "docs/examples/palletizer.toml"
SCREENS: Final = ("1920x1080", "1280x800", "1024x600", "800x480", "800x1280")
MEASURE: Final = """() => {
  const inside = (e) => {
    const style = getComputedStyle(e);
    return {
      width: e.clientWidth - 2 * parseFloat(style.paddingLeft),
      height: e.clientHeight - 2 * parseFloat(style.paddingTop),
    };
  };
  const groups = [...document.querySelectorAll(".group")].filter((g) => g.checkVisibility());
  return {
    main: inside(document.querySelector("main")),
    groups: groups.map((g) => ({ number: Number(g.dataset.group), width: inside(g).width })),
    outside: [...document.querySelectorAll("main, .group, .grid, .cell, header, .pages")]
      .filter((e) => e.scrollWidth > e.clientWidth + 1 || e.scrollHeight > e.clientHeight + 1)
      .map((e) => e.className || e.tagName),
  };
}"""


@pytest.fixture(scope="module")
def panel() -> Panel:
    return load_panel(PALLETIZER)


@pytest.fixture(scope="module")
def demo() -> Iterator[Server]:
    with ready(Server(ROOT, KIOSK_PANEL=str(PALLETIZER))) as mine:
        yield mine


def sized(page: Page, panel: Panel, size: str) -> Screen:
    """The screen of a size, once the page is drawn on it."""
    screen = Screen.from_size(size, panel.mm_per_px)
    page.set_viewport_size({"width": screen.width, "height": screen.height})
    page.evaluate(DRAWN)
    return screen


@pytest.mark.parametrize("page_number", [0, 2], ids=["three groups", "one group"])
def test_sizes_are_those_of_the_browser(
    demo: Server, panel: Panel, page: Page, page_number: int
) -> None:
    cell = panel.pages[page_number]
    page.goto(f"{demo.url}/pages/{cell.id}")
    expect(page.locator(".group").first).to_be_visible()
    for size in SCREENS:
        screen = sized(page, panel, size)
        assert reason(panel, cell, screen) == ""
        measured: Any = page.evaluate(MEASURE)
        assert measured["outside"] == [], size
        assert measured["main"]["height"] == pytest.approx(page_height(panel, cell, screen), abs=1)
        width = page_width(panel, screen)
        assert measured["main"]["width"] == pytest.approx(width, abs=1)
        for group in measured["groups"]:
            described = cell.parts[group["number"]]
            inside = group_width(described, cell, screen, width)
            assert group["width"] == pytest.approx(inside, abs=1)
            rows = page.evaluate(ROWS, group["number"])
            assert rows == pytest.approx(row_heights(described, screen, inside), abs=1)


def test_keys_are_20_mm_high_and_5_mm_apart_on_every_screen(
    demo: Server, panel: Panel, page: Page
) -> None:
    page.goto(demo.url)
    for size in SCREENS:
        screen = sized(page, panel, size)
        boxes = [
            place(key)
            for key in page.locator(
                ".cell > .key > button:not(.more):visible, .action button:not(.more):visible"
            ).all()
        ]
        least = TOUCH if screen.height <= LOW_SCREEN else 20 * screen.mm  # beside a key that cancels
        assert len(boxes) >= 2
        assert all(box["height"] >= least - 0.5 for box in boxes), size
        start, reset = (
            place(page.locator(f"[data-widget={widget}] > button:not(.more)"))
            for widget in ("start", "reset")
        )
        assert min(start["width"], reset["width"]) >= 20 * screen.mm - 0.5
        assert reset["x"] - start["x"] - start["width"] >= 5 * screen.mm - 0.5, size


def test_stop_is_on_every_page_and_tab(demo: Server, page: Page) -> None:
    page.set_viewport_size({"width": 800, "height": 480})
    stop = page.get_by_role("button", name="Stop", exact=True)
    for path in ("/pages/cell", "/pages/setup"):
        page.goto(demo.url + path)
        expect(stop).to_be_visible()
        for tab in page.locator(".pages .group-tab:visible").all():
            tab.click()
            expect(stop).to_be_in_viewport()


STEPS: Final = """
title = "Steps"
mode = "demo"
screens = ["1920x1080", "1280x800", "1024x600", "800x480"]
[[page]]
id = "main"
title = "Main"
fit = true
[[page.group]]
title = "Jog"
columns = 4
span = 6
"""
QUARTER: Final = """
[[page.group.widget]]
id = "{name}"
kind = "step"
label = "{name}"
topic = "/set_{name}"
type = "std_msgs/msg/Float32"
message = {{ data = "{{value}}" }}
value = {{ topic = "/now_{name}", type = "std_msgs/msg/Float32" }}
min = 0
max = 100
step = 5
"""


@pytest.mark.long("detail")
def test_a_step_may_be_a_quarter_of_its_group(tmp_path: Path, page: Page) -> None:
    """Its value is above its buttons where it is too narrow for them side by side."""
    path = tmp_path / "steps.toml"
    path.write_text(STEPS + "".join(QUARTER.format(name=name) for name in ("x", "y", "z", "w")))
    panel = load_panel(path)
    cell, group = panel.pages[0], panel.pages[0].parts[0]
    with ready(Server(ROOT, KIOSK_PANEL=str(path))) as mine:
        page.goto(mine.url)
        for size in SCREENS[:-1]:
            screen = sized(page, panel, size)
            assert reason(panel, cell, screen) == ""
            width = group_width(group, cell, screen, page_width(panel, screen))
            (height,) = row_heights(group, screen, width)
            assert page.evaluate(ROWS, 0) == pytest.approx([height], abs=1)
            value, less, more = (
                place(page.locator(f"[data-widget=x] {part}"))
                for part in (".value", "[data-way=down]", "[data-way=up]")
            )
            assert value["y"] + value["height"] <= less["y"] + 0.5, size
            assert less["y"] == more["y"]
            assert min(less["width"], less["height"], more["width"]) >= 43.5, size
