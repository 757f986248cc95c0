"""Parameters of a robot on Cyclone DDS, shown and set by the panel, through the real bridge."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.sync_api import Page, expect

from tests import cyclone
from tests.cyclone import Client, CycloneRobot, served
from tests.parts import Bridge, Server, live, until

cyclone_bridge = cyclone.cyclone_bridge
own_cyclone_bridge = cyclone.own_cyclone_bridge
client = cyclone.client
own_client = cyclone.own_client
robots = cyclone.robots
robot = cyclone.robot

FORM = {"content-type": "application/x-www-form-urlencoded"}
WIDGET = """
[[page.widget]]
kind = "parameter"
node = "/cyclone_robot"
"""
PANEL = f"""
title = "Cyclone cell"
mode = "live"

[[page]]
id = "setup"
title = "Setup"
{WIDGET}
id = "speed"
label = "Speed"
parameter = "speed"
type = "double"
unit = "m/s"
max = 1.5
timeout_s = 1.0
{WIDGET}
id = "name"
label = "Name"
parameter = "name"
type = "string"
{WIDGET}
id = "enabled"
label = "Enabled"
parameter = "enabled"
type = "bool"
{WIDGET}
id = "limit"
label = "Limit"
parameter = "limit"
type = "integer"
{WIDGET}
id = "serial"
label = "Serial number"
parameter = "serial"
type = "string"
{WIDGET}
id = "nothing"
label = "Nothing"
parameter = "nothing"
type = "double"
{WIDGET}
id = "mistyped"
label = "Limit as text"
parameter = "speed.mode"
type = "string"
{WIDGET}
id = "count"
label = "Count"
parameter = "count"
type = "integer"

[[page.widget]]
id = "elsewhere"
kind = "parameter"
label = "Elsewhere"
node = "/nobody"
parameter = "speed"
type = "double"
"""


def panel_file(folder: Path) -> str:
    path = folder / "setup.toml"
    path.write_text(PANEL)
    return str(path)


@pytest.fixture
def kiosk(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    mine = live(cyclone_bridge.endpoint, tmp_path, KIOSK_PANEL=panel_file(tmp_path))
    until(lambda: mine.widget("speed")["enabled"], "the parameters are read")
    yield mine
    mine.end()


def press(kiosk: Server, widget: str, value: Any, **more: Any) -> httpx.Response:
    return kiosk.http.post(f"/widgets/{widget}", json={"inputs": {widget: value}, **more})


def shows(kiosk: Server, widget: str, text: str) -> None:
    until(lambda: kiosk.widget(widget)["text"] == text, f"{widget} shows {text}")


def test_values_ranges_and_hints_are_those_of_the_node(kiosk: Server) -> None:
    shown = kiosk.snapshot()["widgets"]
    texts = {name: shown[name]["text"] for name in ("speed", "name", "enabled", "limit", "serial")}
    assert texts == {
        "speed": "0.5 m/s",
        "name": "cyclone",
        "enabled": "On",
        "limit": "10",
        "serial": "CR-0001",
    }
    assert {shown[name]["state"] for name in texts} == {"live"}
    assert shown["speed"]["limits"] == "0 to 1.5 m/s, in steps of 0.1"
    assert shown["speed"]["bounds"] == {"min": "0", "max": "1.5", "step": "0.1"}
    assert shown["limit"]["limits"] == "0 to 100"
    assert shown["speed"]["hint"] == "m/s"
