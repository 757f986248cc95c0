"""Gauges, joints and tables as an operator sees them: Chromium, the real bridge, an rclpy node."""

import math
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest
from playwright.sync_api import Page, expect

from app.panel import Panel, load_panel
from app.panel.checks.fit import group_width, page_width, reason, row_heights
from app.panel.widgets.tiles import Screen
from tests.support.browser.pages import ROWS, widget
from tests.support.parts import ROOT, Bridge, RosNode, Server, publish_until, until
from tests.support.servers import live_server, panel_file

pytestmark = pytest.mark.long("detail")

PANEL: Final = """
title = "Cell"
mm_per_px = 0.22

[[page]]
id = "one"
title = "One"
fit = true

[[page.group]]
title = "Arm"
columns = 2
span = 6

[[page.group.widget]]
id = "arm"
kind = "joints"
label = "Arm"
span = 2
joint = [
  { name = "joint_1", label = "J1", min = -180, low = -90, high = 90, max = 180 },
  { name = "joint_2", label = "J2", min = -180, max = 180 },
  { name = "lift", unit = "mm", min = 0, max = 1000 },
]

[[page.group.widget]]
id = "air"
kind = "gauge"
label = "Air"
topic = "/test_air"
type = "std_msgs/msg/Float64"
unit = "bar"
min = 0
max = 10
normal = [5, 6]
low = 4
high = 7
setpoint = { topic = "/test_air_set", type = "std_msgs/msg/Float64" }

[[page.group.widget]]
id = "vacuum"
kind = "gauge"
label = "Vacuum"
topic = "/test_air"
type = "std_msgs/msg/Float64"
unit = "bar"
min = 0
max = 5
setpoint = 4
orientation = "horizontal"

[[page.group]]
title = "Parts"
columns = 1
span = 6

[[page.group.widget]]
id = "parts"
kind = "table"
label = "Diagnostics"
topic = "/diagnostics"
type = "diagnostic_msgs/msg/DiagnosticArray"
field = "status"
key = "name"
rows_shown = 3
sort = { first = "largest", by = "level" }

[[page.group.widget.column]]
label = "Level"
field = "level"
states = [
  { value = "OK", text = "Good", shape = "circle" },
  { value = "WARN", text = "Warning", shape = "triangle", colour = "yellow" },
]

[[page.group.widget.column]]
label = "Part"
field = "name"
width = 2
"""
TOPIC_OF: Final = {"arm": "/joint_states", "parts": "/diagnostics", "air": "/test_air"}
TOPICS: Final = {
    "/joint_states": "sensor_msgs/msg/JointState",
    "/diagnostics": "diagnostic_msgs/msg/DiagnosticArray",
    "/test_air": "std_msgs/msg/Float64",
    "/test_air_set": "std_msgs/msg/Float64",
}


@pytest.fixture(scope="module")
def panel(tmp_path_factory: pytest.TempPathFactory) -> Panel:
    return load_panel(panel_file(tmp_path_factory.mktemp("panel"), PANEL))


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        for topic, name in TOPICS.items():
            node.advertise(topic, name)
            until(partial(node.subscribers, topic), f"the panel listens to {topic}")
        yield mine
        for topic in TOPICS:
            node.withdraw(topic)


def tell(cell: Server, node: RosNode, shown: str, /, **fields: Any) -> None:
    """The robot says it on the topic of a widget: once, where it was heard there before."""
    publish_until(node, TOPIC_OF[shown], fields, lambda: cell.widget(shown)["state"] != "waiting")


def status(name: str, level: int) -> dict[str, Any]:
    return {"name": name, "level": level}


