"""Numbers in the operator's unit and in the robot's: entered and shown in a browser, in two languages,
through the real bridge. An rclpy node has the topics, a robot on Cyclone DDS the service and action."""

from collections.abc import Iterator
from functools import partial
from typing import Final

import pytest
from playwright.sync_api import Browser, Page, expect

from tests.support.browser.pages import press_button, widget
from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, RosNode, Server, has_heard, publish_until, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("values")

FLOAT: Final = "std_msgs/msg/Float64"
BATTERY: Final = "sensor_msgs/msg/BatteryState"
SENT: Final = ("/test_go", "/test_heat", "/test_jog")
TOPICS: Final = f"""
title = "Units"

[[source]]
id = "battery"
topic = "/test_battery"
type = "{BATTERY}"
field = "percentage"
scale = 100
unit = "%"
format = ".1f"
max_age_s = 60

[[interlock]]
id = "charge"
label = "Battery"
source = "battery"
min = 20

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "charged"
kind = "readout"
label = "Charge"
source = "battery"

[[page.widget]]
id = "distance"
kind = "number"
label = "Distance"
min = 0
max = 500
step = 0.5
unit = "mm"
send_unit = "m"

[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/test_go"
type = "{FLOAT}"
message = {{ data = "{{distance}}" }}
interlock = "charge"

[[page.widget]]
id = "heat"
kind = "number"
label = "Heat"
min = 0
max = 90
step = 0.5
unit = "°C"
scale = 1.8
offset = 32

[[page.widget]]
id = "set_heat"
kind = "publish"
label = "Set"
topic = "/test_heat"
type = "{FLOAT}"
message = {{ data = "{{heat}}" }}

[[page.widget]]
id = "jog_speed"
kind = "number"
label = "Speed"
min = 0
max = 1
step = 0.05
unit = "m/s"

[[page.widget]]
id = "back"
kind = "publish"
label = "Back"
topic = "/test_jog"
type = "{FLOAT}"
message = {{ data = "-{{jog_speed}}" }}
"""
CALLS: Final = """
title = "Units"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "add"
kind = "call"
label = "Add"
service = "/add_two_ints"
type = "example_interfaces/srv/AddTwoInts"
request = { a = 40, b = 2 }
answer = "{sum*0.125:.2f} m"

[[page.widget]]
id = "count"
kind = "action"
label = "Count"
action = "/fibonacci"
type = "example_interfaces/action/Fibonacci"
goal = { order = 6 }
feedback = "at {sequence[0]*0.5:.1f} m"
result = "{sequence[1]*1.25:.2f} m"
"""


@pytest.fixture(scope="module")
def cell(bridge: Bridge, node: RosNode, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    for topic in SENT:
        node.subscribe(topic, FLOAT)
    node.advertise("/test_battery", BATTERY)
    with live_server(bridge, tmp_path_factory.mktemp("cell"), TOPICS) as mine:
        until(partial(node.subscribers, "/test_battery"), "the panel listens")
        for topic in SENT:
            until(partial(node.endpoints, topic), "the robot sees who publishes")
        yield mine
        node.withdraw("/test_battery")


@pytest.fixture(params=["en", "de"])
def language(request: pytest.FixtureRequest) -> str:
    return str(request.param)


@pytest.fixture
def shown(chromium: Browser, language: str) -> Iterator[Page]:
    with chromium.new_context(locale=language) as context:
        yield context.new_page()


def written(number: str, language: str) -> str:
    return number.replace(".", ",") if language == "de" else number


def test_numbers_leave_in_the_robots_unit(
    cell: Server, node: RosNode, shown: Page, language: str
) -> None:
    def charged() -> bool:
        """An earlier test's charge may be old soon, and one right after the join has an unknown age."""
        return "72.5" in cell.widget("charged")["text"] and bool(cell.widget("go")["enabled"])

    publish_until(node, "/test_battery", {"percentage": 0.725}, charged)
    shown.goto(cell.url)
    for entry, button, topic, text, sent in (
        ("distance", "go", "/test_go", "40.5", 0.0405),
        ("heat", "set_heat", "/test_heat", "20.5", 68.9),
        ("jog_speed", "back", "/test_jog", "0.25", -0.25),
    ):
        before = len(node.heard(topic))
        widget(shown, entry).locator("input").fill(written(text, language))
        press_button(shown, button).click()
        until(partial(has_heard, node, topic, before + 1), f"{topic} is sent")
        assert node.heard(topic)[-1]["data"] == pytest.approx(sent, abs=1e-12)


def test_a_source_is_shown_and_locks_in_the_unit_that_is_read(
    cell: Server, node: RosNode, shown: Page, language: str
) -> None:
    def reports(percentage: float, text: str) -> None:
        message = {"percentage": percentage}
        publish_until(node, "/test_battery", message, lambda: text in cell.widget("charged")["text"])

    reports(0.725, "72.5")
    shown.goto(cell.url)
    expect(widget(shown, "charged")).to_contain_text(written("72.5", language))
    expect(press_button(shown, "go")).to_be_enabled()
    reports(0.1234, "12.3")
    expect(widget(shown, "go")).to_contain_text(written("12.3 %", language))
    expect(widget(shown, "go")).to_contain_text("20 %")
    expect(press_button(shown, "go")).to_be_disabled()
    reports(0.2, "20")  # a float32, which is a little more than 0.2
    expect(press_button(shown, "go")).to_be_enabled()


def test_answers_feedback_and_results_have_their_formats(
    cyclone_bridge: Bridge,
    robot: CycloneRobot,
    tmp_path_factory: pytest.TempPathFactory,
    shown: Page,
    language: str,
) -> None:
    with live_server(cyclone_bridge, tmp_path_factory.mktemp("calls"), CALLS) as mine:
        until(lambda: mine.widget("add")["enabled"], "the service is offered")
        until(lambda: mine.widget("count")["enabled"], "the action is offered")
        shown.goto(mine.url)
        press_button(shown, "add").click()
        expect(widget(shown, "add")).to_contain_text(written("5.25 m", language))
        press_button(shown, "count").first.click()
        expect(widget(shown, "count")).to_contain_text(written("1.25 m", language))
