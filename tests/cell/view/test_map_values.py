"""What a map shows: its geometry, where the robot is, and what is wrong."""

import math
import time
from pathlib import Path
from types import SimpleNamespace as Message
from typing import Any, Final

import pytest

from app.cell.robot.maps import GRID_TYPE, TOO_FAST, read_grid
from app.cell.robot.state import RobotState, Sample
from app.cell.view.map_values import map_view
from app.cell.view.view import build_view
from app.panel.geojson import read_route_graph
from app.panel.widgets.map_view import MapRoutes
from tests.support.beside_panel import feature, put_geojson
from tests.support.builders import BRIDGE, INTERFACES, NOW, endpoint, panel_of, robot_there
from tests.support.words import english

MAP: Final = {"id": "hall", "kind": "map", "label": "Hall", "max_age_s": 1.0}
POSE: Final = {"topic": "/amcl_pose"}
POSE_TYPE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
INFO: Final = {"width": 2, "height": 1, "resolution": 0.5, "origin": {"orientation": {"w": 1.0}}}


def robot_with(frame: str = "map", **keys: Any) -> tuple[Any, RobotState]:
    """A robot whose map was read."""
    panel = panel_of(MAP | keys)
    robot = robot_there(panel)
    message = {"header": {"frame_id": frame}, "info": INFO, "data": [0, 100]}
    robot.maps["map"].grid = read_grid(INTERFACES, INTERFACES.encode(GRID_TYPE, message))
    robot.maps["map"].wall = robot.maps["map"].at = NOW
    return panel, robot


def moved(robot: RobotState, x: float, at: float = NOW, child: str = "base_link") -> None:
    """The robot's transforms say where it is."""
    transform = Message(
        header=Message(frame_id="map", stamp=Message(sec=1, nanosec=0)),
        child_frame_id=child,
        transform=Message(
            translation=Message(x=x, y=2.0, z=0.0), rotation=Message(x=0.0, y=0.0, z=0.0, w=1.0)
        ),
    )
    robot.transforms.record(Message(transforms=[transform]), at, is_static=False)


def pose_said(robot: RobotState, frame: str = "map", x: float = 1.5, source: str = BRIDGE) -> None:
    place = {"position": {"x": x, "y": 0.0}, "orientation": {"z": 1.0, "w": 0.0}}
    message = {"header": {"frame_id": frame}, "pose": {"pose": place}}
    robot.update("amcl_pose", Sample(INTERFACES.encode(POSE_TYPE, message), 1, NOW, NOW, source))


def shown(panel: Any, robot: RobotState, now: float = NOW) -> Any:
    return english(build_view(panel, robot, now).view["widgets"]["hall"])


def test_a_map_has_its_geometry_and_the_robot_by_its_transforms() -> None:
    panel, robot = robot_with()
    moved(robot, 1.234)
    view = shown(panel, robot)
    assert (view["state"], view["note"], view["pose"]) == ("live", "", [1.23, 2.0, 0.0])
    grid = view["grid"]
    assert (grid["width"], grid["height"], grid["resolution"], grid["x"], grid["yaw"]) == (
        2,
        1,
        0.5,
        0,
        0,
    )


def test_a_map_that_has_not_come_or_can_not_be_read_says_so() -> None:
    panel, robot = robot_with()
    robot.maps["map"].grid = None
    assert (shown(panel, robot)["state"], shown(panel, robot)["note"]) == (
        "waiting",
        "Waiting for the robot's map",
    )
    robot.maps["map"].problem = "The map has no cells"
    view = shown(panel, robot)
    assert (view["state"], view["note"], view["grid"]) == ("unreadable", "The map has no cells", None)


def test_an_old_pose_is_where_the_robot_was_last_seen_and_says_so() -> None:
    panel, robot = robot_with()
    moved(robot, 1.0, NOW - 6.2)
    view = shown(panel, robot)
    assert (view["state"], view["pose"]) == ("old", [1.0, 2.0, 0.0])
    assert view["note"] == "The robot was here 6 s ago. Its position now is not known."


def test_the_pose_gets_old_without_a_message() -> None:
    panel, robot = robot_with()
    moved(robot, 1.0, NOW)
    built = build_view(panel, robot, NOW)
    assert built.until == NOW + 1.0
    assert shown(panel, robot, NOW + 1.0)["state"] == "old"


