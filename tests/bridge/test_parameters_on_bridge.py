"""Parameters of a robot on Cyclone DDS, shown and set by the panel, through the real bridge."""

from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.support.cyclone import Client, CycloneRobot, served
from tests.support.parts import Bridge, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("dialects")

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
label = "Mode"
parameter = "mode"
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
node = "/absent_node"
parameter = "speed"
type = "double"
"""


@pytest.fixture
def kiosk(cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path) -> Iterator[Server]:
    with live_server(cyclone_bridge, tmp_path, PANEL) as mine:
        until(lambda: mine.widget("speed")["enabled"], "the parameters are read")
        yield mine


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


def test_a_value_is_set_and_shown_as_the_node_has_it(kiosk: Server, robot: CycloneRobot) -> None:
    receipt = press(kiosk, "speed", 1.2)
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "succeeded")
    assert receipt.json()["code"] == "parameter_set"
    assert press(kiosk, "name", "zoë").json()["outcome"] == "succeeded"
    assert press(kiosk, "enabled", False).json()["outcome"] == "succeeded"
    assert press(kiosk, "limit", "40").json()["outcome"] == "succeeded"
    for name, text in {"speed": "1.2 m/s", "name": "zoë", "enabled": "Off", "limit": "40"}.items():
        shows(kiosk, name, text)
    values = robot.parameters()
    assert [values[name] for name in ("speed", "name", "enabled", "limit")] == [1.2, "zoë", False, 40]
    assert "Set to 1.2 m/s" in kiosk.widget("speed")["result"]  # for every browser


@pytest.mark.parametrize(
    ("widget", "value", "code", "limits"),
    [
        ("speed", 1.6, "input_outside_limits", "0 to 1.5 m/s, in steps of 0.1"),
        ("speed", 0.55, "input_outside_limits", "0 to 1.5 m/s, in steps of 0.1"),
        ("speed", "fast", "input_not_a_number", "0 to 1.5 m/s, in steps of 0.1"),
        ("speed", "", "input_number_empty", "0 to 1.5 m/s, in steps of 0.1"),
        ("limit", 101, "input_outside_limits", "0 to 100"),
        ("limit", 1.5, "input_not_a_number", "0 to 100"),
        ("enabled", 1, "input_not_a_boolean", ""),
        ("name", 7, "parameter_not_a_text", "1000"),
    ],
)
def test_value_outside_the_nodes_limits_is_not_sent(
    kiosk: Server, robot: CycloneRobot, widget: str, value: Any, code: str, limits: str
) -> None:
    receipt = press(kiosk, widget, value)
    assert (receipt.status_code, receipt.json()["outcome"]) == (422, "refused")
    assert receipt.json()["code"] == code
    assert limits in receipt.json()["reason"]
    assert robot.parameter_requests(service="set_parameters") == 0


def test_redeclared_parameter_is_described_again(kiosk: Server, robot: CycloneRobot) -> None:
    robot.declare_parameter(name="limit", value="ten")
    until(lambda: kiosk.widget("limit")["state"] == "unreadable", "its type is another one")
    assert "limit of /cyclone_robot is string" in kiosk.widget("limit")["reason"]
    assert press(kiosk, "limit", 5).status_code == 409
    robot.declare_parameter(name="name", value="fixed", additional_constraints="not empty")
    until(lambda: kiosk.widget("name")["hint"] == "not empty", "its descriptor is read")
    assert kiosk.widget("name")["text"] == "fixed"


def test_refused_parameter_shows_the_nodes_reason(kiosk: Server, robot: CycloneRobot) -> None:
    robot.refuse_parameters(reason="the arm moves")
    receipt = press(kiosk, "speed", 0.9)
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "rejected")
    assert receipt.json()["reason"].endswith(": the arm moves")
    assert kiosk.widget("speed")["text"] == "0.5 m/s"


def test_read_only_undeclared_mistyped_and_absent_are_locked(
    kiosk: Server, robot: CycloneRobot
) -> None:
    reasons = {
        "serial": "Read only: /cyclone_robot does not allow serial to be set.",
        "nothing": "Locked: /cyclone_robot has no parameter nothing.",
        "mistyped": "mode of /cyclone_robot is integer, but this panel expects string.",
        "elsewhere": "Locked: the robot does not offer the parameters of /absent_node at present.",
    }
    robot.declare_parameter(name="mode", value=1)
    until(lambda: "integer" in kiosk.widget("mistyped")["reason"], "its type is known")
    shown = kiosk.snapshot()["widgets"]
    assert {name: shown[name]["reason"] for name in reasons} == reasons
    assert not shown["serial"]["settable"]
    assert [press(kiosk, name, "x").status_code for name in reasons] == [409, 409, 409, 503]
    assert robot.parameter_requests(service="set_parameters") == 0


def test_changes_by_others_show_without_asking(kiosk: Server, robot: CycloneRobot) -> None:
    until(lambda: robot.subscribers(topic="/parameter_events"), "events are heard")
    robot.set_parameter(name="serial", value="CR-0002")
    shows(kiosk, "serial", "CR-0002")
    robot.set_parameters(values={"speed": 0.7, "name": "b", "enabled": False, "limit": 3})
    for name, text in {"speed": "0.7 m/s", "name": "b", "enabled": "Off", "limit": "3"}.items():
        shows(kiosk, name, text)
    robot.declare_parameter(name="nothing", value=2.5)
    shows(kiosk, "nothing", "2.5")
    robot.undeclare_parameter(name="nothing")
    shows(kiosk, "nothing", "—")


def test_whole_numbers_that_a_browser_has_not_are_exact(kiosk: Server, robot: CycloneRobot) -> None:
    robot.declare_parameter(name="count", value=2**53 + 1)
    shows(kiosk, "count", "9007199254740993")
    assert kiosk.widget("count")["entry"] == "9007199254740993"
    assert press(kiosk, "count", "-9223372036854775808").json()["outcome"] == "succeeded"
    assert robot.parameters()["count"] == -(2**63)
    assert press(kiosk, "count", "9223372036854775808").status_code == 422


def test_a_node_that_does_not_answer_in_time(
    cyclone_bridge: Bridge, robot: CycloneRobot, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    hasty = PANEL.replace("max = 1.5\n", "max = 1.5\ntimeout_s = 1.0\n")
    kiosk = servers(live_server(cyclone_bridge, tmp_path, hasty))
    until(lambda: kiosk.widget("speed")["enabled"], "the parameters are read")
    robot.answer_parameters(service="set_parameters", seconds=5.0)
    receipt = press(kiosk, "speed", 0.8, id="slow-1")
    assert (receipt.status_code, receipt.json()["outcome"]) == (504, "timed_out")
    assert "Cyclone" not in receipt.json()["reason"]
    until(lambda: kiosk.widget("speed")["outcome"] == "succeeded", "the late answer is shown")
    assert press(kiosk, "speed", 0.8, id="slow-1").json()["outcome"] == "succeeded"
    shows(kiosk, "speed", "0.8 m/s")
    assert robot.parameter_requests(service="set_parameters") == 1


def test_returning_node_is_read_again(kiosk: Server, robot: CycloneRobot) -> None:
    press(kiosk, "speed", 0.8)
    shows(kiosk, "speed", "0.8 m/s")
    robot.end()
    until(lambda: kiosk.widget("speed")["state"] == "old", "what was known is old")
    assert "does not offer the parameters" in kiosk.widget("speed")["reason"]
    assert press(kiosk, "speed", 0.9).status_code == 503
    robot.start()
    until(lambda: kiosk.widget("speed")["enabled"], "it is read again")
    assert (kiosk.widget("speed")["state"], kiosk.widget("speed")["text"]) == ("live", "0.5 m/s")


def test_lost_bridge_while_setting_leaves_the_result_unknown(
    own_cyclone_bridge: Bridge,
    own_client: Client,
    cyclone_robots: Callable[..., CycloneRobot],
    tmp_path: Path,
    servers: Callable[[Server], Server],
) -> None:
    robot = cyclone_robots(own_cyclone_bridge.domain)
    served(robot, own_client)
    kiosk = servers(live_server(own_cyclone_bridge, tmp_path, PANEL))
    until(lambda: kiosk.widget("name")["enabled"], "offered")
    robot.answer_parameters(service="set_parameters", seconds=4.0)
    with ThreadPoolExecutor(1) as pool:
        waiting = pool.submit(press, kiosk, "name", "later")
        until(lambda: robot.parameter_requests(service="set_parameters"), "the robot is at it")
        own_cyclone_bridge.kill()
        receipt = waiting.result()
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "unknown")
    assert receipt.json()["code"] == "call_connection_lost"
    shown = kiosk.widget("name")
    assert (shown["state"], shown["text"], shown["enabled"]) == ("old", "cyclone", False)
    until(lambda: robot.parameters()["name"] == "later", "The robot may or may not have done it")
    own_cyclone_bridge.start()
    until(lambda: kiosk.widget("name")["enabled"], "back")
    assert (kiosk.widget("name")["state"], kiosk.widget("name")["text"]) == ("live", "later")


def test_parameters_are_set_by_forms_without_scripts(kiosk: Server, robot: CycloneRobot) -> None:
    form = (
        "_id=f1&speed=1.1&name=x&enabled=false&enabled=true&limit=7&serial=&nothing=&count=&mistyped="
    )
    set_ = kiosk.http.post("/widgets/speed", content=form, headers=FORM)
    assert set_.status_code == 303
    assert "Set to 1.1 m/s" in kiosk.http.get(set_.headers["location"]).text
    assert kiosk.http.post("/widgets/limit", content=form, headers=FORM).status_code == 303
    values = robot.parameters()
    assert (values["speed"], values["limit"], values["name"]) == (1.1, 7, "cyclone")
    refused = kiosk.http.post("/widgets/speed", content="_id=f2&speed=1e400", headers=FORM)
    page = kiosk.http.get(refused.headers["location"]).text
    assert "Speed must be a number, 0 to 1.5 m/s" in page
