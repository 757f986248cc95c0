"""A map of a real ROS 2 node through the real bridge: latched, also for a panel that starts later."""

from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.support.parts import Bridge, RosNode, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("values")

PANEL: Final = """
title = "Shuttle"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
max_age_s = 1.0
pose = { topic = "/pose", type = "geometry_msgs/msg/PoseStamped" }
"""
GRID: Final = "nav_msgs/msg/OccupancyGrid"
POSE: Final = "geometry_msgs/msg/PoseStamped"
UPRIGHT: Final = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


@pytest.fixture
def robot(own_bridge: Bridge) -> Iterator[RosNode]:
    node = RosNode(own_bridge.domain, "map_server")
    yield node
    node.end()


def publish_pose(node: RosNode, x: float, frame: str = "map") -> None:
    pose = {"position": {"x": x, "y": 0.0, "z": 0.0}, "orientation": UPRIGHT}
    node.publish("/pose", {"header": {"frame_id": frame}, "pose": pose})


def publish_map(node: RosNode, cells: list[int], width: int, height: int) -> None:
    origin = {"position": {"x": -1.0, "y": -1.0, "z": 0.0}, "orientation": UPRIGHT}
    info = {"resolution": 0.5, "width": width, "height": height, "origin": origin}
    node.publish("/map", {"header": {"frame_id": "map"}, "info": info, "data": cells})


def test_a_map_and_its_robot_are_shown_to_a_panel_that_starts_later(
    own_bridge: Bridge, robot: RosNode, tmp_path: Path
) -> None:
    robot.advertise("/map", GRID, durability="transient_local", depth=1)
    robot.advertise("/pose", POSE)
    publish_map(robot, [0, 100, -1, 0], 2, 2)
    with live_server(own_bridge, tmp_path, PANEL) as kiosk:
        first = until(lambda: kiosk.widget("hall")["grid"], "the latched map is read")
        assert (first["width"], first["height"], first["x"]) == (2, 2, -1.0)
        assert kiosk.widget("hall")["pose"] is None

        def is_at(x: float, frame: str, state: str, pose: list[float] | None) -> bool:
            publish_pose(robot, x, frame)
            shown = kiosk.widget("hall")
            return bool((shown["state"], shown["pose"]) == (state, pose))

        until(lambda: is_at(3.0, "map", "live", [3.0, 0.0, 0.0]), "the robot is on the map")
        until(lambda: is_at(4.0, "odom", "old", None), "a pose in another frame is not drawn")
        until(lambda: is_at(3.0, "map", "live", [3.0, 0.0, 0.0]), "the robot is on the map again")
        until(lambda: kiosk.widget("hall")["state"] == "old", "without a pose it is old")
        assert kiosk.widget("hall")["pose"] == [3.0, 0.0, 0.0]
        publish_map(robot, [0] * 6, 3, 2)
        until(lambda: kiosk.widget("hall")["grid"]["width"] == 3, "another map is shown")
        path = f"/widgets/hall/map/{first['version']}/0-0.png"
        assert kiosk.http.get(path).status_code == 404
