"""Recipes loaded into a node on Cyclone DDS and read back, through the real bridge."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, Server, until
from tests.support.servers import live_server

PANEL: Final = """
title = "Cyclone cell"
mode = "live"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "speed"
kind = "number"
label = "Speed"
unit = "mm/s"
send_unit = "m/s"
min = 0
max = 3000
[[page.widget]]
id = "limit"
kind = "number"
label = "Limit"
min = 0
max = 200
[[page.widget]]
id = "enabled"
kind = "toggle"
label = "Enabled"
[[recipe]]
id = "tunes"
label = "Tunes"
fields = ["speed", "limit", "enabled"]
node = "/cyclone_robot"
parameters = { speed = "speed", limit = "limit", enabled = "enabled" }
parameter_types = { speed = "double" }
confirm_s = 20.0
"""
SLOW: Final = {"speed": 1200, "limit": 40, "enabled": False}


@pytest.fixture
def cell(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    with live_server(cyclone_bridge, tmp_path, PANEL) as mine:
        until(lambda: mine.widget("tunes")["enabled"], "the node's parameters can be set")
        yield mine


def make(cell: Server, name: str, values: dict[str, Any]) -> None:
    answer = cell.http.post("/recipes/tunes/create", json={"name": name, "values": values})
    assert answer.json()["done"], answer.text


def load(cell: Server, recipe: str) -> dict[str, Any]:
    answer: dict[str, Any] = cell.http.post("/widgets/tunes", json={"inputs": {"tunes": recipe}}).json()
    return answer


def marked(cell: Server) -> bool:
    page = cell.http.get("/recipes/tunes", params={"recipe": "slow"}).text
    return "<em>In the robot</em>" in page


def test_a_recipe_is_set_in_one_request_and_read_back(cell: Server, robot: CycloneRobot) -> None:
    make(cell, "Slow", SLOW)
    receipt = load(cell, "slow@1")
    assert (receipt["outcome"], receipt["code"]) == ("confirmed", "recipe_loaded"), receipt
    values = robot.parameters()
    assert [values[name] for name in ("speed", "limit", "enabled")] == [1.2, 40, False]
    assert robot.parameter_requests(service="set_parameters") == 1
    assert marked(cell)


def test_what_the_node_does_not_take_is_named_and_nothing_is_claimed(
    cell: Server, robot: CycloneRobot
) -> None:
    make(cell, "Slow", {**SLOW, "limit": 150})  # the node takes 100 at most
    receipt = load(cell, "slow@1")
    assert (receipt["outcome"], receipt["code"]) == ("rejected", "recipe_fields_refused"), receipt
    assert "Limit" in receipt["reason"]
    assert robot.parameters()["limit"] == 10
    assert not marked(cell)
