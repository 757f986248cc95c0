"""What decides about goals on a map beside its floor, of real nodes through the real bridge: the level
that the robot is on, and the mask of a keepout filter."""

from collections.abc import Callable, Iterator
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from tests.bridge.test_goals_on_bridge import press, publish_pose
from tests.bridge.test_map_on_bridge import GRID, PANEL, POSE, UPRIGHT, WITH_TOPIC
from tests.support.cyclone import NAV2, Client, CycloneRobot
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("places")

DRIVE: Final = """
[[page.widget]]
id = "goal"
kind = "place"
label = "Places"
map = "hall"
[[page.widget]]
id = "drive"
kind = "publish"
label = "Drive"
topic = "/goal_pose"
type = "geometry_msgs/msg/PoseStamped"
message = { header = { frame_id = "{goal.frame}", stamp = "{now}" }, pose = "{goal.pose}" }
"""
LEVELS: Final = """robot_level = { topic = "/level", type = "std_msgs/msg/String" }
level = [
  { id = "ground", label = "Ground floor", topic = "/ground/map" },
  { id = "upper", label = "Upper floor", topic = "/upper/map" },
]
"""
ON_LEVELS: Final = """
[[place]]
id = "dock"
label = "Dock"
x = 1.25
y = 0.75
level = "ground"
[[place]]
id = "archive"
label = "Archive"
x = 1.25
y = 0.75
level = "upper"
"""
MASK: Final = """
layer = [
  { shows = "keep_out", topic = "/keepout_mask", info = "/keepout_info" },
  { shows = "speed", topic = "/speed_mask", info = "/speed_info" },
]
"""
AROUND_MASK: Final = """
[[place]]
id = "free"
label = "Free"
x = 0.0
y = 0.0
[[place]]
id = "closed"
label = "Closed"
x = 2.25
y = 2.25
"""
LATCHED: Final[dict[str, Any]] = {"durability": "transient_local", "depth": 1}
TEXT: Final = "std_msgs/msg/String"


@pytest.fixture
def robot(own_cyclone_bridge: Bridge) -> Iterator[RosNode]:
    node = RosNode(own_cyclone_bridge.domain, "navigator")
    node.advertise("/pose", POSE)
    node.subscribe("/goal_pose", POSE)
    yield node
    node.end()


def publish_grid(node: RosNode, topic: str, cells: list[int]) -> None:
    """4 m x 4 m from -1 m on."""
    origin = {"position": {"x": -1.0, "y": -1.0, "z": 0.0}, "orientation": UPRIGHT}
    info = {"resolution": 0.5, "width": 8, "height": 8, "origin": origin}
    node.publish(topic, {"header": {"frame_id": "map"}, "info": info, "data": cells})


def is_sent(kiosk: Server, robot: RosNode, place: str) -> bool:
    publish_pose(robot)  # it is there until the press
    return press(kiosk, "drive", place)[0] == 200


def refusal(kiosk: Server, robot: RosNode, place: str) -> str:
    publish_pose(robot)
    status, reason = press(kiosk, "drive", place)
    assert status == 409, reason
    return reason


def test_the_robot_chooses_the_level_and_a_goal_on_another_one_is_refused(
    own_cyclone_bridge: Bridge, robot: RosNode, tmp_path: Path
) -> None:
    for n, topic in enumerate(("/ground/map", "/upper/map")):
        robot.advertise(topic, GRID, **LATCHED)
        publish_grid(robot, topic, [0] * 63 + [100 * n])
    robot.advertise("/level", TEXT, **LATCHED)
    text = f"{PANEL}{WITH_TOPIC}{LEVELS}{DRIVE}{ON_LEVELS}"
    with live_server(own_cyclone_bridge, tmp_path, text) as kiosk:
        until(lambda: all(row["grid"] for row in kiosk.widget("hall")["levels"]), "both maps are read")
        assert kiosk.widget("hall")["level"] == ""
        refusal(kiosk, robot, "dock")  # it is not known where the robot is

        def is_on(level: str) -> bool:
            return bool(kiosk.widget("hall")["level"] == level)

        for level, here, there in (("ground", "dock", "archive"), ("upper", "archive", "dock")):
            robot.publish("/level", {"data": level})
            until(partial(is_on, level), "the robot is there")
            until(partial(is_sent, kiosk, robot, here), "a goal on its level is sent")
            assert "The robot is on" in refusal(kiosk, robot, there)
        until(lambda: len(robot.heard("/goal_pose")) == 2, "both goals have arrived")
        robot.publish("/level", {"data": "roof"})
        until(partial(is_on, ""), "that is no level")
        refusal(kiosk, robot, "archive")
        assert len(robot.heard("/goal_pose")) == 2


def test_a_goal_on_the_mask_of_a_keepout_filter_is_refused_and_speed_limits_are_named(
    own_cyclone_bridge: Bridge,
    own_client: Client,
    cyclone_robots: Callable[..., CycloneRobot],
    robot: RosNode,
    tmp_path: Path,
) -> None:
    nav2 = cyclone_robots(own_cyclone_bridge.domain)
    robot.advertise("/map", GRID, **LATCHED)
    publish_grid(robot, "/map", [0] * 64)
    robot.advertise("/keepout_mask", GRID, **LATCHED)
    publish_grid(robot, "/keepout_mask", [100 if n == 54 else 0 for n in range(64)])
    robot.advertise("/speed_mask", GRID, **LATCHED)
    publish_grid(robot, "/speed_mask", [40 if n == 18 else 60 if n > 60 else 0 for n in range(64)])
    text = f'interfaces = ["{NAV2}"]\n{PANEL}{WITH_TOPIC}{MASK}{DRIVE}{AROUND_MASK}'
    with live_server(own_cyclone_bridge, tmp_path, text) as kiosk:
        until(lambda: kiosk.widget("hall")["grid"], "the map is read")
        refusal(kiosk, robot, "free")  # what the mask means is not known
        nav2.advertise(topic="/keepout_info", type="nav2_msgs/msg/CostmapFilterInfo", **LATCHED)
        nav2.filter_info(topic="/keepout_info", mask="/keepout_mask")
        until(lambda: kiosk.widget("hall")["layer_0"]["state"] == "live", "the mask is drawn")
        nav2.advertise(topic="/speed_info", type="nav2_msgs/msg/CostmapFilterInfo", **LATCHED)
        nav2.filter_info(topic="/speed_info", mask="/speed_mask", kind=1)
        until(lambda: kiosk.widget("hall")["layer_1"]["note"] == "Limits: 40 %, 60 %", "it names them")
        until(lambda: is_sent(kiosk, robot, "free"), "a goal beside it is sent")
        assert "may not enter Keep-out mask" in refusal(kiosk, robot, "closed")
        until(lambda: len(robot.heard("/goal_pose")) == 1, "the goal has arrived")
        publish_grid(robot, "/keepout_mask", [0] * 64)
        until(lambda: is_sent(kiosk, robot, "closed"), "the zone is free")
