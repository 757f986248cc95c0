"""A map of real ROS 2 nodes through the real bridge: latched, also for a panel that starts later,
with a pose or with transforms, and with layers."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.cyclone import Client, CycloneRobot
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
"""
WITH_TOPIC: Final = 'pose = { topic = "/pose", type = "geometry_msgs/msg/PoseStamped" }\n'
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
    with live_server(own_bridge, tmp_path, PANEL + WITH_TOPIC) as kiosk:
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


TF: Final = "tf2_msgs/msg/TFMessage"


def test_transforms_at_50_hz_place_the_robot_until_they_end(
    own_cyclone_bridge: Bridge,
    cyclone_robots: Callable[..., CycloneRobot],
    own_client: Client,
    tmp_path: Path,
) -> None:
    driven = cyclone_robots(own_cyclone_bridge.domain)
    map_server = RosNode(own_cyclone_bridge.domain, "map_server")
    try:
        map_server.advertise("/map", GRID, durability="transient_local", depth=1)
        publish_map(map_server, [0, 100, -1, 0], 2, 2)
        driven.advertise(topic="/tf_static", type=TF, durability="transient_local", depth=1)
        driven.advertise(topic="/tf", type=TF)
        driven.transform(topic="/tf_static", parent="map", child="odom", x=1.0)
        driven.transform(topic="/tf", parent="odom", child="base_link", x=2.0, hz=50)
        with live_server(own_cyclone_bridge, tmp_path, PANEL) as kiosk:
            until(lambda: kiosk.widget("hall")["grid"], "the map is read")
            until(lambda: kiosk.widget("hall")["pose"] == [3.0, 0.0, 0.0], "the robot is on the map")
            assert kiosk.widget("hall")["state"] == "live"
            driven.transform(topic="/tf", parent="odom", child="base_link", x=4.0)  # and then no more
            until(lambda: kiosk.widget("hall")["pose"] == [5.0, 0.0, 0.0], "it is where it drove")
            until(lambda: kiosk.widget("hall")["state"] == "old", "without transforms it is old")
            assert kiosk.widget("hall")["pose"] == [5.0, 0.0, 0.0]
            driven.transform(topic="/tf", parent="odom", child="other", x=0.0)
            driven.transform(topic="/tf", parent="world", child="base_link", x=0.0)
            until(lambda: kiosk.widget("hall")["pose"] is None, "another tree has no way to the map")
            assert "base_link" in kiosk.widget("hall")["note"]
    finally:
        map_server.end()


LAYERS: Final = """
[[page.widget.layer]]
shows = "scan"
topic = "/scan"
max_age_s = 5.0
[[page.widget.layer]]
shows = "path"
topic = "/plan"
[[page.widget.layer]]
shows = "costmap"
topic = "/costmap"
"""
SCAN: Final = "sensor_msgs/msg/LaserScan"
PATH: Final = "nav_msgs/msg/Path"
UPDATE: Final = "map_msgs/msg/OccupancyGridUpdate"
BEAMS: Final = {"angle_increment": 1.0, "range_min": 0.1, "range_max": 9.0}


def test_layers_are_placed_by_transforms_and_a_costmap_takes_its_updates(
    own_cyclone_bridge: Bridge,
    cyclone_robots: Callable[..., CycloneRobot],
    own_client: Client,
    tmp_path: Path,
) -> None:
    driven = cyclone_robots(own_cyclone_bridge.domain)
    nav = RosNode(own_cyclone_bridge.domain, "nav")
    try:
        for topic in ("/map", "/costmap"):
            nav.advertise(topic, GRID, durability="transient_local", depth=1)
        nav.advertise("/scan", SCAN, reliability="best_effort")
        nav.advertise("/plan", PATH)
        publish_map(nav, [0, 100, -1, 0], 2, 2)
        info = {"resolution": 0.5, "width": 2, "height": 2, "origin": {"orientation": UPRIGHT}}
        costs = {"header": {"frame_id": "map"}, "info": info, "data": [0, 0, 0, 100]}
        nav.publish("/costmap", costs)
        driven.advertise(topic="/tf", type=TF)
        driven.advertise(topic="/costmap_updates", type=UPDATE)
        driven.transform(topic="/tf", parent="map", child="base_link", x=2.0, hz=50)
        with live_server(own_cyclone_bridge, tmp_path, PANEL + LAYERS) as kiosk:

            def layer(number: int) -> dict[str, Any]:
                return dict(kiosk.widget("hall")[f"layer_{number}"])

            def scanned() -> bool:
                header = {"frame_id": "base_link"}
                nav.publish("/scan", {"header": header, "ranges": [1.0, float("inf")], **BEAMS})
                return bool(layer(0).get("points") == [300, 0])

            def planned() -> bool:
                poses = [{"pose": {"position": {"x": x, "y": 1.0, "z": 0.0}}} for x in (2.0, 3.5)]
                nav.publish("/plan", {"header": {"frame_id": "map"}, "poses": poses})
                return bool(layer(1).get("points") == [200, 100, 350, 100])

            until(scanned, "the scan is where the robot is")
            until(planned, "the path is on the map")
            first = until(lambda: layer(2).get("grid"), "the latched costmap is read")

            def updated() -> bool:
                driven.update_map(topic="/costmap_updates", x=1, y=0, width=1, data=[99, 99])
                return bool(layer(2)["grid"]["version"] != first["version"])

            until(updated, "the update is applied")
            assert kiosk.widget("hall")["layer_note"] == ""
            path = f"/widgets/hall/map/{layer(2)['grid']['version']}/0-0.png"
            assert kiosk.http.get(path).status_code == 200
            driven.update_map(topic="/costmap_updates", x=2, y=0, width=1, data=[99])
            until(lambda: layer(2)["state"] == "old", "an update outside of it is named")
    finally:
        nav.end()


