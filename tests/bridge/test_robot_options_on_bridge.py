"""Selects whose options are a service's answer or a parameter of a node on Cyclone DDS, through the
real bridge; the choice is a call's input."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, Server, until
from tests.support.servers import live_server

NODE: Final = "/cyclone_robot"
PANEL: Final = f"""
title = "Cyclone cell"
mode = "live"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "name"
kind = "select"
label = "Name"
[page.widget.options_from]
service = "{NODE}/list_parameters"
type = "rcl_interfaces/srv/ListParameters"
field = "result.names"
every_s = 1
max_age_s = 3
[[page.widget]]
id = "frame"
kind = "select"
label = "Frame"
options_from = {{ node = "{NODE}", parameter = "frames" }}
[[page.widget]]
id = "described"
kind = "select"
label = "Described"
[page.widget.options_from]
service = "{NODE}/describe_parameters"
type = "rcl_interfaces/srv/DescribeParameters"
request = {{ names = ["speed", "frames"] }}
field = "descriptors[].name"
[[page.widget]]
id = "describe"
kind = "call"
label = "Describe"
service = "{NODE}/describe_parameters"
type = "rcl_interfaces/srv/DescribeParameters"
request = {{ names = ["{{name}}"] }}
answer = "it is {{descriptors[0].name}}"
[[page.widget]]
id = "ask"
kind = "call"
label = "Ask"
service = "{NODE}/get_parameters"
type = "rcl_interfaces/srv/GetParameters"
request = {{ names = ["{{frame}}"] }}
"""


@pytest.fixture
def cell(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    with live_server(cyclone_bridge, tmp_path, PANEL) as mine:
        until(lambda: mine.widget("describe")["enabled"], "the service has listed")
        until(lambda: mine.widget("ask")["enabled"], "the parameter is known")
        yield mine


def options(cell: Server, select: str) -> Any:
    return cell.widget(select)["options"]


def test_a_services_answer_lists_the_options_of_a_calls_input(
    cell: Server, robot: CycloneRobot
) -> None:
    assert "speed" in options(cell, "name")
    until(lambda: options(cell, "described") == ["speed", "frames"], "a text of each message")
    robot.declare_parameter(name="late", value=1.5)
    until(lambda: "late" in options(cell, "name"), "the service is called again")
    receipt = cell.press("describe", inputs={"name": "late"}).json()
    assert receipt["outcome"] == "succeeded", receipt
    assert "it is late" in receipt["reason"]
    gone = cell.press("describe", inputs={"name": "never"}).json()
    assert (gone["outcome"], gone["code"]) == ("refused", "input_option_gone")


def test_what_a_service_listed_is_not_known_when_it_is_silent_or_gone(
    cell: Server, robot: CycloneRobot
) -> None:
    robot.answer_parameters(service="list_parameters", seconds=None)
    until(lambda: not cell.widget("describe")["enabled"], "the list is too old", 20)
    assert "is older than 3 s" in cell.widget("describe")["reason"]
    assert options(cell, "name") == []
    assert "is older than 3 s" in cell.widget("name")["note"]
    robot.answer_parameters(service="list_parameters", seconds=0.0)
    until(lambda: cell.widget("describe")["enabled"], "it answers again", 30)
    robot.end()
    until(lambda: not cell.widget("describe")["enabled"], "the server is gone")
    assert options(cell, "name") == options(cell, "frame") == []
    assert not cell.widget("ask")["enabled"]


def test_a_parameter_lists_the_options_and_follows_its_changes(
    cell: Server, robot: CycloneRobot
) -> None:
    assert options(cell, "frame") == ["base", "tool, left"]
    robot.set_parameter(name="frames", value=["base", "rail"])
    until(lambda: options(cell, "frame") == ["base", "rail"], "the change is reported")
    assert cell.press("ask", inputs={"frame": "rail"}).json()["outcome"] == "succeeded"
    gone = cell.press("ask", inputs={"frame": "tool, left"}).json()
    assert (gone["outcome"], gone["code"]) == ("refused", "input_option_gone")
    robot.set_parameter(name="frames", value=[])
    until(lambda: not cell.widget("ask")["enabled"], "the list is empty")
    assert "is empty" in cell.widget("ask")["reason"]


RANGES: Final = f"""
title = "Cyclone cell"
mode = "live"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "limit"
kind = "select"
label = "Limit"
options_from = {{ node = "{NODE}", parameter = "magazine", range = true }}
[[page.widget]]
id = "mode"
kind = "select"
label = "Mode"
options_from = {{ node = "{NODE}", parameter = "mode", range = true }}
[[page.widget]]
id = "wide"
kind = "select"
label = "Wide"
options_from = {{ node = "{NODE}", parameter = "wide", range = true }}
[[page.widget]]
id = "group"
kind = "select"
label = "Group"
[page.widget.options_from]
service = "{NODE}/list_parameters"
type = "rcl_interfaces/srv/ListParameters"
request = {{ prefixes = ["tool.left"], depth = 2 }}
field = "result.names"
every_s = 1
[[page.widget]]
id = "list"
kind = "call"
label = "List"
service = "{NODE}/list_parameters"
type = "rcl_interfaces/srv/ListParameters"
request = {{ depth = "{{limit}}" }}
[[page.widget]]
id = "in_mode"
kind = "call"
label = "In mode"
service = "{NODE}/list_parameters"
type = "rcl_interfaces/srv/ListParameters"
request = {{ depth = "{{mode}}" }}
[[page.widget]]
id = "in_wide"
kind = "call"
label = "In wide"
service = "{NODE}/list_parameters"
type = "rcl_interfaces/srv/ListParameters"
request = {{ depth = "{{wide}}" }}
"""


@pytest.fixture
def ranges(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    robot.declare_parameter(name="magazine", value=25, whole_range=[0, 90, 25])
    robot.declare_parameter(name="wide", value=0, whole_range=[0, 200, 1])
    robot.declare_parameter(name="tool.left", value="a")
    robot.declare_parameter(name="tool.right", value="b")
    with live_server(cyclone_bridge, tmp_path, RANGES) as mine:
        until(lambda: mine.widget("list")["enabled"], "the range is known")
        until(lambda: options(mine, "group"), "the service has listed")
        yield mine


def test_the_numbers_of_a_parameters_range_are_the_options(ranges: Server) -> None:
    assert options(ranges, "limit") == ["0", "25", "50", "75", "90"]
    for chosen in ("50", 50):  # as a page and as a program send it
        receipt = ranges.press("list", inputs={"limit": chosen}).json()
        assert receipt["outcome"] == "succeeded", receipt
    gone = ranges.press("list", inputs={"limit": 26}).json()
    assert (gone["outcome"], gone["code"]) == ("refused", "input_option_gone")
    odd = ranges.press("list", inputs={"limit": "x"}).json()
    assert (odd["outcome"], odd["code"]) == ("refused", "input_not_chosen")


def test_a_range_that_is_missing_or_too_long_locks_with_the_reason(ranges: Server) -> None:
    until(lambda: "has no range" in ranges.widget("in_mode")["reason"], "its reason")
    until(lambda: "more than 200 numbers" in ranges.widget("in_wide")["reason"], "its reason")
    assert options(ranges, "mode") == options(ranges, "wide") == []


def test_a_listing_service_is_called_with_the_fields_of_the_panel_file(ranges: Server) -> None:
    assert options(ranges, "group") == ["tool.left"]
