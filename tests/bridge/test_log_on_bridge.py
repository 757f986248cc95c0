"""/rosout of rclpy nodes on a page: the real bridge, Chromium."""

from collections.abc import Iterator
from typing import Any

import pytest
from playwright.sync_api import Locator, Page, expect

from tests.support.browser.pages import HIDE, widget
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

PANEL = """
title = "Robot cell 1"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "robot"
kind = "log"
label = "Robot"
lines = 20

[[page.widget]]
id = "all"
kind = "log"
label = "With the panel's"
level = "debug"
own = true
"""
LOG = "rcl_interfaces/msg/Log"


@pytest.fixture(scope="module")
def kiosk(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.advertise("/rosout", LOG, durability="transient_local", depth=1000)
    with live_server(bridge, tmp_path_factory.mktemp("cell"), PANEL) as mine:
        say(node, "hello")
        until(lambda: lines(mine, search="hello"), "a first line comes")
        yield mine
    node.withdraw("/rosout")


def say(node: RosNode, text: str, level: int = 20, name: str = "arm") -> None:
    node.publish("/rosout", {"stamp": {"sec": 7}, "level": level, "name": name, "msg": text})


def lines(kiosk: Server, widget: str = "robot", **query: Any) -> list[dict[str, Any]]:
    logged: list[dict[str, Any]] = kiosk.http.get(f"/widgets/{widget}/lines", params=query).json()[
        "lines"
    ]
    return logged


def rows(page: Page) -> Locator:
    return widget(page, "robot").locator(".line")


@pytest.mark.long(None)
def test_lines_come_with_their_level_and_are_chosen(kiosk: Server, node: RosNode, page: Page) -> None:
    page.goto(kiosk.url)
    say(node, "the gripper is slow", 30, "gripper")
    first = rows(page).first
    expect(first.locator(".text")).to_have_text("the gripper is slow")
    expect(first.locator(".word")).to_have_text("Warning")
    expect(first.locator(".node")).to_have_text("gripper")
    expect(first.locator("svg .warn")).to_be_visible()
    expect(first.locator("svg .error")).to_be_hidden()
    say(node, "axis 3 stands", 40)
    expect(first.locator(".text")).to_have_text("axis 3 stands")
    robot = widget(page, "robot")
    robot.locator("input.node").fill("GRIP")
    expect(rows(page).first.locator(".text")).to_have_text("the gripper is slow")
    robot.locator("input.node").fill("")
    robot.locator("input.search").fill("axis")
    expect(rows(page).first.locator(".text")).to_have_text("axis 3 stands")
    robot.locator("input.search").fill("")
    robot.locator("select.level").select_option("error")
    say(node, "no more than a hint", 20)
    until(lambda: lines(kiosk, search="hint"), "it came")
    expect(rows(page).first.locator(".text")).to_have_text("axis 3 stands")


def test_a_pause_keeps_the_lines_and_the_page_stays_small(
    kiosk: Server, node: RosNode, page: Page
) -> None:
    page.goto(kiosk.url)
    expect(rows(page)).not_to_have_count(0)
    pause = widget(page, "robot").locator(".pause")
    pause.click()
    before = rows(page).first.locator(".text").text_content()
    sent = node.flood("/rosout", {"name": "arm", "msg": "step {n}", "level": 20}, 300, 1.0)
    last = f"step {sent - 1}"  # fewer than 300 on a busy machine
    until(lambda: lines(kiosk, search=last), "all came")
    assert rows(page).first.locator(".text").text_content() == before
    pause.click()
    expect(rows(page).first.locator(".text")).to_have_text(last)
    expect(rows(page)).to_have_count(20)
    expect(widget(page, "robot").locator(".left-out")).to_contain_text("more lines are not shown")


def test_hidden_page_requests_no_log_lines(kiosk: Server, node: RosNode, page: Page) -> None:
    page.goto(kiosk.url)
    expect(rows(page)).not_to_have_count(0)
    page.evaluate(HIDE, True)
    urls: list[str] = []
    page.on("request", lambda request: urls.append(request.url))
    before = int(kiosk.widget("robot")["count"])
    say(node, "while it is hidden")
    until(lambda: int(kiosk.widget("robot")["count"]) > before, "it came")
    page.evaluate(HIDE, False)
    expect(rows(page).first.locator(".text")).to_have_text("while it is hidden")
    hidden = [url for url in urls if "/lines" in url]
    assert len(hidden) <= 4, hidden  # both logs, after the page shows again


def test_panels_own_log_lines_are_shown_if_the_widget_asks_for_them(kiosk: Server) -> None:
    """The lines of the node `web_ui`: its link was there before, so that some are in it."""
    assert lines(kiosk, "all", node="web_ui")
    assert not lines(kiosk, "robot", node="web_ui")


def test_without_scripts_the_newest_lines_are_on_the_page(
    kiosk: Server, node: RosNode, without_scripts: Page
) -> None:
    say(node, "seen without scripts")
    until(lambda: lines(kiosk, search="seen without"), "it came")
    without_scripts.goto(kiosk.url)
    expect(rows(without_scripts).first.locator(".text")).to_have_text("seen without scripts")
    expect(widget(without_scripts, "robot").locator(".wanted")).to_be_hidden()


def test_widget_that_is_not_a_log_has_no_lines(kiosk: Server) -> None:
    assert kiosk.http.get("/widgets/nothing/lines").status_code == 404
    assert kiosk.http.get("/widgets/robot/lines", params={"level": "loud"}).status_code == 422