def test_gauge_moves_its_pointer_and_names_the_exceeded_limit(
    cell: Server, node: RosNode, page: Page
) -> None:
    page.goto(cell.url)
    gauge = widget(page, "air")
    expect(gauge).to_have_attribute("data-state", "waiting")
    expect(gauge.locator(".pointer")).to_be_hidden()
    expect(gauge.locator(".target")).to_have_text("set-point unknown")
    publish_until(
        node, "/test_air_set", {"data": 5.5}, lambda: cell.widget("air")["setpoint"] is not None
    )
    for value, level, said, sign in (
        (5.5, "normal", "", ""),
        (6.5, "abnormal", "above normal 6", ".mild"),
        (2.5, "low", "below low 4", ".medium"),
    ):
        tell(cell, node, "air", data=value)
        expect(gauge).to_have_attribute("data-level", level)
        expect(gauge.locator(".said")).to_have_text(said)
        expect(gauge.locator(".value")).to_have_text(f"{value:g} bar")
        expect(gauge.locator(".pointer > .now")).to_have_text(f"{value:g}")
        expect(gauge.locator(".pointer")).to_have_attribute("y", f"{100 - 10 * value:g}%")
        assert gauge.locator(".marks > *:visible").count() == bool(sign)
        if sign:
            expect(gauge.locator(f".marks > {sign}")).to_be_visible()
    expect(gauge.locator(".figures text")).to_have_text(["0", "10", "4", "7"])
    expect(gauge.locator(".figures text").first).to_be_visible()
    expect(gauge.locator(".pointer > .now")).to_be_visible()
    expect(widget(page, "vacuum").locator(".figures text")).to_have_text(["0", "5"])
    expect(gauge.locator(".setpoint")).to_have_attribute("y", "45%")
    expect(gauge.locator(".target")).to_have_text("set 5.5")
    tell(cell, node, "air", data=11.0)
    lying = widget(page, "vacuum")
    expect(lying).to_have_attribute("data-beyond", "above")
    expect(lying.locator(".pointer")).to_have_attribute("x", "100%")
    expect(lying.locator(".beyond.above")).to_be_visible()
    expect(lying.locator(".said")).to_have_text("above the scale")


JOINTS_ALONE: Final = """
title = "Arm"
mode = "demo"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "arm"
kind = "joints"
label = "Arm"
joint = [{ name = "joint_1", min = -180, max = 180 }]
"""


def test_joints_look_the_same_on_a_page_without_gauges(page: Page, tmp_path: Path) -> None:
    path = tmp_path / "arm.toml"
    path.write_text(JOINTS_ALONE)
    server = Server(ROOT, KIOSK_PANEL=str(path), KIOSK_MODE="demo")
    try:
        page.goto(server.url)
        trough = widget(page, "arm").locator(".trough")
        assert trough.evaluate("one => getComputedStyle(one).fill") != "rgb(0, 0, 0)"
    finally:
        server.end()


@pytest.mark.long(None)
def test_joints_are_found_by_name_in_messages_of_any_order(
    cell: Server, node: RosNode, page: Page
) -> None:
    page.goto(cell.url)
    joints = widget(page, "arm")
    values = joints.locator("li .now")
    for names, positions, texts in (
        (["joint_1", "joint_2", "lift"], [math.pi / 4, 0.0, 0.25], ["+45.0", "+0.0", "+250.0"]),
        (["lift", "joint_2", "joint_1"], [0.5, math.pi, -math.pi], ["−180.0", "+180.0", "+500.0"]),
        (["lift"], [0.75], ["−180.0", "+180.0", "+750.0"]),  # another node may publish the others
    ):
        tell(cell, node, "arm", name=names, position=positions)
        expect(values).to_have_text(texts)
    alone = {"name": ["lift"], "position": [0.75]}
    publish_until(node, TOPIC_OF["arm"], alone, lambda: "missing" in cell.widget("arm")["joint_values"])
    expect(values).to_have_text(["missing", "missing", "+750.0"])
    expect(joints.locator("li").nth(2).locator(".pointer")).to_have_attribute("x", "75%")
    expect(joints.locator("li").first.locator(".pointer")).to_be_hidden()
    expect(joints.locator(".said")).to_have_text("J1 is missing in the message and 1 more")
    tell(cell, node, "arm", name=["joint_1", "joint_2", "lift"], position=[2.0, 0.0, 0.25])
    expect(joints.locator(".said")).to_have_text("J1 above its soft limit 90")
    expect(joints.locator("li").first.locator(".marks > .medium")).to_be_visible()


