"""The demo robot, stepped by hand."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from app.cell.robot.parameter_state import EMPTY_VALUE
from app.tools.simulator.parameters import EVENTS, NODE
from app.tools.simulator.robot import (
    COUNT_STEP_S,
    FORBIDDEN_S,
    LONGEST_COUNT,
    PERMITTED_S,
    REPEAT_S,
    DemoRobot,
)
from tests.support.parts import ROOT, Server, until


def test_demo_robot_alternates_its_permission_and_publishes_it_each_second() -> None:
    robot = DemoRobot()
    assert robot.step(100.0) == [("/operation_enabled", {"data": True})]
    assert robot.step(100.0 + REPEAT_S / 2) == []
    assert robot.step(100.0 + REPEAT_S) == [("/operation_enabled", {"data": True})]
    assert robot.step(100.0 + PERMITTED_S) == [("/operation_enabled", {"data": False})]
    assert robot.step(100.0 + PERMITTED_S + FORBIDDEN_S) == [("/operation_enabled", {"data": True})]


def test_demo_robot_echoes_each_message_once() -> None:
    robot = DemoRobot()
    robot.hear("/operation1", "hello")
    assert ("/last_heard", {"data": "hello (/operation1)"}) in robot.step(0.0)
    assert robot.step(0.1) == []


def test_demo_robots_services_succeed_or_refuse_with_a_message() -> None:
    robot = DemoRobot()
    robot.step(0.0)
    assert robot.serve("/light", SimpleNamespace(data=True))["message"] == "the light is on"
    assert robot.serve("/reset", None)["success"] is True
    robot.step(PERMITTED_S)
    refused = robot.serve("/reset", None)
    assert (refused["success"], refused["message"]) == (False, "not while operation is forbidden")


def test_a_count_goes_step_by_step_to_its_result() -> None:
    robot = DemoRobot()
    robot.step(0.0)
    assert robot.begin(b"a", 3)
    assert not robot.begin(b"a", 3)
    assert robot.result(b"a") is None
    robot.step(COUNT_STEP_S)
    assert robot.count() == [(b"a", [0, 1, 1])]
    assert robot.count() == []
    robot.step(2 * COUNT_STEP_S)
    assert robot.count() == [(b"a", [0, 1, 1, 2])]
    assert robot.result(b"a") == (4, [0, 1, 1, 2])


def test_a_count_is_canceled_rejected_and_unknown() -> None:
    robot = DemoRobot()
    robot.step(0.0)
    assert not robot.begin(b"x", 0)
    assert not robot.begin(b"x", LONGEST_COUNT + 1)
    assert robot.begin(b"a", 5)
    assert robot.cancel(b"a") == (0, [b"a"])
    assert robot.cancel(b"a") == (3, [])
    assert robot.cancel(b"b") == (2, [])
    assert robot.result(b"a") == (5, [0, 1])
    assert robot.result(b"b") == (0, [])


def test_a_count_before_its_last_number_refuses_a_cancel_as_rclpy_does() -> None:
    robot = DemoRobot()
    robot.step(0.0)
    assert robot.begin(b"a", 2)
    assert robot.cancel(b"a") == (0, [])
    robot.step(COUNT_STEP_S)
    assert robot.count() == [(b"a", [0, 1, 1])]
    assert robot.result(b"a") == (4, [0, 1, 1])


def values_of(service: str, *names: str) -> Any:
    response = DemoRobot().parameters.serve(f"{NODE}/{service}", SimpleNamespace(names=names))
    (answer,) = response.values()
    return answer


def test_demo_robots_parameters_are_described_as_by_rclcpp() -> None:
    speed, serial = values_of("describe_parameters", "speed", "serial")
    assert speed["floating_point_range"] == [{"from_value": 0.0, "to_value": 500.0, "step": 10.0}]
    assert (speed["read_only"], serial["read_only"]) == (False, True)
    assert [value["double_value"] for value in values_of("get_parameters", "speed")] == [120.0]
    assert values_of("get_parameters", "speed", "nothing") == []


@pytest.mark.parametrize(
    ("name", "kind", "field", "value", "reason"),
    [
        ("speed", 3, "double_value", 200.0, ""),
        ("speed", 3, "double_value", 205.0, "parameter 'speed' is out of its range"),
        ("speed", 2, "integer_value", 200, "parameter 'speed' has another type"),
        ("parts", 2, "integer_value", 0, "parameter 'parts' is out of its range"),
        ("batch", 4, "string_value", " ", "a batch needs a name"),
        ("serial", 4, "string_value", "mine", "parameter 'serial' is read-only"),
        ("nothing", 1, "bool_value", True, "parameter 'nothing' is not declared"),
    ],
)
def test_demo_robots_parameters_are_set_or_refused_with_a_reason(
    name: str, kind: int, field: str, value: Any, reason: str
) -> None:
    robot = DemoRobot()
    parameter = SimpleNamespace(
        name=name, value=SimpleNamespace(**{**EMPTY_VALUE, "type": kind, field: value})
    )
    request = SimpleNamespace(parameters=[parameter])
    (result,) = robot.parameters.serve(f"{NODE}/set_parameters", request)["results"]
    assert result == {"successful": not reason, "reason": reason}
    events = [fields for topic, fields in robot.step(0.0) if topic == EVENTS]
    assert [event["changed_parameters"][0]["name"] for event in events] == ([] if reason else [name])


PANEL = """
title = "Demo"
mode = "demo"

