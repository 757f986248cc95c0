"""A map of a robot on rmw_zenoh: the latched map of a node that began before the panel, transforms, and
a goal as a press."""

import asyncio
import time
from collections.abc import Iterator
from functools import partial
from typing import Any, Final

import pytest

from app.cell.session.session import RobotSession
from app.panel.model import Panel
from tests.cell.session.test_rmw_zenoh import LATCHED, enabled, session_with
from tests.support.builders import panel_of, press_widget
from tests.support.rmw import RmwNode, Router
from tests.support.waiting import when

pytestmark = pytest.mark.promise("dialects")

GRID: Final = "nav_msgs/msg/OccupancyGrid"
TF: Final = "tf2_msgs/msg/TFMessage"
POSE: Final = "geometry_msgs/msg/PoseStamped"
HALL: Final = {"id": "hall", "kind": "map", "label": "Hall", "radius": 0.2, "max_age_s": 60.0}
GOAL: Final = {"id": "goal", "kind": "place", "label": "Places", "map": "hall", "touch": True}
DRIVE: Final = {
    "id": "drive",
    "kind": "publish",
    "label": "Drive",
    "topic": "/goal_pose",
    "type": POSE,
    "message": {"header": {"frame_id": "{goal.frame}", "stamp": "{now}"}, "pose": "{goal.pose}"},
}
SIDE: Final = 40
UPRIGHT: Final = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}


def panel() -> Panel:
    return panel_of(HALL, GOAL, DRIVE, dialect="rmw_zenoh")


def transform(parent: str, child: str, x: float) -> dict[str, Any]:
    second, rest = divmod(time.time_ns(), 10**9)
    header = {"frame_id": parent, "stamp": {"sec": second, "nanosec": rest}}
    moved = {"translation": {"x": x, "y": 0.0, "z": 0.0}, "rotation": UPRIGHT}
    return {"transforms": [{"header": header, "child_frame_id": child, "transform": moved}]}


@pytest.fixture
def robot(router: Router) -> Iterator[RmwNode]:
    """A node with a latched map of free floor and a latched transform, which listens for goals."""
    node = RmwNode(router, "shuttle")
    node.subscribe("/goal_pose", POSE)
    node.advertise("/map", GRID, **LATCHED)
    node.advertise("/tf_static", TF, **LATCHED)
    node.advertise("/tf", TF)
    origin = {"position": {"x": -2.0, "y": -2.0, "z": 0.0}, "orientation": UPRIGHT}
    info = {"resolution": 0.1, "width": SIDE, "height": SIDE, "origin": origin}
    node.publish("/map", {"header": {"frame_id": "map"}, "info": info, "data": [0] * SIDE**2})
    node.publish("/tf_static", transform("map", "odom", 0.5))
    yield node
    node.end()


def shown(session: RobotSession, widget: str = "hall") -> Any:
    return session.publisher.view["widgets"][widget]


def is_at(session: RobotSession, robot: RmwNode, x: float) -> bool:
    robot.publish("/tf", transform("odom", "base_link", x - 0.5))
    return bool(shown(session)["pose"] == [x, 0.0, 0.0] and shown(session)["state"] == "live")


def test_a_latched_map_transforms_and_a_goal(router: Router, robot: RmwNode) -> None:
    async def scene() -> None:
        async with session_with(router, panel()) as session:
            await when(lambda: shown(session)["grid"], "the map of before the panel's start came")
            assert not enabled(session, "drive")  # it is not known where the robot is
            refused = await press_widget(session.presses, "drive", {"goal": touched(session)}, "g1")
            assert refused.outcome == "refused"
            assert robot.heard("/goal_pose") == []
            await when(partial(is_at, session, robot, 1.0), "the robot is on the map")
            await when(partial(enabled, session, "drive"), "permitted")
            sent = await press_widget(session.presses, "drive", {"goal": touched(session)}, "g2")
            assert sent.outcome == "published", sent.reason
            await when(lambda: len(robot.heard("/goal_pose")) == 1, "the goal is received")
            (goal,) = robot.heard("/goal_pose")
            assert goal["header"]["frame_id"] == "map"
            assert goal["pose"]["position"] == {"x": 1.25, "y": -0.75, "z": 0.0}
            assert robot.broken() == []

    asyncio.run(scene())


def touched(session: RobotSession) -> str:
    return f"x=1.25 y=-0.75 yaw=1.57 map={shown(session)['grid']['version']}"
