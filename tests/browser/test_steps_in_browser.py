"""Steps as an operator presses them: Chromium, the real bridge, an rclpy node."""

from collections.abc import Iterator
from functools import partial
from typing import Final

import pytest
from playwright.sync_api import Locator, Page, Route, expect

from tests.support.browser.pages import place
from tests.support.browser.touch import loaded
from tests.support.parts import (
    TAP_AGAIN_MS,
    Bridge,
    RosNode,
    Server,
    has_heard,
    publish_until,
    until,
)
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

PANEL: Final = """
title = "Cell"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "speed"
kind = "step"
label = "Speed"
topic = "/test_set_speed"
type = "std_msgs/msg/Float32"
message = { data = "{value}" }
value = { topic = "/test_speed", type = "std_msgs/msg/Float32" }
min = 0
max = 60
step = 10
unit = "mm/s"
within_s = 30.0
"""
SET: Final = "/test_set_speed"
REPORTED: Final = "/test_speed"
FLOAT: Final = "std_msgs/msg/Float32"


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.subscribe(SET, FLOAT)
    node.advertise(REPORTED, FLOAT)
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        until(partial(node.subscribers, REPORTED), "the panel listens")
        until(partial(node.endpoints, SET), "the robot sees who publishes")
        yield mine
        node.withdraw(REPORTED)


def key(page: Page, way: str) -> Locator:
    return page.locator(f'[data-widget="speed"] [data-way="{way}"]')


def is_reported(cell: Server, node: RosNode, speed: float) -> None:
    reported = {"data": speed}
    publish_until(node, REPORTED, reported, lambda: cell.widget("speed")["text"] == f"{speed:g}")
    until(lambda: cell.widget("speed")["enabled"], "the last press is over")


@pytest.mark.long(None)
def test_a_press_is_one_step_and_the_next_waits_for_it(cell: Server, node: RosNode, page: Page) -> None:
    page.goto(cell.url)
    up, down = key(page, "up"), key(page, "down")
    reason = page.locator("#why-speed")
    expect(up).to_be_disabled()
    expect(reason).to_contain_text("Locked: Speed is not known yet.")
    assert "why-speed" in (up.get_attribute("aria-describedby") or "")
    colour, cursor = up.evaluate(
        "(key) => [getComputedStyle(key).backgroundColor, getComputedStyle(key).cursor]"
    )
    assert (colour, cursor) == ("rgb(169, 169, 169)", "not-allowed")
    is_reported(cell, node, 40.0)
    expect(up).to_be_enabled()
    expect(up).to_have_attribute("value", "50")
    before = len(node.heard(SET))
    up.dblclick()
    until(lambda: has_heard(node, SET, before + 1), "it is sent")
    expect(up).to_be_disabled()
    expect(reason).to_contain_text("In progress: waiting for the robot.")
    node.publish(REPORTED, {"data": 50.0})
    expect(up).to_be_enabled()
    expect(up).to_have_attribute("value", "60")
    expect(page.locator('[data-widget="speed"] .result')).to_contain_text("Confirmed by the robot")
    assert node.heard_data(SET)[before:] == [50.0]
    is_reported(cell, node, 60.0)
    expect(up).to_be_disabled()
    expect(down).to_be_enabled()
    box = place(down)
    assert min(box["width"], box["height"]) >= 20 / 0.22 - 0.5


def test_the_value_under_the_finger_counts(cell: Server, node: RosNode, page: Page) -> None:
    is_reported(cell, node, 20.0)
    loaded(page, cell)
    down = key(page, "down")
    expect(down).to_have_attribute("value", "10")
    expect(down).to_be_enabled()
    before = len(node.heard(SET))
    down.hover()
    page.mouse.down()
    is_reported(cell, node, 40.0)
    expect(down).to_have_attribute("value", "30")
    page.mouse.up()
    expect(page.locator("#receipt-speed")).to_contain_text("Speed is now 40.")
    assert len(node.heard(SET)) == before


def test_a_value_that_changes_before_the_script_of_its_kind_is_there_is_shown(
    cell: Server, node: RosNode, page: Page
) -> None:
    is_reported(cell, node, 20.0)
    held: list[Route] = []
    page.route("**/kinds/step.js", lambda route: held.append(route))
    page.goto(cell.url, wait_until="commit")
    until(lambda: page.evaluate("1") and held, "the script is requested")
    is_reported(cell, node, 40.0)
    expect(page.locator('[data-lamp="server"]')).to_have_attribute("data-state", "bad")
    page.unroute("**/kinds/step.js")  # lets what is held go on
    expect(page.locator('[data-widget="speed"] .value')).to_contain_text("40")
    expect(key(page, "up")).to_have_attribute("value", "50")
    expect(key(page, "up")).to_be_enabled()


def test_without_scripts_a_form_sends_the_value_of_its_key(
    cell: Server, node: RosNode, without_scripts: Page
) -> None:
    is_reported(cell, node, 30.0)
    page = without_scripts
    page.goto(cell.url)
    page.wait_for_timeout(TAP_AGAIN_MS)
    before = len(node.heard(SET))
    key(page, "down").click(no_wait_after=True)
    until(lambda: has_heard(node, SET, before + 1), "it is sent")
    node.publish(REPORTED, {"data": 20.0})
    assert node.heard_data(SET)[before:] == [20.0]
    expect(page.locator('[data-widget="speed"] .value')).to_contain_text("20")
    expect(page.locator('[data-widget="speed"] .result')).to_contain_text("Confirmed by the robot")
