"""Scaffold and doctor on a robot that drives: rclpy nodes with the names of Nav2 through the bridge."""

import json
import subprocess
import tomllib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.panel import check_panel
from tests.support.parts import Bridge, RosNode, until, zenoh_file
from tests.support.processes import command
from tests.support.processes.command import COMMAND
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("doctor")

GRID: Final = "nav_msgs/msg/OccupancyGrid"
POSE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
BATTERY: Final = "sensor_msgs/msg/BatteryState"
UPRIGHT: Final = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
LATCHED: Final = {"durability": "transient_local", "depth": 1}
TOPICS: Final = ("/map", "/amcl_pose", "/battery_state", "/motors_ready", "/cmd_vel")


@pytest.fixture
def robot(own_bridge: Bridge) -> Iterator[dict[str, RosNode]]:
    """The nodes, by their names. The map is latched."""
    nodes = {name: RosNode(own_bridge.domain, name) for name in ("map_server", "amcl", "driver")}
    try:
        nodes["map_server"].advertise("/map", GRID, **LATCHED)
        nodes["amcl"].advertise("/amcl_pose", POSE, **LATCHED)
        nodes["driver"].advertise("/battery_state", BATTERY)
        nodes["driver"].subscribe("/cmd_vel", "geometry_msgs/msg/Twist")
        nodes["driver"].advertise("/motors_ready", "std_msgs/msg/Bool", **LATCHED)
        nodes["driver"].publish("/motors_ready", {"data": True})
        publish_map(nodes["map_server"])
        located = {"pose": {"position": {"x": 1.0, "y": 2.0, "z": 0.0}, "orientation": UPRIGHT}}
        nodes["amcl"].publish("/amcl_pose", {"header": {"frame_id": "map"}, "pose": located})
        nodes["driver"].every("/battery_state", {"percentage": 0.5}, 0.2)
        yield nodes
    finally:
        for node in nodes.values():
            node.end()


def publish_map(node: RosNode) -> None:
    origin = {"position": {"x": -1.0, "y": -1.0, "z": 0.0}, "orientation": UPRIGHT}
    info = {"resolution": 0.5, "width": 2, "height": 2, "origin": origin}
    node.publish("/map", {"header": {"frame_id": "map"}, "info": info, "data": [0, 100, -1, 0]})


def run(bridge: Bridge, *words: str) -> subprocess.CompletedProcess[str]:
    return command.run(COMMAND, *words, "--connect", bridge.endpoint)


def announced(bridge: Bridge) -> bool:
    return set(TOPICS) <= set(run(bridge, "topics").stdout.split())


def scaffolded(bridge: Bridge, folder: Path) -> str:
    until(lambda: announced(bridge), "the bridge announces the topics")
    path = folder / "shuttle.toml"
    done = run(bridge, "scaffold", "-o", str(path), "--listen", "5")
    assert done.returncode == 0, done.stderr
    check_panel(path)
    return path.read_text()


def first_page(text: str) -> dict[str, Any]:
    page: dict[str, Any] = tomllib.loads(text)["page"][0]
    return {widget["id"]: widget for widget in page["widget"]} | {"page": page["id"]}


def test_scaffold_has_a_page_with_the_map_that_is_alive_at_once(
    own_bridge: Bridge, robot: dict[str, RosNode], tmp_path: Path
) -> None:
    text = scaffolded(own_bridge, tmp_path)
    shown = first_page(text)
    assert shown["page"] == "map"
    assert shown["map"]["pose"] == {"topic": "/amcl_pose", "type": POSE}
    assert shown["battery_state_percentage"]["kind"] == "gauge"
    assert '# topic = "/cmd_vel"' in text
    with live_server(own_bridge, tmp_path, text) as server:
        kiosk = server.robot("robot")
        until(lambda: kiosk.widget("map")["pose"] == [1.0, 2.0, 0.0], "the robot is on the map")
        assert kiosk.widget("map")["grid"]["width"] == 2


def findings_of(bridge: Bridge, folder: Path, text: str) -> list[tuple[str, str]]:
    panel = folder / "doctored.toml"
    panel.write_text(text)
    zenoh = str(zenoh_file(folder, bridge.endpoint))
    done = command.run(COMMAND, "doctor", str(panel), "--zenoh", zenoh, "--json")
    return [(finding["code"], finding["about"]) for finding in json.loads(done.stdout)["findings"]]


def test_doctor_finds_a_volatile_map_and_a_missing_way(
    own_bridge: Bridge, robot: dict[str, RosNode], tmp_path: Path
) -> None:
    text = scaffolded(own_bridge, tmp_path)
    by_pose = findings_of(own_bridge, tmp_path, text)
    assert not [finding for finding in by_pose if finding[0].startswith("map_")]
    by_transforms = "".join(line for line in text.splitlines(True) if not line.startswith("pose ="))
    assert ("map_no_transform", "/map") in findings_of(own_bridge, tmp_path, by_transforms)
    volatile = RosNode(own_bridge.domain, "slam")
    try:
        volatile.advertise("/map", GRID)
        until(
            lambda: ("map_not_latched", "/map") in findings_of(own_bridge, tmp_path, text),
            "the volatile map is found",
        )
    finally:
        volatile.end()