FLEET: Final = """
title = "Hall 3"
[[robot]]
id = "left"
name = "Shuttle 1"
namespace = "/left"
[[robot]]
id = "middle"
name = "Shuttle 2"
namespace = "/middle"
[[robot]]
id = "right"
name = "Shuttle 3"
namespace = "/right"
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
robots = "all"
max_age_s = 2.0
"""
PLACES: Final = {"left": 1.0, "middle": 2.0, "right": 3.0}


def test_several_robots_of_one_map_each_with_its_own_age(own_bridge: Bridge, tmp_path: Path) -> None:
    nodes = {name: RosNode(own_bridge.domain, f"{name}_driver") for name in PLACES}
    try:
        for name, node in nodes.items():
            node.advertise(f"/{name}/map", GRID, durability="transient_local", depth=1)
            node.advertise(f"/{name}/pose", POSE)
            origin = {"position": {"x": -1.0, "y": -1.0, "z": 0.0}, "orientation": UPRIGHT}
            info = {"resolution": 0.5, "width": 10, "height": 4, "origin": origin}
            node.publish(
                f"/{name}/map", {"header": {"frame_id": "map"}, "info": info, "data": [0] * 40}
            )
        with live_server(own_bridge, tmp_path, FLEET + WITH_TOPIC) as kiosk:

            def drive(*names: str) -> None:
                for name in names:
                    pose = {"position": {"x": PLACES[name], "y": 0.0, "z": 0.0}, "orientation": UPRIGHT}
                    nodes[name].publish(f"/{name}/pose", {"header": {"frame_id": "map"}, "pose": pose})

            def rows(own: str) -> dict[str, tuple[str, list[float] | None]]:
                """The other robots on a robot's map: their states and poses."""
                shown = kiosk.robot(own).widget("hall")["robots"]
                return {row["robot"]: (row["state"], row["pose"]) for row in shown}

            def on_map(name: str, state: str) -> tuple[str, list[float]]:
                return state, [PLACES[name], 0.0, 0.0]

            def all_live() -> bool:
                drive(*PLACES)
                return all(
                    rows(own) == {name: on_map(name, "live") for name in PLACES if name != own}
                    for own in PLACES
                )

            until(all_live, "each map has the other two, where they are")

            def middle_is_old() -> bool:
                drive("left", "right")
                return rows("left")["middle"][0] == "old"

            until(middle_is_old, "the robot that stopped is old")
            drive("left", "right")
            for own, other in (("left", "right"), ("right", "left")):
                assert rows(own) == {
                    "middle": on_map("middle", "old"),  # it is drawn where it was
                    other: on_map(other, "live"),
                }
            (stopped,) = (
                row for row in kiosk.robot("left").widget("hall")["robots"] if row["robot"] == "middle"
            )
            assert stopped["label"].startswith("Shuttle 2, "), stopped
            assert rows("middle") == {name: on_map(name, "live") for name in ("left", "right")}
            assert kiosk.robot("middle").widget("hall")["state"] == "old"
            nodes["right"].end()  # a node that is gone
            until(lambda: rows("left")["right"][0] == "old", "the robot whose node ended is old")
            assert kiosk.robot("left").widget("hall")["robots_note"] == ""
    finally:
        for node in nodes.values():
            node.end()