@pytest.mark.parametrize(
    ("frame", "child", "note"),
    [
        ("map", "base_footprint", "No transform from map to base_link: base_link is missing"),
        ("world", "base_link", "No transform from world to base_link: world is missing"),
    ],
)
def test_a_robot_without_a_way_to_the_map_is_not_drawn(frame: str, child: str, note: str) -> None:
    panel, robot = robot_with(frame)
    moved(robot, 1.0, child=child)
    view = shown(panel, robot)
    assert (view["state"], view["note"], view["pose"]) == ("old", note, None)
    assert view["grid"] is not None


def test_a_pose_may_be_that_of_a_topic() -> None:
    panel, robot = robot_with(pose=POSE)
    assert shown(panel, robot)["note"] == "Waiting for the robot's position"
    pose_said(robot)
    view = shown(panel, robot)
    assert (view["state"], view["pose"]) == ("live", [1.5, 0.0, pytest.approx(math.pi, abs=0.01)])


@pytest.mark.parametrize(
    ("frame", "x", "note"),
    [
        ("odom", 1.0, "The robot's position is in the frame odom. The map is in map."),
        ("map", math.nan, "The robot's position has a number that is not finite, or no rotation"),
    ],
)
def test_a_pose_that_is_not_on_the_map_is_not_drawn(frame: str, x: float, note: str) -> None:
    panel, robot = robot_with(pose=POSE)
    pose_said(robot, frame, x)
    view = shown(panel, robot)
    assert (view["state"], view["note"], view["pose"]) == ("old", note, None)


def test_a_cut_link_makes_the_map_old() -> None:
    panel, robot = robot_with()
    moved(robot, 1.0)
    robot.mark_link_lost()
    view = shown(panel, robot)
    assert (view["state"], view["pose"]) == ("old", [1.0, 2.0, 0.0])
    assert view["note"].startswith("Received ") or view["note"], view["note"]


def test_after_a_cut_the_map_is_old_until_it_comes_again() -> None:
    panel, robot = robot_with()
    moved(robot, 1.0)
    robot.mark_peer_lost(BRIDGE, 10)
    moved(robot, 1.0)
    assert shown(panel, robot)["state"] == "old"
    robot.maps["map"].at = time.monotonic()  # as the listener does with the next map
    assert shown(panel, robot)["state"] == "live"


def test_a_map_that_changes_too_fast_says_so() -> None:
    panel, robot = robot_with()
    moved(robot, 1.0)
    robot.maps["map"].overtaken = TOO_FAST
    view = shown(panel, robot)
    assert view["detail"] == view["layer_note"] == "The map changes faster than it can be read"


def test_a_map_of_another_session_is_not_the_robots() -> None:
    panel, robot = robot_with()
    moved(robot, 1.0)
    robot.maps["map"].source = "0123456789abcdef"
    assert shown(panel, robot)["state"] == "old"


def test_a_pose_of_another_session_is_not_drawn() -> None:
    panel, robot = robot_with(pose=POSE)
    pose_said(robot, source="0123456789abcdef")
    view = shown(panel, robot)
    assert (view["state"], view["pose"]) == ("old", None)


def test_transforms_of_another_type_are_named() -> None:
    panel, robot = robot_with()
    endpoint(robot, "MP", "/tf", "std_msgs/msg/String")
    view = shown(panel, robot)
    assert (view["state"], view["pose"]) == ("old", None)
    assert view["note"].startswith("/tf is std_msgs/msg/String")


@pytest.mark.parametrize(
    ("properties", "frame", "note"),
    [
        ({}, "odom", ""),
        ({"frame": "map"}, "map", ""),
        (
            {"frame": "map"},
            "odom",
            "The routes are in the frame map, the map is in odom: they are not drawn.",
        ),
    ],
)
def test_routes_in_another_frame_than_the_map_are_not_drawn(
    tmp_path: Path, properties: dict[str, Any], frame: str, note: str
) -> None:
    file = put_geojson(tmp_path / "ways.geojson", feature("Point", [0.0, 1.0], id=1, **properties))
    graph = read_route_graph(file)
    panel, robot = robot_with(frame)
    moved(robot, 1.0)
    routes = MapRoutes.model_construct(file=file)
    view = panel.map_views["hall"].model_copy(update={"routes": routes})
    attributes = english(map_view(view, robot, NOW)[0])
    assert attributes["routes"] == {"version": "" if note else graph.version, "note": note}
    assert attributes["layer_note"] == note
    robot.maps["map"].grid = None
    assert map_view(view, robot, NOW)[0]["routes"] == {"version": "", "note": ""}
