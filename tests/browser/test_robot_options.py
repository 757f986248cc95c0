"""A select whose options the robot publishes: Chromium, the real bridge, an rclpy node."""

from collections.abc import Iterator
from functools import partial
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browser.pages import widget
from tests.support.parts import TAP_AGAIN_MS, Bridge, RosNode, Server, publish_until, until
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

LIST: Final = "/test_stations"
LIST_TYPE: Final = "sensor_msgs/msg/JointState"
GO: Final = "/test_go_to"
STRING: Final = "std_msgs/msg/String"
PANEL: Final = f"""
title = "Cell"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "station"
kind = "select"
label = "Station"
options_from = {{ topic = "{LIST}", type = "{LIST_TYPE}", field = "name", max_age_s = 60 }}

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "{GO}"
type = "{STRING}"
message = {{ data = "{{station}}" }}
"""


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.subscribe(GO, STRING)
    node.advertise(LIST, LIST_TYPE)
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        until(partial(node.subscribers, LIST), "the panel listens")
        until(partial(node.endpoints, GO), "the robot sees who publishes")
        yield mine
        node.withdraw(LIST)


def lists(cell: Server, node: RosNode, *names: str) -> None:
    message = {"name": list(names)}
    publish_until(node, LIST, message, lambda: cell.widget("station")["options"] == list(names))


def sent(node: RosNode) -> list[str]:
    return [message["data"] for message in node.heard(GO)]


@pytest.mark.long(None)
def test_options_come_from_the_robot_and_lock_while_they_are_not_known(
    cell: Server, node: RosNode, page: Page
) -> None:
    page.goto(cell.url)
    select, go = page.get_by_label("Station"), page.locator("[data-widget=go] > button:not(.more)")
    expect(widget(page, "go")).to_contain_text("the list of Station is not known")
    expect(go).to_be_disabled()
    expect(widget(page, "station").locator(".note")).to_contain_text("waiting for data")

    lists(cell, node, "Dock", "Belt 1")
    expect(go).to_be_enabled()
    expect(select.locator("option:not([hidden])")).to_have_text(["Dock", "Belt 1"])
    expect(select).to_have_value("")
    go.click()
    expect(widget(page, "go")).to_contain_text("choose one first")

    page.wait_for_timeout(TAP_AGAIN_MS)
    select.select_option("Belt 1")
    lists(cell, node, "Belt 1", "Belt 2")  # the choice stays where the robot still lists it
    expect(select.locator("option:not([hidden])")).to_have_text(["Belt 1", "Belt 2"])
    expect(select).to_have_value("Belt 1")
    go.click()
    until(lambda: sent(node)[-1:] == ["Belt 1"], "it is sent")

    lists(cell, node, "Belt 2")
    expect(select).to_have_value("")
    lists(cell, node)
    expect(go).to_be_disabled()
    expect(widget(page, "go")).to_contain_text("the list of Station is empty")


def test_a_choice_that_the_robot_no_longer_lists_is_refused(cell: Server, node: RosNode) -> None:
    lists(cell, node, "Dock")
    before = sent(node)
    receipt = cell.press("go", inputs={"station": "Belt 2"}).json()
    assert receipt["outcome"] == "refused"
    assert "does not list" in receipt["reason"]
    assert sent(node) == before


def test_without_scripts_the_options_are_in_the_page(
    cell: Server, node: RosNode, chromium: Browser
) -> None:
    lists(cell, node, "Dock", "Belt 1")
    with chromium.new_context(java_script_enabled=False) as plain:
        page = plain.new_page()
        page.goto(cell.url)
        page.get_by_label("Station").select_option("Dock")
        page.wait_for_timeout(TAP_AGAIN_MS)  # sooner it may be a double tap
        page.locator("[data-widget=go] > button:not(.more)").click()
        until(lambda: sent(node)[-1:] == ["Dock"], "it is sent")
        expect(page.get_by_label("Station")).to_have_value("Dock")
