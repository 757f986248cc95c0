"""Sequences of steps as an operator sees them: Chromium, the real bridge, an rclpy node."""

from collections.abc import Iterator
from functools import partial
from typing import Any, Final

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.support.browser.pages import place, widget
from tests.support.parts import Bridge, RosNode, Server, publish_until, until
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

PICTURE: Final = (
    '<svg xmlns="http://www.w3.org/2000/svg" width="400" height="200"><path d="M0 0h400v200H0z"/></svg>'
)
PANEL: Final = """
title = "Cell"
pictures = "pictures"
languages = ["en", "de"]

[[condition]]
id = "door"
label = "Door"
action = { en = "Close the door", de = "Tür schließen" }
topic = "/seq_door"

[[condition]]
id = "no_fault"
label = "No fault"
action = "Touch Reset"
topic = "/seq_no_fault"

[[alarm]]
id = "air_low"
text = "Air is low"
action = "Open the valve\\nWait for 5 bar"
priority = 2
topic = "/seq_air"
type = "std_msgs/msg/Float64"
low = 5.0

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "steps"
kind = "sequence"
label = "Loading"
span = 12
picture = "cell.svg"
alarms = ["air_low"]
current = { topic = "/seq_step", type = "std_msgs/msg/UInt8" }
steps = [{ text = "Open" }, { text = "Lay in" }, { text = "Close" }]
recovery = [
  { text = "Look into the cell", note = "through both windows" },
  { condition = "door", mark = [75, 50] },
  { condition = "no_fault" },
]

[[page.widget]]
id = "checks"
kind = "conditions"
label = "Conditions"
conditions = ["door", "no_fault"]
"""
TOPICS: Final = {
    "/seq_door": "std_msgs/msg/Bool",
    "/seq_no_fault": "std_msgs/msg/Bool",
    "/seq_step": "std_msgs/msg/UInt8",
    "/seq_air": "std_msgs/msg/Float64",
}


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    folder = tmp_path_factory.mktemp("cell")
    (folder / "pictures").mkdir()
    (folder / "pictures/cell.svg").write_text(PICTURE)
    with live_server(bridge, folder, PANEL) as mine:
        for topic, name in TOPICS.items():
            node.advertise(topic, name)
            until(partial(node.subscribers, topic), f"the panel listens to {topic}")
        yield mine
        for topic in TOPICS:
            node.withdraw(topic)


def tell(cell: Server, node: RosNode, topic: str, value: Any, mode: str = "", text: str = "") -> None:
    """The robot publishes it until the sequence is in this mode, with this line above its steps."""

    def is_shown() -> bool:
        shown = cell.widget("steps")
        return mode in ("", shown["mode"]) and text in ("", shown["text"])

    publish_until(node, topic, {"data": value}, is_shown)


def test_the_steps_of_a_fault_tick_themselves_and_mark_a_place(
    cell: Server, node: RosNode, page: Page
) -> None:
    tell(cell, node, "/seq_air", 6.0)
    tell(cell, node, "/seq_no_fault", True)
    tell(cell, node, "/seq_step", 1)
    tell(cell, node, "/seq_door", True, "usual", "step 2 of 3")
    page.goto(cell.url)
    steps = widget(page, "steps")
    heading, rows, mark = steps.get_by_role("heading"), steps.locator("li"), steps.locator(".place")
    expect(heading).to_have_text("Loading")
    for row, state in zip(visible(rows, 3), ("done", "now", "next"), strict=True):
        expect(row).to_have_attribute("data-now", state)
    expect(rows.nth(1)).to_have_attribute("aria-current", "step")
    expect(mark).to_be_hidden()

    tell(cell, node, "/seq_no_fault", False)
    tell(cell, node, "/seq_door", False, "recovery", "step 1 of 3")
    expect(heading).to_have_text("How to go on")
    expect(rows.nth(0)).to_contain_text("Look into the cell")
    expect(rows.nth(0)).to_contain_text("through both windows")
    expect(rows.nth(1)).to_contain_text("Close the door")
    expect(rows.nth(2)).to_contain_text("Touch Reset")
    expect(mark).to_have_text("2")
    picture, spot = place(steps.locator("img")), place(mark.locator("circle"))
    assert abs(spot["x"] + spot["width"] / 2 - picture["x"] - 0.75 * picture["width"]) < 3
    assert abs(spot["y"] + spot["height"] / 2 - picture["y"] - 0.5 * picture["height"]) < 3
    expect(widget(page, "checks").locator("li:visible").nth(0)).to_contain_text("Close the door")

    tell(cell, node, "/seq_door", True, "recovery", "step 3 of 3")
    for row, state in zip(visible(rows, 3), ("past", "done", "now"), strict=True):
        expect(row).to_have_attribute("data-now", state)
    expect(mark).to_be_hidden()
    tell(cell, node, "/seq_no_fault", True, "usual")
    expect(heading).to_have_text("Loading")


def test_the_lines_of_an_alarm_are_steps_while_it_stands(
    cell: Server, node: RosNode, page: Page
) -> None:
    tell(cell, node, "/seq_no_fault", True)
    tell(cell, node, "/seq_door", True)
    page.goto(cell.url)
    steps = widget(page, "steps")
    tell(cell, node, "/seq_air", 4.0, "recovery")
    expect(steps.get_by_role("heading")).to_have_text("How to go on")
    expect(steps.locator("li").nth(0)).to_contain_text("Open the valve")
    expect(steps.locator("li").nth(1)).to_contain_text("Wait for 5 bar")
    page.reload()
    expect(steps.locator("li").nth(1)).to_contain_text("Wait for 5 bar")
    tell(cell, node, "/seq_air", 6.0, "usual")
    expect(steps.get_by_role("heading")).to_have_text("Loading")


def visible(rows: Locator, number: int) -> list[Locator]:
    """The rows that are shown."""
    expect(rows.locator("visible=true")).to_have_count(number)
    return rows.all()[:number]
