"""A goal on a map of real ROS 2 nodes through the real bridge: exactly the pose of the card, in the
map's frame; and none where the map or the position is not known."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from tests.bridge.test_map_on_bridge import GRID, PANEL, POSE, UPRIGHT, WITH_TOPIC
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("places")

WITH_COVARIANCE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
GOALS: Final = """
[[page.widget]]
id = "goal"
kind = "place"
label = "Places"
map = "hall"
touch = true
[[page.widget]]
id = "drive"
kind = "publish"
label = "Drive"
topic = "/goal_pose"
type = "geometry_msgs/msg/PoseStamped"
message = { header = { frame_id = "{goal.frame}", stamp = "{now}" }, pose = "{goal.pose}" }
[[page.widget]]
id = "here"
kind = "publish"
label = "Robot is here"
topic = "/initialpose"
type = "geometry_msgs/msg/PoseWithCovarianceStamped"
message = { header = { frame_id = "{goal.frame}", stamp = "{now}" }, pose = { pose = "{goal.pose}" } }
"""


@pytest.fixture
def robot(own_bridge: Bridge) -> Iterator[RosNode]:
    node = RosNode(own_bridge.domain, "navigator")
    yield node
    node.end()


def publish_map(node: RosNode, wall: bool = False) -> None:
    """4 m x 4 m of free floor from -1 m on, with a wall or without."""
    origin = {"position": {"x": -1.0, "y": -1.0, "z": 0.0}, "orientation": UPRIGHT}
    info = {"resolution": 0.5, "width": 8, "height": 8, "origin": origin}
    cells = [100 if wall and n % 8 == 7 else 0 for n in range(64)]
    node.publish("/map", {"header": {"frame_id": "map"}, "info": info, "data": cells})


def publish_pose(node: RosNode) -> None:
    pose = {"position": {"x": 0.5, "y": 0.5, "z": 0.0}, "orientation": UPRIGHT}
    node.publish("/pose", {"header": {"frame_id": "map"}, "pose": pose})


def press(server: Server, widget: str, value: str) -> tuple[int, str]:
    receipt = server.http.post(f"/widgets/{widget}", json={"inputs": {"goal": value}})
    return receipt.status_code, receipt.json()["reason"]


def test_the_robot_gets_the_card_s_pose_and_none_that_is_in_doubt(
    own_bridge: Bridge, robot: RosNode, tmp_path: Path
) -> None:
    robot.advertise("/map", GRID, durability="transient_local", depth=1)
    robot.advertise("/pose", POSE)
    robot.subscribe("/goal_pose", POSE)
    robot.subscribe("/initialpose", WITH_COVARIANCE)
    publish_map(robot)
    with live_server(own_bridge, tmp_path, PANEL + WITH_TOPIC + GOALS) as kiosk:
        version = until(lambda: kiosk.widget("hall")["grid"], "the map is read")["version"]
        value = f"x=1.25 y=0.75 yaw=1.57 map={version}"
        status, reason = press(kiosk, "drive", value)
        assert (status, "not known where the robot is" in reason) == (409, True)

        def sent(widget: str) -> bool:
            publish_pose(robot)  # it is there until the press
            return press(kiosk, widget, value)[0] == 200

        until(lambda: sent("drive"), "the position is known")
        (goal,) = until(lambda: robot.heard("/goal_pose"), "the goal has arrived")
        check_pose(goal["header"], goal["pose"])
        until(lambda: sent("here"), "the position is known")
        (here,) = until(lambda: robot.heard("/initialpose"), "the position has arrived")
        check_pose(here["header"], here["pose"]["pose"])
        publish_map(robot, wall=True)
        until(lambda: kiosk.widget("hall")["grid"]["version"] != version, "the map is another")
        publish_pose(robot)
        status, reason = press(kiosk, "drive", value)
        assert (status, "map has changed" in reason) == (409, True)
        assert len(robot.heard("/goal_pose")) == 1


def check_pose(header: Any, pose: Any) -> None:
    assert header["frame_id"] == "map"
    assert (pose["position"]["x"], pose["position"]["y"]) == (1.25, 0.75)
    assert pose["orientation"]["z"] == pytest.approx(0.7068, abs=1e-3)
