"""A widget that fails shows so in its tile; the others of its page go on. Real bridge and node."""

from collections.abc import Iterator

import pytest
from playwright.sync_api import Page, Route, expect

from app.web.assets import Assets
from tests.support.browser.pages import press_button, widget
from tests.support.parts import Bridge, RosNode, Server, has_heard, publish_until, until
from tests.support.servers import live_server

pytestmark = pytest.mark.long("detail")

PANEL = """
title = "Robot cell 1"

[[interlock]]
id = "permit"
topic = "/test_part_permit"
max_age_s = 20.0

[[page]]
id = "main"
title = "Main"

[[page.widget]]
id = "pressure"
kind = "gauge"
label = "Pressure"
topic = "/test_part_pressure"
type = "std_msgs/msg/Float64"
field = "data"
min = 0
max = 100

[[page.widget]]
id = "value"
kind = "readout"
label = "Value"
topic = "/test_part_pressure"
type = "std_msgs/msg/Float64"
field = "data"

[[page.widget]]
id = "course"
kind = "trend"
label = "Course"

[[page.widget.pen]]
topic = "/test_part_pressure"
type = "std_msgs/msg/Float64"
label = "Pressure"

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/test_part_go"
type = "std_msgs/msg/Bool"
message = { data = true }

[[page.widget]]
id = "jog"
kind = "hold"
label = "Jog"
topic = "/test_part_jog"
type = "std_msgs/msg/Bool"
message = { data = true }
release = { data = false }
interlock = "permit"
"""
FAILURE = "This cannot be shown: internal error in the panel server. Details are in its log."


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    node.advertise("/test_part_pressure", "std_msgs/msg/Float64")
    node.advertise("/test_part_permit", "std_msgs/msg/Bool")
    node.every("/test_part_permit", {"data": True}, 0.3)
    node.subscribe("/test_part_go", "std_msgs/msg/Bool")
    folder = tmp_path_factory.mktemp("cell")
    with live_server(bridge, folder, PANEL, app="tests.support.apps.failing_widgets:app") as mine:
        publish_until(
            node, "/test_part_pressure", {"data": 5.0}, lambda: mine.widget("value")["text"] == "5"
        )
        until(lambda: mine.widget("jog")["enabled"], "it is permitted")
        yield mine
    node.withdraw("/test_part_permit")


def go(page: Page, node: RosNode) -> None:
    """The button of the same page works."""
    count = len(node.heard("/test_part_go"))
    expect(press_button(page, "go")).to_be_enabled()
    press_button(page, "go").click()
    until(lambda: has_heard(node, "/test_part_go", count + 1), "the press arrives")


def test_a_widget_without_html_has_a_sentence_in_its_tile(
    cell: Server, node: RosNode, page: Page
) -> None:
    assert cell.http.get("/").status_code == 200
    page.goto(cell.url)
    expect(widget(page, "course")).to_contain_text(FAILURE)
    expect(widget(page, "course")).to_contain_text("Course")
    expect(widget(page, "value").locator(".value")).to_have_text("5")
    go(page, node)
    assert cell.process.text.count("RuntimeError: this plot fails") == 1, "logged once"


@pytest.mark.long(None)
def test_a_widget_without_attributes_is_unreadable_and_the_others_go_on(
    cell: Server, node: RosNode, page: Page
) -> None:
    page.goto(cell.url)
    expect(widget(page, "pressure")).to_have_attribute("data-state", "live")
    for value in (95.0, 96.0, 97.0):
        node.publish("/test_part_pressure", {"data": value})
        expect(widget(page, "value").locator(".value")).to_have_text(f"{value:g}")
    expect(widget(page, "pressure")).to_have_attribute("data-state", "unreadable")
    expect(widget(page, "pressure")).to_contain_text(FAILURE)
    go(page, node)
    page.reload()
    expect(widget(page, "pressure")).to_contain_text(FAILURE)
    node.publish("/test_part_pressure", {"data": 6.0})
    expect(widget(page, "value").locator(".value")).to_have_text("6")
    assert cell.process.text.count("RuntimeError: this gauge fails") == 1
    page.reload()
    expect(widget(page, "pressure")).to_have_attribute("data-state", "live")


@pytest.mark.parametrize(
    ("kind", "module"),
    [
        ("hold", 'export const equip = () => { throw new Error("no"); };'),
        ("gauge", 'export const show = { pointer: () => { throw new Error("no"); } };'),
    ],
)
def test_a_widget_whose_script_throws_is_locked_in_its_tile(
    cell: Server, node: RosNode, own_page: Page, kind: str, module: str
) -> None:
    def answer(route: Route) -> None:
        route.fulfill(body=module, content_type="text/javascript")

    own_page.route(f"**/kinds/{Assets.scripts[kind]}.js", answer)
    own_page.goto(cell.url)
    name = {"hold": "jog", "gauge": "pressure"}[kind]
    if kind == "hold":
        expect(widget(own_page, name)).to_have_attribute("data-failed", "")
        expect(press_button(own_page, name)).to_be_disabled()
    else:
        node.publish("/test_part_pressure", {"data": 7.0})
        expect(widget(own_page, name)).to_have_attribute("data-state", "unreadable")
    expect(widget(own_page, name)).to_contain_text(FAILURE)
    node.publish("/test_part_pressure", {"data": 8.0})
    expect(widget(own_page, "value").locator(".value")).to_have_text("8")
    go(own_page, node)
