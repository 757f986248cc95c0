"""Switches as an operator presses them: Chromium, the real bridge, an rclpy node."""

from collections.abc import Iterator
from functools import partial
from typing import Final

import pytest
from playwright.sync_api import Browser, Locator, Page, expect

from tests.support.browser.pages import place, press_button, widget
from tests.support.parts import TAP_AGAIN_MS, Bridge, RosNode, Server, has_heard, publish_until, until
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

SET: Final = "/test_light_set"
REPORTED: Final = "/test_light"
BOOL: Final = "std_msgs/msg/Bool"
PANEL: Final = f"""
title = "Cell"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "light"
kind = "switch"
label = "Light"
topic = "{SET}"
type = "{BOOL}"
on_message = {{ data = true }}
off_message = {{ data = false }}
confirm_s = 2.0
reported = {{ topic = "{REPORTED}", type = "{BOOL}" }}

[[page.widget]]
id = "servo"
kind = "publish"
label = "Servo on"
topic = "{SET}"
type = "{BOOL}"
message = {{ data = true }}
lamp = {{ topic = "{REPORTED}", type = "{BOOL}", states = [
  {{ value = true, text = "On", shape = "circle" }},
  {{ value = false, text = "Off", shape = "square" }},
] }}
"""


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.subscribe(SET, BOOL)
    node.advertise(REPORTED, BOOL)
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        until(partial(node.subscribers, REPORTED), "the panel listens")
        until(partial(node.endpoints, SET), "the robot sees who publishes")
        yield mine
        node.withdraw(REPORTED)


def key(page: Page, position: str) -> Locator:
    return page.locator(f'[data-widget="light"] [data-position="{position}"]')


def report(cell: Server, node: RosNode, position: str) -> None:
    is_on = {"data": position == "on"}
    publish_until(node, REPORTED, is_on, lambda: cell.widget("light")["at"] == position)


@pytest.mark.long(None)
def test_it_moves_when_the_robot_reports_it_and_not_before(
    cell: Server, node: RosNode, page: Page
) -> None:
    page.goto(cell.url)
    switch, on, off = widget(page, "light"), key(page, "on"), key(page, "off")
    expect(switch).to_have_attribute("data-at", "")
    expect(switch).to_contain_text("not known")
    expect(on).to_be_enabled()
    expect(off).to_be_enabled()
    report(cell, node, "off")
    expect(switch).to_have_attribute("data-at", "off")
    expect(off).to_have_attribute("aria-pressed", "true")
    expect(off).to_be_disabled()
    box = place(on)
    assert box["height"] >= 12 / 0.22 - 0.5

    before = len(node.heard(SET))
    on.click()
    until(lambda: has_heard(node, SET, before + 1), "it is sent")
    expect(switch).to_have_attribute("data-awaited", "on")
    expect(switch).to_have_attribute("data-at", "off")
    expect(on).to_be_disabled()
    node.publish(REPORTED, {"data": True})
    expect(switch).to_have_attribute("data-at", "on")
    expect(switch).to_have_attribute("data-awaited", "")
    expect(on).to_have_attribute("aria-pressed", "true")
    expect(off).to_be_enabled()
    assert node.heard_data(SET)[before:] == [True]


def test_it_says_that_the_report_did_not_come(cell: Server, node: RosNode, page: Page) -> None:
    report(cell, node, "on")
    page.goto(cell.url)
    off, switch = key(page, "off"), widget(page, "light")
    expect(off).to_be_enabled()
    off.click()
    expect(switch.locator(".result")).to_contain_text("The robot did not confirm it within 2 s.")
    expect(switch.locator(".result")).to_be_visible()
    expect(switch).to_have_attribute("data-at", "on")
    expect(off).to_be_enabled()


def test_without_scripts_each_position_is_a_form(
    cell: Server, node: RosNode, chromium: Browser
) -> None:
    report(cell, node, "off")
    before = len(node.heard(SET))
    context = chromium.new_context(java_script_enabled=False)
    page = context.new_page()
    page.goto(cell.url)
    expect(key(page, "off")).to_be_disabled()
    page.wait_for_timeout(TAP_AGAIN_MS)  # sooner it would be the second tap of the press before
    key(page, "on").click(no_wait_after=True)
    until(lambda: has_heard(node, SET, before + 1), "it is sent")
    assert node.heard_data(SET)[before:] == [True]
    report(cell, node, "on")
    context.close()


def test_the_lamp_of_a_pressed_button_shows_what_the_robot_reports(
    cell: Server, node: RosNode, page: Page
) -> None:
    report(cell, node, "off")
    page.goto(cell.url)
    servo = widget(page, "servo")
    lamp = servo.locator(".lamped")
    expect(lamp).to_have_text("Off")
    before = len(node.heard(SET))
    press_button(page, "servo").click()
    until(lambda: has_heard(node, SET, before + 1), "it is sent")
    expect(servo.locator(".receipt")).not_to_be_empty()
    expect(lamp).to_have_text("Off")
    report(cell, node, "on")
    expect(lamp).to_have_text("On")
    expect(servo).to_have_attribute("data-shape", "circle")
