"""A robot whose nodes are in a namespace, behind the real bridge with and without one of its own:
topics that are not below the namespace, the nodes' log and their parameter events."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.tools.cli.command import main
from tests.support.cyclone import CycloneRobot
from tests.support.parts import Bridge, RosNode, Server, live, publish_until, until

LOG: Final = "rcl_interfaces/msg/Log"
DIAGNOSTICS: Final = "diagnostic_msgs/msg/DiagnosticArray"
STATUS: Final = {"level": 0, "name": "drive", "message": "warm", "hardware_id": "", "values": []}
OF_ROBOT: Final = """
title = "Mobile robot"
mode = "live"
namespace = "/amr"

[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "speed"
kind = "readout"
label = "Speed"
topic = "/speed"
type = "std_msgs/msg/Float64"
[[page.widget]]
id = "log"
kind = "log"
label = "Log"
own = true
[[page.widget]]
id = "limit"
kind = "parameter"
label = "Limit"
node = "/cyclone_robot"
parameter = "limit"
type = "integer"
"""
OF_CELL: Final = """
[[page.widget]]
id = "diagnostics"
kind = "readout"
label = "Diagnostics"
topic = "//diagnostics"
type = "diagnostic_msgs/msg/DiagnosticArray"
field = "status[0].message"
[[page.widget]]
id = "start"
kind = "publish"
label = "Start"
topic = "//cell/start"
type = "std_msgs/msg/Bool"
message = { data = true }
interlock = "operation"
[[interlock]]
id = "operation"
topic = "//cell/permitted"
"""
Started = Callable[..., tuple[Bridge, RosNode, Server]]


@pytest.fixture
def started(domain: int, tmp_path: Path) -> Iterator[Started]:
    """A panel behind a bridge with what `bridge-config` writes for it, and a node of the robot."""
    parts: list[Any] = []

    def start(panel: str, *options: str, namespace: str = "") -> tuple[Bridge, RosNode, Server]:
        path, file = tmp_path / "amr.toml", tmp_path / "bridge.json5"
        path.write_text(panel)
        bridge = Bridge(domain + 2)
        place = ["--domain", str(bridge.domain), "--listen", bridge.endpoint, "-o", str(file)]
        assert main(["bridge-config", str(path), *options, *place]) == 0
        bridge.configure(file)
        bridge.start()
        parts.append(bridge)
        node = RosNode(bridge.domain)
        parts.append(node)
        node.advertise(f"{namespace}/speed", "std_msgs/msg/Float64")
        node.advertise("/rosout", LOG, durability="transient_local", depth=1000)
        node.subscribe("/rosout", LOG, durability="transient_local", depth=1000)
        kiosk = live(bridge.endpoint, tmp_path, KIOSK_PANEL=str(path))
        parts.append(kiosk)
        until(kiosk.ready, "ready")
        return bridge, node, kiosk

    yield start
    for part in reversed(parts):
        part.end()


def line(text: str, namespace: str = "") -> dict[str, Any]:
    """A line of the node `controller`, whose logger has the name of its namespace."""
    name = ".".join([*namespace.split("/")[1:], "controller"])
    return {"stamp": {"sec": 7}, "level": 20, "name": name, "msg": text}


def lines(kiosk: Server, search: str) -> list[Any]:
    logged: list[Any] = kiosk.http.get("/widgets/log/lines", params={"search": search}).json()["lines"]
    return logged


def shows(kiosk: Server, widget: str, text: str) -> bool:
    return bool(kiosk.widget(widget)["text"] == text)


def heard(node: RosNode, word: str) -> bool:
    return any(word in line["msg"] for line in node.heard("/rosout"))


@pytest.mark.parametrize(
    ("options", "namespace"),
    [(("--prefixed",), "/amr"), ((), "")],
    ids=["nodes in the namespace", "the bridge adds it"],
)
def test_the_log_and_parameter_events_are_where_the_bridge_has_them(
    started: Started,
    cyclone_robots: Callable[..., CycloneRobot],
    options: tuple[str, ...],
    namespace: str,
) -> None:
    bridge, node, kiosk = started(OF_ROBOT, *options, namespace=namespace)
    topic = f"{namespace}/speed"
    publish_until(node, topic, {"data": 1.5}, lambda: shows(kiosk, "speed", "1.5"))
    publish_until(node, "/rosout", line("hello", namespace), lambda: lines(kiosk, "hello"))
    robot = cyclone_robots(bridge.domain, namespace=namespace)
    until(lambda: kiosk.widget("limit")["enabled"], "the parameters are read")
    until(lambda: robot.subscribers(topic="/parameter_events"), "its events are heard")
    calls = len(robot.requests(f"{namespace}/cyclone_robot/get_parameters"))
    assert calls
    robot.set_parameters(values={"limit": 33})
    until(lambda: shows(kiosk, "limit", "33"), "the event is shown")
    assert len(robot.requests(f"{namespace}/cyclone_robot/get_parameters")) == calls
    until(
        lambda: kiosk.press("limit", inputs={"limit": 34}).json()["outcome"] == "succeeded",
        "it is set",
    )
    until(lambda: lines(kiosk, "of limit"), "the panel's own lines are beside them")
    until(lambda: heard(node, "of limit"), "the robot's nodes have its lines")


def test_topics_outside_the_namespace_are_shown_lock_and_are_published(started: Started) -> None:
    _, node, kiosk = started(OF_ROBOT + OF_CELL, "--prefixed", namespace="/amr")
    node.advertise("/diagnostics", DIAGNOSTICS)
    node.advertise("/cell/permitted", "std_msgs/msg/Bool")
    node.subscribe("/cell/start", "std_msgs/msg/Bool")
    publish_until(
        node, "/diagnostics", {"status": [STATUS]}, lambda: shows(kiosk, "diagnostics", "warm")
    )
    assert not kiosk.widget("start")["enabled"]
    publish_until(node, "/cell/permitted", {"data": True}, lambda: kiosk.widget("start")["enabled"])
    until(lambda: kiosk.press("start", inputs={}).json()["outcome"] == "published", "it is pressed")
    until(lambda: True in node.heard_data("/cell/start"), "the cell has it")
