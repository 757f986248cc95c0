"""Robots' tabs and rows of conditions are as wide in the browser as `check` computes."""

from collections.abc import Iterator
from typing import Final

import pytest
from playwright.sync_api import Page, expect

from app.panel import Panel, load_panel
from app.panel.widgets.tiles import Screen
from app.panel.widths.boxes import Box
from app.panel.widths.cut_texts import KIOSK_SCREENS, boxes
from tests.browser.test_widths_in_browser import opened
from tests.support.browser.browsers import sized
from tests.support.browser.pages import DRAWN
from tests.support.parts import Server
from tests.support.servers import demo_server

pytestmark = pytest.mark.long("every screen")

ROBOTS: Final = "".join(
    f'[[robot]]\nid = "r{number}"\nname = "Robot {number}"\nnamespace = "/r{number}"\n'
    for number in range(1, 6)
)
PANEL: Final = f"""
title = "Line"
mode = "demo"
mm_per_px = 0.22
languages = ["en", "de", "ja"]
{ROBOTS}
[[interlock]]
id = "guard"
label = "Guard door"
topic = "/guard"
type = "std_msgs/msg/Bool"
field = "data"

[[page]]
id = "one"
title = "One"
[[page.group]]
title = "Conditions"
columns = 2
[[page.group.widget]]
id = "list"
kind = "conditions"
label = "Permission"
span = 1
conditions = ["guard"]
[[page.group.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = {{ data = true }}
interlock = "guard"
"""
# The width inside each tab, and that of a row's name beside this word, in px; 0: not shown.
WIDTHS: Final = """(word) => {
  const inside = (element) => {
    if (!element?.checkVisibility()) return 0;
    const { paddingLeft, paddingRight } = getComputedStyle(element);
    return element.clientWidth - parseFloat(paddingLeft) - parseFloat(paddingRight);
  };
  const list = document.querySelector('[data-kind="conditions"]');
  [list.dataset.shape, list.dataset.state] = ["unmet", "live"];
  const row = list.querySelector("[data-row]");
  row.dataset.met = "unmet";
  row.querySelector("b").textContent = word;
  const name = row.querySelector(".name");
  return {
    tabs: [...document.querySelectorAll(".robots a")].map(inside),
    tabSize: parseFloat(getComputedStyle(document.querySelector(".robots span")).fontSize),
    row: inside(name),
    rowSize: parseFloat(getComputedStyle(name).fontSize),
    rowHeight: row.getBoundingClientRect().height,
  };
}"""
UNMET: Final = {"en": "not met", "de": "nicht erfüllt", "ja": "不成立"}


@pytest.fixture(scope="module")
def line(tmp_path_factory: pytest.TempPathFactory) -> Iterator[tuple[Server, Panel]]:
    folder = tmp_path_factory.mktemp("line")
    with demo_server(folder, PANEL) as server:
        yield server, load_panel(folder / "cell.toml")


def boxes_of(panel: Panel, screen: Screen, part: str) -> list[Box]:
    return [box for place, box in boxes(panel, screen) if f"{place}.{box.part}".endswith(part)]


@pytest.mark.parametrize("language", ["en", "de", "ja"])
def test_tabs_of_robots_and_rows_of_conditions_are_as_wide_as_computed(
    line: tuple[Server, Panel], page: Page, language: str
) -> None:
    server, panel = line
    opened(page, server, language, "/robots/r1/pages/one")
    expect(page.locator(".robots a")).to_have_count(5)
    for size in KIOSK_SCREENS:
        screen = Screen.from_size(size, panel.mm_per_px)
        sized(page, screen.width, screen.height).evaluate(DRAWN)
        (row,) = boxes_of(panel, screen, "conditions[0]")
        shown = page.evaluate(WIDTHS, UNMET[language])
        tabs = [box for place, box in boxes(panel, screen) if place.startswith("robot[")]
        assert [box.width for box in tabs] == pytest.approx(shown["tabs"], abs=1.5), size
        assert {box.size for box in tabs} == {shown["tabSize"]}
        beside = row.width_beside(language)
        assert row.width - beside == pytest.approx(shown["row"], abs=2), (size, language)
        assert row.size == shown["rowSize"]
        assert row.lines * row.size * 1.1 <= shown["rowHeight"]
