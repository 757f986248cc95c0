"""What a press sends, on the real bridge to an rclpy node: fields that are left out, its time,
any number, defaults of inputs."""

import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, Final

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.support.browser.pages import place
from tests.support.parts import Bridge, RosNode, Server, has_heard, until
from tests.support.servers import live_server

PANEL: Final = """
title = "Robot cell 1"

[[page]]
id = "drive"
title = "Drive"

[[page.widget]]
id = "speed"
kind = "slider"
label = "Speed"
min = -1.0
max = 1.0
default = 0.333

[[page.widget]]
id = "turn"
kind = "number"
label = "Turn"
min = -3.14159
max = 3.14159
default = 0

[[page.widget]]
id = "drive"
kind = "publish"
label = "Drive"
topic = "/test_stamped"
type = "geometry_msgs/msg/TwistStamped"
message.header = { stamp = "{now}", frame_id = "base" }
message.twist = { linear = { x = "{speed}" }, angular = { z = "{turn}" } }

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/test_path"
type = "nav_msgs/msg/Path"
message = { poses = [{}, { header = { stamp = "{now}" }, pose = { position = { x = 1 } } }] }
"""
STAMPED: Final = "/test_stamped"
PATH: Final = "/test_path"


@pytest.fixture(scope="module")
def robot(node: RosNode) -> RosNode:
    node.subscribe(STAMPED, "geometry_msgs/msg/TwistStamped")
    node.subscribe(PATH, "nav_msgs/msg/Path")
    return node


@pytest.fixture(scope="module")
def cell(bridge: Bridge, robot: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        for topic in (STAMPED, PATH):
            until(partial(robot.endpoints, topic), f"the robot sees who publishes {topic}")
        until(lambda: mine.snapshot()["link"]["node"]["state"] == "ok", "the robot is seen")
        yield mine


def heard_after(robot: RosNode, topic: str, act: Callable[[], object]) -> Any:
    """The message that comes after something was done, and the one alone."""
    before = len(robot.heard(topic))
    act()
    until(lambda: has_heard(robot, topic, before + 1), f"heard on {topic}")
    (message,) = robot.heard(topic)[before:]
    return message


def seconds(stamp: dict[str, int]) -> float:
    return stamp["sec"] + stamp["nanosec"] / 1e9


def press(server: Server, widget: str, **inputs: Any) -> None:
    answer = server.http.post(f"/widgets/{widget}", json={"inputs": inputs})
    assert (answer.status_code, answer.json()["outcome"]) == (200, "published"), answer.text


def test_omitted_fields_arrive_with_ros_defaults(cell: Server, robot: RosNode) -> None:
    before = time.time()
    path = heard_after(robot, PATH, lambda: press(cell, "go"))
    after = time.time()
    first, second = path["poses"]
    assert path["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert first["pose"]["orientation"] == {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    assert second["pose"]["position"] == {"x": 1.0, "y": 0.0, "z": 0.0}
    assert before - 1e-3 <= seconds(second["header"]["stamp"]) <= after + 1e-3


def test_inputs_that_are_left_out_have_their_defaults(cell: Server, robot: RosNode) -> None:
    sent = heard_after(robot, STAMPED, lambda: press(cell, "drive", turn=-0.123456))
    twist = sent["twist"]
    assert (twist["linear"]["x"], twist["angular"]["z"]) == (0.333, -0.123456)
    assert (twist["linear"]["y"], sent["header"]["frame_id"]) == (0.0, "base")
    assert abs(seconds(sent["header"]["stamp"]) - time.time()) < 60


def entry(page: Page, name: str) -> Locator:
    return page.locator(f"#input-{name}")


def test_a_slider_without_a_step_goes_in_fine_ones(cell: Server, robot: RosNode, page: Page) -> None:
    page.goto(cell.url)
    speed, output = entry(page, "speed"), page.locator('[data-widget="speed"] output')
    expect(speed).to_have_attribute("type", "range")
    expect(speed).to_have_attribute("step", "any")
    expect(output).to_have_text("0.333")  # what no one touched stays as it is
    expect(page.locator("#limits-speed")).to_have_text("−1 to 1", use_inner_text=True)
    page.get_by_label("Speed: more").click()
    expect(output).to_have_text("0.34")
    page.get_by_label("Speed: less").click()
    expect(output).to_have_text("0.32")
    box = place(speed)
    middle = box["y"] + box["height"] / 2
    page.mouse.move(box["x"] + box["width"] * 0.3, middle)
    page.mouse.down()
    for at in (0.41, 0.437, 0.7123):
        page.mouse.move(box["x"] + box["width"] * at, middle)
        value = float(speed.input_value())
        assert round(value / 0.02, 6).is_integer(), value
        expect(output).to_have_text(speed.input_value().replace("-", "−"))
    page.mouse.move(box["x"] + box["width"] + 50, middle)
    page.mouse.up()
    expect(output).to_have_text("1")
    speed.press("ArrowLeft")
    expect(output).to_have_text("0.98")
    speed.press("Home")
    expect(output).to_have_text("−1")
    assert speed.bounding_box() == box  # its value is wider and narrower, and moves nothing


def test_a_number_without_a_step_takes_any(cell: Server, robot: RosNode, page: Page) -> None:
    page.goto(cell.url)
    turn = entry(page, "turn")
    expect(turn).to_have_attribute("data-step-size", "any")
    more = page.get_by_label("Turn: more")
    expect(more).to_be_visible()
    more.click()
    expect(turn).to_have_value("0.05")
    turn.fill("3.14159")
    more.click()
    expect(turn).to_have_value("3.14159")
    turn.fill("-0.0001234")
    assert turn.evaluate("(input) => input.matches(':valid')")
    sent = heard_after(robot, STAMPED, page.get_by_role("button", name="Drive", exact=True).click)
    assert sent["twist"]["angular"]["z"] == -0.0001234
