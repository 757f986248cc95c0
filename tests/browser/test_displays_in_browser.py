"""Inputs and lamps as an operator uses them: Chromium, the real bridge, an rclpy node."""

from collections.abc import Iterator
from functools import partial
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Page, expect

from tests.support.browser.pages import widget
from tests.support.parts import TAP_AGAIN_MS, Bridge, RosNode, Server, has_heard, publish_until, until
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

PANEL = """
title = "Robot cell 1"

[[page]]
id = "drive"
title = "Drive"

[[page.widget]]
id = "speed"
kind = "slider"
label = "Speed"
min = -0.5
max = 1.5
step = 0.1
unit = "m/s"
default = 0.0
span = 6

[[page.widget]]
id = "turn"
kind = "number"
label = "Turn"
min = -90
max = 90
step = 5
default = 15
unit = "°/s"
span = 6

[[page.widget]]
id = "mode"
kind = "select"
label = "Mode"
options = [{ value = 1, label = "One round" }, { value = -1, label = "Until stopped" }]
span = 6

[[page.widget]]
id = "light"
kind = "toggle"
label = "Work light"
on = "Shines"
off = "Dark"
span = 6

[[page.widget]]
id = "drive"
kind = "publish"
label = "Drive"
topic = "/test_drive"
type = "geometry_msgs/msg/Twist"
message.linear = { x = "{speed}", y = 0, z = 0 }
message.angular = { x = 0, y = 0, z = "{turn}" }

[[page.widget]]
id = "shine"
kind = "publish"
label = "Light"
topic = "/test_light"
type = "std_msgs/msg/Bool"
message = { data = "{light}" }

[[page.widget]]
id = "choose"
kind = "publish"
label = "Choose"
topic = "/test_mode"
type = "std_msgs/msg/Int8"
message = { data = "{mode}" }

[[page.widget]]
id = "state"
kind = "indicator"
label = "State"
topic = "/test_state"
type = "std_msgs/msg/UInt8"
states = [
  { value = 0, text = "Idle", shape = "circle" },
  { value = 2, text = "Fault", shape = "cross", colour = "red" },
]

[[page.widget]]
id = "voltage"
kind = "readout"
label = "Voltage"
topic = "/test_voltage"
type = "std_msgs/msg/Float32"
format = ".1f"
unit = "V"
span = 4

[[page.widget]]
id = "current"
kind = "readout"
label = "Current"
topic = "/test_current"
type = "std_msgs/msg/Float32"
format = ".1f"
unit = "A"
qos = { reliability = "best_effort", depth = 1 }
span = 4
"""
TOPICS = {
    "/test_drive": "geometry_msgs/msg/Twist",
    "/test_light": "std_msgs/msg/Bool",
    "/test_mode": "std_msgs/msg/Int8",
}


@pytest.fixture(scope="module")
def robot(node: RosNode) -> RosNode:
    for topic, name in TOPICS.items():
        node.subscribe(topic, name)
    return node