[[page]]
id = "setup"
title = "Setup"
""" + "".join(
    f"""
[[page.widget]]
id = "{name}"
kind = "parameter"
label = "{name}"
node = "{NODE}"
parameter = "{name}"
type = "{kind}"
"""
    for name, kind in {
        "speed": "double",
        "parts": "integer",
        "work_light": "bool",
        "batch": "string",
        "serial": "string",
    }.items()
)


@pytest.mark.parametrize("namespace", ["", "/robot1"])
def test_a_panel_sets_and_follows_its_parameters(
    tmp_path: Path, servers: Callable[[Server], Server], namespace: str
) -> None:
    path = tmp_path / "demo.toml"
    path.write_text(f'namespace = "{namespace}"\n{PANEL}')
    kiosk = servers(Server(ROOT, KIOSK_PANEL=str(path)))
    until(lambda: kiosk.widget("speed")["enabled"], "its parameters are read")
    shown = kiosk.snapshot()
    assert {name: widget["text"] for name, widget in shown["widgets"].items()} == {
        "speed": "120",
        "parts": "24",
        "work_light": "Off",
        "batch": "A-17",
        "serial": "DEMO-0001",
    }
    assert shown["link"]["node"]["state"] == "ok"
    assert shown["widgets"]["speed"]["note"].startswith("read ")
    assert "does not tell" not in shown["widgets"]["speed"]["note"]
    for name, value in {"speed": 200, "work_light": True, "batch": " "}.items():
        kiosk.http.post(f"/widgets/{name}", json={"inputs": {name: value}})
    until(lambda: kiosk.widget("work_light")["text"] == "On", "it is followed")
    until(lambda: kiosk.widget("speed")["text"] == "200", "each event of several counts")
    assert kiosk.widget("batch")["outcome"] == "rejected"
    assert kiosk.widget("batch")["result"].endswith(": a batch needs a name")


@pytest.mark.parametrize("command", ["app.simulator", "app.log", "app.log verify"])
def test_help_of_a_command_shows_its_usage(command: str) -> None:
    words = [sys.executable, "-m", *command.split(), "--help"]
    said = subprocess.run(
        words, cwd=ROOT, capture_output=True, text=True, check=True, timeout=30
    ).stdout
    assert said.startswith(f"usage: python -m {command} [-h] ")


def test_a_command_that_is_used_wrongly_says_so() -> None:
    words = [sys.executable, "-m", "app.simulator", "tcp/127.0.0.1:0", "/r1", "more"]
    done = subprocess.run(words, cwd=ROOT, capture_output=True, text=True, check=False, timeout=30)
    assert (done.returncode, '"more" is one argument too many' in done.stderr) == (2, True)


COUNTS = """
title = "Cell"
mode = "demo"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "count"
kind = "action"
label = "Count"
action = "/count"
type = "example_interfaces/action/Fibonacci"
goal = { order = 40 }

[[page.widget]]
id = "short"
kind = "action"
label = "Short"
action = "/count"
type = "example_interfaces/action/Fibonacci"
goal = { order = 2 }
"""


def test_a_server_cancels_its_counts_and_is_refused_before_the_last_number(
    tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    panel = tmp_path / "panel.toml"
    panel.write_text(COUNTS)
    kiosk = servers(Server(ROOT, KIOSK_PANEL=str(panel)))
    until(lambda: kiosk.widget("count")["enabled"], "offered")
    assert kiosk.http.post("/widgets/count", json={"inputs": {}}).json()["outcome"] == "accepted"
    assert kiosk.http.post("/widgets/count/cancel").json()["outcome"] == "accepted"
    until(lambda: kiosk.widget("count")["outcome"] == "canceled", "it is canceled")

    def refused() -> bool:
        """Its last number comes after half a second: a busy machine may be too late for that."""
        until(lambda: kiosk.widget("short")["enabled"], "the last one is over")
        kiosk.http.post("/widgets/short", json={"inputs": {}})
        answer = kiosk.http.post("/widgets/short/cancel").json()
        return str(answer["reason"]).startswith("The robot refused to cancel at ")

    until(refused, "a cancel is refused")


@pytest.mark.parametrize("speed", [130.0, 900.0])
def test_demo_robots_parameters_are_set_all_or_none(speed: float) -> None:
    robot = DemoRobot()
    values = {"work_light": (1, "bool_value", True), "speed": (3, "double_value", speed)}
    parameters = [
        SimpleNamespace(name=name, value=SimpleNamespace(**{**EMPTY_VALUE, "type": kind, field: value}))
        for name, (kind, field, value) in values.items()
    ]
    request = SimpleNamespace(parameters=parameters)
    result = robot.parameters.serve(f"{NODE}/set_parameters_atomically", request)["result"]
    reason = "" if speed < 500 else "parameter 'speed' is out of its range"
    assert result == {"successful": not reason, "reason": reason}
    assert robot.parameters.value("work_light", None) is (not reason)
