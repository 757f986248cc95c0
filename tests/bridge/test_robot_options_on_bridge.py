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
service = "{NODE}/list_parameters"
type = "rcl_interfaces/srv/ListParameters"
request = {{ prefixes = ["{{frame}}"] }}
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