@pytest.fixture(scope="module")
def cell(bridge: Bridge, robot: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        for topic in TOPICS:
            until(partial(robot.endpoints, topic), f"the robot sees who publishes {topic}")
        until(lambda: mine.snapshot()["link"]["node"]["state"] == "ok", "the robot is seen")
        yield mine


def press(page: Page, name: str) -> None:
    """A press of its own, not the second tap of the one before."""
    pressed = page.get_by_role("button", name=name, exact=True)
    expect(pressed).not_to_have_attribute("aria-busy", "true")
    pressed.click()


def heard(robot: RosNode, topic: str, before: int) -> list[dict[str, Any]]:
    until(lambda: has_heard(robot, topic, before + 1), f"heard on {topic}")
    messages: list[dict[str, Any]] = robot.heard(topic)[before:]
    return messages


def is_ready(page: Page) -> None:
    expect(page.get_by_role("button", name="Drive", exact=True)).to_be_enabled()
    expect(widget(page, "speed").locator("input")).to_have_attribute("type", "range")


@pytest.mark.long(None)
def test_a_number_and_a_slider_arrive_as_numbers(cell: Server, robot: RosNode, page: Page) -> None:
    page.goto(cell.url)
    is_ready(page)
    before = len(robot.heard("/test_drive"))
    page.get_by_label("Speed (m/s)").fill("1.2")
    expect(widget(page, "speed").locator("output")).to_have_text("1.2")
    page.get_by_label("Turn (°/s)").fill("-45")
    press(page, "Drive")
    expect(page.locator("#receipt-drive")).to_contain_text("Sent at")
    (twist,) = heard(robot, "/test_drive", before)
    assert (twist["linear"]["x"], twist["angular"]["z"]) == (1.2, -45.0)


def test_steps_are_made_with_buttons(cell: Server, robot: RosNode, page: Page) -> None:
    page.goto(cell.url)
    is_ready(page)
    before = len(robot.heard("/test_drive"))
    for _ in range(3):
        page.get_by_label("Speed: more").click()
    page.get_by_label("Turn: less").click()
    expect(widget(page, "speed").locator("output")).to_have_text("0.3")
    press(page, "Drive")
    (twist,) = heard(robot, "/test_drive", before)
    assert (twist["linear"]["x"], twist["angular"]["z"]) == (0.3, 10.0)


@pytest.mark.parametrize(("entry", "said"), [("500", "Turn is 500"), ("", "Turn has no number")])
def test_a_number_out_of_limits_is_refused_but_locks_nothing_else(
    cell: Server, robot: RosNode, page: Page, entry: str, said: str
) -> None:
    page.goto(cell.url)
    is_ready(page)
    before = len(robot.heard("/test_mode"))
    page.get_by_label("Turn (°/s)").fill(entry)
    marked = page.get_by_label("Turn (°/s)").evaluate("(input) => input.matches(':invalid')")
    assert marked is (entry != "")
    press(page, "Drive")
    receipt = page.locator("#receipt-drive")
    expect(receipt).to_contain_text(f": {said}: it must be −90 to 90 °/s, in steps of 5.")
    press(page, "Choose")
    assert heard(robot, "/test_mode", before) == [{"data": 1}]


def test_a_select_and_a_toggle_give_their_values(cell: Server, robot: RosNode, page: Page) -> None:
    page.goto(cell.url)
    is_ready(page)
    mode, light = len(robot.heard("/test_mode")), len(robot.heard("/test_light"))
    page.get_by_label("Mode").select_option(label="Until stopped")
    press(page, "Choose")
    assert heard(robot, "/test_mode", mode) == [{"data": -1}]
    toggle = widget(page, "light")
    expect(toggle.get_by_text("Dark")).to_be_visible()
    page.get_by_label("Work light").check()
    expect(toggle.get_by_text("Shines")).to_be_visible()
    press(page, "Light")
    assert heard(robot, "/test_light", light) == [{"data": True}]
    page.get_by_label("Work light").uncheck()
    press(page, "Light")
    assert heard(robot, "/test_light", light + 1) == [{"data": False}]


def test_without_scripts_the_same_values_arrive(
    cell: Server, robot: RosNode, without_scripts: Page
) -> None:
    page = without_scripts
    before = {topic: len(robot.heard(topic)) for topic in TOPICS}

    def drives() -> bool:
        """A lock of a moment, as by a stall of the server, makes the page one of before it."""
        page.goto(cell.url)
        page.get_by_label("Speed (m/s)").fill("0.7")
        page.get_by_label("Mode").select_option(label="Until stopped")
        page.wait_for_timeout(TAP_AGAIN_MS)
        if page.get_by_label("Speed (m/s)").input_value() != "0.7":
            return False  # it loaded itself again in the meantime, as pages without scripts do
        press(page, "Drive")
        receipt = page.locator("#receipt-drive")
        expect(receipt).not_to_be_empty()
        return "Sent at" in receipt.inner_text()

    until(drives, "it is sent")
    (twist,) = heard(robot, "/test_drive", before["/test_drive"])
    assert (twist["linear"]["x"], twist["angular"]["z"]) == (0.7, 15.0)
    expect(page.get_by_label("Speed (m/s)")).to_have_value("0.7")
    expect(page.get_by_label("Mode")).to_have_value("-1")
    page.wait_for_timeout(TAP_AGAIN_MS)
    press(page, "Light")
    assert heard(robot, "/test_light", before["/test_light"]) == [{"data": False}]
    page.get_by_label("Work light").check()
    page.wait_for_timeout(TAP_AGAIN_MS)
    press(page, "Light")
    assert heard(robot, "/test_light", before["/test_light"] + 1) == [{"data": True}]
    expect(page.get_by_label("Work light")).to_be_checked()
    page.wait_for_timeout(TAP_AGAIN_MS)
    press(page, "Choose")
    assert heard(robot, "/test_mode", before["/test_mode"]) == [{"data": -1}]


def test_a_lamp_has_text_and_shape_for_each_state(cell: Server, robot: RosNode, page: Page) -> None:
    page.goto(cell.url)
    lamp = widget(page, "state")

    def shows(text: str, shape: str, colour: str) -> None:
        expect(lamp.locator(".value")).to_have_text(text)
        expect(lamp).to_have_attribute("data-shape", shape)
        expect(lamp).to_have_attribute("data-colour", colour)
        expect(lamp.locator(f"svg .{shape}")).to_be_visible()
        assert lamp.locator("svg > *:visible").count() == 1

    shows("No value yet", "waiting", "none")
    robot.advertise("/test_state", "std_msgs/msg/UInt8")
    idle = {"data": 0}
    publish_until(robot, "/test_state", idle, lambda: cell.widget("state")["state"] != "waiting")
    for value, *look in (
        (0, "Idle", "circle", "grey"),
        (2, "Fault", "cross", "red"),
        (7, "Unknown: 7", "unknown", "none"),
    ):
        robot.publish("/test_state", {"data": value})
        shows(*look)
    page.route("**/events*", lambda route: route.abort())
    page.reload()
    shows("unknown", "old", "none")
    robot.withdraw("/test_state")


@pytest.mark.long(None)
def test_a_best_effort_publisher_is_read_with_and_without_qos(
    cell: Server, robot: RosNode, page: Page
) -> None:
    page.goto(cell.url)
    for topic in ("/test_voltage", "/test_current"):
        robot.advertise(topic, "std_msgs/msg/Float32", reliability="best_effort")
        robot.every(topic, {"data": 23.96}, 0.1)
    for name, text in (("voltage", "24.0 V"), ("current", "24.0 A")):
        expect(widget(page, name).locator(".value")).to_have_text(text)
    for topic in ("/test_voltage", "/test_current"):
        robot.withdraw(topic)


def test_a_durability_that_the_robot_does_not_publish_is_reported(
    bridge: Bridge, robot: RosNode, tmp_path: Path
) -> None:
    latched = 'qos = { durability = "transient_local" }'
    panel = PANEL.replace('qos = { reliability = "best_effort", depth = 1 }', latched)
    robot.advertise("/test_current", "std_msgs/msg/Float32")
    said = "The robot publishes /test_current as volatile, but this panel requires transient local."
    try:
        with live_server(bridge, tmp_path, panel) as mine:
            until(lambda: mine.widget("current")["note"] == said, "the mismatch is shown")
            robot.withdraw("/test_current")
            until(lambda: mine.widget("current")["state"] == "waiting", "it went")
            robot.advertise("/test_current", "std_msgs/msg/Float32", durability="transient_local")
            amperes = {"data": 1.5}
            publish_until(
                robot, "/test_current", amperes, lambda: mine.widget("current")["text"] == "1.5 A"
            )
    finally:
        robot.withdraw("/test_current")


@pytest.mark.long(None)
def test_reliable_subscriber_locks_a_best_effort_button(
    bridge: Bridge, robot: RosNode, tmp_path: Path
) -> None:
    message = 'message = { data = "{mode}" }'
    panel = PANEL.replace(message, f'{message}\nqos = {{ reliability = "best_effort" }}')
    said = "The robot requires /test_mode as reliable, but this panel publishes it as best effort."
    with live_server(bridge, tmp_path, panel) as mine:
        until(lambda: mine.widget("choose")["reason"] == said, "the mismatch is shown")
        answer = mine.http.post("/widgets/choose", json={"inputs": {"mode": 1}})
        assert answer.status_code == 409
        assert answer.json()["reason"].endswith(f": {said}")


@pytest.mark.parametrize(("width", "height"), [(1280, 800), (1024, 600)])
def test_inputs_are_big_enough_for_gloves(
    cell: Server, robot: RosNode, page: Page, width: int, height: int
) -> None:
    page.set_viewport_size({"width": width, "height": height})
    page.goto(cell.url)
    is_ready(page)
    page.get_by_label("Mode").click()
    touched = page.locator("input:not([type=hidden]):visible, select, option, .step, .switch")
    boxes = [box for element in touched.all() if (box := element.bounding_box())]
    assert len(boxes) == 4 + 2 + 4 + 1
    assert all(box["width"] >= 44 and box["height"] >= 44 for box in boxes), boxes
    row = [element.bounding_box() for element in page.locator('[data-widget="speed"] .entry > *').all()]
    for left, right in pairwise(row):
        assert left is not None
        assert right is not None
        assert right["x"] >= left["x"] + left["width"]
    assert page.evaluate("() => document.documentElement.scrollWidth") <= width