def test_a_table_keeps_the_latest_of_each_part_and_its_rows_stay_in_place(
    cell: Server, node: RosNode, page: Page
) -> None:
    page.goto(cell.url)
    table = widget(page, "parts")
    rows = table.locator("tbody tr:not([data-empty])")
    first = table.locator("tbody tr").first.element_handle()
    assert first is not None
    tell(cell, node, "parts", status=[status("drive", 0), status("gripper", 0)])
    expect(rows).to_have_text(["Good drive", "Good gripper"], use_inner_text=True)
    tell(cell, node, "parts", status=[status("gripper", 1)])
    expect(rows).to_have_text(["Warning gripper", "Good drive"], use_inner_text=True)
    expect(rows.first.locator("svg .triangle")).to_be_visible()
    more = [status(f"sensor {number}", 0) for number in range(5)]
    tell(cell, node, "parts", status=more)
    expect(table.locator(".said")).to_have_text("and 4 more")
    assert first.evaluate("(row) => row.isConnected && row.rowIndex") == 1


def test_without_scripts_the_page_shows_the_same(
    cell: Server, node: RosNode, without_scripts: Page
) -> None:
    tell(cell, node, "air", data=2.5)
    tell(cell, node, "parts", status=[status("gripper", 1)])
    tell(cell, node, "arm", name=["joint_1"], position=[0.0])
    until(lambda: cell.widget("air")["text"] == "2.5", "the value arrived")
    until(lambda: cell.widget("arm")["joint_values"][0] == "+0.0", "the joint arrived")
    until(lambda: cell.widget("parts")["table_rows"], "the entry arrived")
    page = without_scripts
    page.goto(cell.url)
    expect(widget(page, "air").locator(".said")).to_have_text("below low 4")
    expect(widget(page, "air").locator(".pointer")).to_have_attribute("y", "75.0%")
    expect(widget(page, "vacuum").locator(".pointer")).to_have_attribute("x", "50.0%")
    expect(widget(page, "arm").locator(".now").first).to_have_text("+0.0")
    expect(widget(page, "parts").locator("tbody tr").first).to_contain_text("gripper")


def test_a_page_that_is_cut_off_shows_old_values(cell: Server, node: RosNode, page: Page) -> None:
    tell(cell, node, "air", data=2.5)
    page.route("**/events*", lambda route: route.abort())
    page.goto(cell.url)
    for name in ("air", "arm", "parts"):
        expect(widget(page, name)).to_have_attribute("data-state", "old")
    expect(widget(page, "air").locator(".said")).to_be_hidden()
    assert widget(page, "air").locator(".marks > *:visible").count() == 0


@pytest.mark.parametrize("size", ["1280x800", "1024x600", "800x480"])
def test_sizes_are_those_of_the_browser(cell: Server, panel: Panel, page: Page, size: str) -> None:
    screen = Screen.from_size(size, panel.mm_per_px)
    page.set_viewport_size({"width": screen.width, "height": screen.height})
    page.goto(cell.url)
    expect(widget(page, "arm")).to_be_visible()
    described = panel.pages[0]
    assert reason(panel, described, screen) == ""
    width = page_width(panel, screen)
    for number, group in enumerate(described.parts):
        shown = page.locator(f'.group[data-group="{number}"]')
        if not shown.is_visible():
            continue
        inside = group_width(group, described, screen, width)
        assert page.evaluate(ROWS, number) == pytest.approx(row_heights(group, screen, inside), abs=1)
        assert inside > 0
        cut = shown.evaluate(
            "(g) => g.scrollHeight > g.clientHeight + 1 || g.scrollWidth > g.clientWidth + 1"
        )
        assert not cut, size
