"""The mobile robot of the shipped example as the robot of a panel: its topics, commands and actions."""

import math
from collections.abc import Mapping
from types import SimpleNamespace
from typing import Any, Final

import pytest

from app.cell.robot.maps import read_grid
from app.cell.robot.transforms import LocatedFrame, TransformTree
from app.panel import load_panel
from app.panel.demo import DRIVING
from app.panel.widgets.map_layers import UPDATE_TYPE
from app.system.settings import panel_path
from app.tools.simulator.hall import COLUMNS, ROWS
from app.tools.simulator.mobile_robot import (
    FOLLOW_NO_PROGRESS,
    GOAL_OCCUPIED,
    PLACES,
    START,
    MobileRobot,
    Pose,
)
from app.tools.simulator.robot import CANCEL_OK, CANCEL_TOO_LATE, CANCEL_UNKNOWN, CANCELED, SUCCEEDED
from tests.support.stepped import Stepped

pytestmark = pytest.mark.promise("demo")

ABORTED: Final = 6
EXAMPLE: Final = panel_path("mobile-robot")
NAVIGATE: Final = "/navigate_to_pose"
GOAL_ID: Final = bytes([7] * 16)


@pytest.fixture
def robot() -> Stepped:
    return Stepped(load_panel(EXAMPLE)).run(1)


def goal(pose: Pose, frame: str = "map") -> Any:
    turn = SimpleNamespace(x=0.0, y=0.0, z=math.sin(pose.yaw / 2), w=math.cos(pose.yaw / 2))
    place = SimpleNamespace(position=SimpleNamespace(x=pose.x, y=pose.y), orientation=turn)
    header = SimpleNamespace(frame_id=frame)
    return SimpleNamespace(pose=SimpleNamespace(header=header, pose=place))


def end(robot: Stepped, action: str = NAVIGATE) -> tuple[int, Mapping[str, Any]]:
    """(status, result) of the goal; the result is encoded as the action's definition has it."""
    server = robot.robot.actions[action]
    for _ in range(1200):
        if (ended := server.result(GOAL_ID)) is not None:
            types = robot.interfaces.action_types(server.type)
            robot.interfaces.encode(types.result, ended[1])
            return ended
        robot.run(0.1)
    raise AssertionError("the goal does not end")


def newest(robot: Stepped, topic: str) -> Any:
    return robot.interfaces.decode(robot.robot.publishes[topic].type, robot.said[topic][-1][1])


def test_panel_plays_all_that_it_uses_of_the_story(robot: Stepped) -> None:
    used = {**robot.panel.listened(), **robot.panel.publications(), **robot.panel.actions()}
    played = {name for _, name, _ in DRIVING.types}
    updates = {topic for topic, kind in used.items() if kind == UPDATE_TYPE}
    assert used.keys() - played - updates == {"/front_camera/image_raw/compressed"}
    assert used.keys() & DRIVING.publishes.keys() <= {*robot.said, "/rosout"}


def test_map_and_fixed_transforms_are_published_once_for_late_subscribers(robot: Stepped) -> None:
    robot.run(30)
    for topic in ("/map", "/tf_static"):
        assert robot.robot.publishes[topic].qos.transient_local
        assert len(robot.said[topic]) == 1
    assert not robot.robot.publishes["/tf"].qos.transient_local
    grid = read_grid(robot.interfaces, robot.said["/map"][0][1])
    assert (grid.geometry.width, grid.geometry.height, grid.geometry.frame) == (COLUMNS, ROWS, "map")


def test_transforms_lead_from_the_map_to_the_robot(robot: Stepped) -> None:
    tree = TransformTree()
    for topic in ("/tf", "/tf_static"):
        for at, payload in robot.said[topic]:
            message = robot.interfaces.decode("tf2_msgs/msg/TFMessage", payload)
            tree.record(message, at, is_static=topic == "/tf_static")
    located, lidar = tree.locate("base_link", "map"), tree.locate("lidar", "map")
    assert isinstance(located, LocatedFrame)
    assert isinstance(lidar, LocatedFrame)
    assert located.pose == pytest.approx(START, abs=0.01)
    assert lidar.pose.y == pytest.approx(START.y + 0.3, abs=0.01)


def test_robot_that_stands_repeats_its_transforms_and_one_that_drives_sends_ten_a_second(
    robot: Stepped,
) -> None:
    before = len(robot.said["/tf"])
    robot.run(10)
    still = len(robot.said["/tf"]) - before
    robot.robot.actions[NAVIGATE].begin(GOAL_ID, goal(PLACES["WRAPPER"]))
    robot.run(5)
    assert still == pytest.approx(20, abs=2)
    assert len(robot.said["/tf"]) - before - still == pytest.approx(50, abs=3)


def test_goal_is_reached_with_feedback(robot: Stepped) -> None:
    server = robot.robot.actions[NAVIGATE]
    assert server.begin(GOAL_ID, goal(PLACES["PALLETIZER_1"]))
    assert not server.begin(GOAL_ID, goal(PLACES["WRAPPER"]))
    robot.run(3)
    ((goal_id, feedback),) = server.feedback()
    robot.interfaces.encode(robot.interfaces.action_types(server.type).feedback, feedback)
    assert goal_id == GOAL_ID
    assert 5 < feedback["distance_remaining"] < 15
    assert end(robot) == (SUCCEEDED, {"error_code": 0})
    robot.run(1.5)
    assert newest(robot, "/robot_place").data == "PALLETIZER_1"


FOLLOW: Final = "/follow_waypoints"


def tour(*names: str, frame: str = "map") -> Any:
    poses = [goal(PLACES[name] if name in PLACES else Pose(-3.4, 9.0, 0.0), frame) for name in names]
    return SimpleNamespace(poses=[each.pose for each in poses])


def seen(robot: Stepped, action: str, field: str, seconds: int) -> list[int]:
    """The values of a field of the feedback, each once, in their order."""
    server, values = robot.robot.actions[action], []
    types = robot.interfaces.action_types(server.type)
    for _ in range(seconds):
        robot.run(1)
        for _, feedback in server.feedback():
            robot.interfaces.encode(types.feedback, feedback)
            values.append(feedback[field])
    return list(dict.fromkeys(values))


def test_tour_goes_from_pose_to_pose_with_feedback(robot: Stepped) -> None:
    assert robot.robot.actions[FOLLOW].begin(GOAL_ID, tour("PALLETIZER_2", "PALLETIZER_1", "WRAPPER"))
    assert seen(robot, FOLLOW, "current_waypoint", 80) == [0, 1, 2]
    assert end(robot, FOLLOW) == (SUCCEEDED, {"error_code": 0, "missed_waypoints": []})


def test_tour_misses_what_it_can_not_reach_and_goes_on(robot: Stepped) -> None:
    server = robot.robot.actions[FOLLOW]
    assert server.begin(GOAL_ID, tour("PALLETIZER_2", "in a wall", "PALLETIZER_1"))
    assert seen(robot, FOLLOW, "current_waypoint", 60) == [0, 2]
    missed = [{"index": 1, "error_code": GOAL_OCCUPIED}]
    assert end(robot, FOLLOW) == (SUCCEEDED, {"error_code": 0, "missed_waypoints": missed})


def put_box(robot: Stepped, *, there: bool) -> None:
    """Something in the robot's way, or nothing."""
    request = robot.interfaces.encode("std_srvs/srv/SetBool_Request", {"data": there})
    robot.robot.serve("/obstacle", request)


def test_tour_gives_up_a_pose_whose_way_is_blocked(robot: Stepped) -> None:
    server = robot.robot.actions[FOLLOW]
    put_box(robot, there=True)
    assert server.begin(GOAL_ID, tour("PALLETIZER_2", "CHARGER"))
    assert seen(robot, FOLLOW, "current_waypoint", 22) == [0, 1]
    put_box(robot, there=False)
    missed = [{"index": 0, "error_code": FOLLOW_NO_PROGRESS}]
    assert end(robot, FOLLOW) == (SUCCEEDED, {"error_code": 0, "missed_waypoints": missed})


@pytest.mark.parametrize("bad", [tour(), tour("WRAPPER", frame="odom")])
def test_tour_without_poses_or_in_another_frame_is_rejected(robot: Stepped, bad: Any) -> None:
    assert not robot.robot.actions[FOLLOW].begin(GOAL_ID, bad)


def test_poses_that_remain_fall_and_a_pose_in_a_wall_aborts() -> None:
    robot = MobileRobot()
    task = robot.tour([PLACES["PALLETIZER_2"], PLACES["PALLETIZER_1"]], goes_on=False)
    assert task is not None
    left = []
    for second in range(1, 60):
        robot.step(float(second))
        left.append(task.stops - task.stop)
    assert list(dict.fromkeys(left)) == [2, 1, 0]
    failed = robot.tour([PLACES["PALLETIZER_2"], Pose(-3.4, 9.0, 0.0)], goes_on=False)
    assert failed is not None
    assert (failed.code, failed.missed) == (GOAL_OCCUPIED, {1: GOAL_OCCUPIED})
    robot.set_manual(on=True)
    assert robot.tour([PLACES["WRAPPER"]], goes_on=True) is None


def test_goal_in_another_frame_is_rejected(robot: Stepped) -> None:
    server = robot.robot.actions[NAVIGATE]
    assert not server.begin(GOAL_ID, goal(PLACES["WRAPPER"], "odom"))
    assert server.result(GOAL_ID) == (0, {})


def test_goal_in_a_wall_is_aborted_with_the_code_of_the_planner(robot: Stepped) -> None:
    assert robot.robot.actions[NAVIGATE].begin(GOAL_ID, goal(Pose(-3.4, 9.0, 0.0)))
    assert end(robot) == (ABORTED, {"error_code": GOAL_OCCUPIED})


def test_goal_is_canceled_and_the_robot_stands(robot: Stepped) -> None:
    server = robot.robot.actions[NAVIGATE]
    assert server.cancel(GOAL_ID) == (CANCEL_UNKNOWN, [])
    server.begin(GOAL_ID, goal(PLACES["WRAPPER"]))
    robot.run(5)
    assert server.cancel(GOAL_ID) == (CANCEL_OK, [GOAL_ID])
    assert end(robot)[0] == CANCELED
    assert server.cancel(GOAL_ID) == (CANCEL_TOO_LATE, [])
    robot.run(1.5)
    assert not newest(robot, "/moving").data


def test_box_in_the_way_is_reported_and_ends_the_goal(robot: Stepped) -> None:
    assert robot.call("/obstacle", data=True).success
    robot.robot.actions[NAVIGATE].begin(GOAL_ID, goal(PLACES["WRAPPER"]))
    robot.run(8)
    assert newest(robot, "/way_blocked").data
    assert newest(robot, "/robot_state").data == "BLOCKED"
    assert end(robot) == (ABORTED, {"error_code": FOLLOW_NO_PROGRESS})


def test_collision_monitor_slows_the_robot_before_a_box_and_stops_it(robot: Stepped) -> None:
    assert newest(robot, "/collision_monitor_state").action_type == 0
    assert robot.call("/obstacle", data=True).success
    robot.robot.actions[NAVIGATE].begin(GOAL_ID, goal(PLACES["WRAPPER"]))
    robot.run(12)
    reported = dict.fromkeys(robot.values("/collision_monitor_state", "action_type"))
    assert [*reported] == [0, 2, 1]
    assert newest(robot, "/collision_monitor_state").polygon_name == "PolygonStop"
    near = max(robot.values("/odom", "twist.twist.linear.x")[-60:])
    assert near <= 0.5 + 1e-6


@pytest.mark.parametrize(
    ("percentage", "limit", "percent", "most"),
    [(True, 40.0, 40.0, 0.4), (False, 0.6, 60.0, 0.6), (True, 0.0, 100.0, 1.0)],
)
def test_speed_limit_is_obeyed_and_reported(
    robot: Stepped, percentage: bool, limit: float, percent: float, most: float
) -> None:
    robot.hear("/speed_limit", percentage=percentage, speed_limit=limit)
    robot.robot.actions[NAVIGATE].begin(GOAL_ID, goal(PLACES["WRAPPER"]))
    robot.run(6)
    assert newest(robot, "/speed_limit").speed_limit == pytest.approx(percent)
    assert max(robot.values("/odom", "twist.twist.linear.x")) == pytest.approx(most, abs=0.01)


def test_stop_of_the_panel_ends_the_goal(robot: Stepped) -> None:
    robot.robot.actions[NAVIGATE].begin(GOAL_ID, goal(PLACES["WRAPPER"]))
    robot.run(3)
    robot.hear("/stop")
    assert end(robot)[0] == ABORTED


def test_robot_docks_and_undocks_by_actions(robot: Stepped) -> None:
    docking = robot.robot.actions["/dock_robot"]
    wanted = SimpleNamespace(dock_id="charger", navigate_to_staging_pose=True)
    docking.begin(GOAL_ID, wanted)
    robot.run(1)
    ((_, feedback),) = docking.feedback()
    robot.interfaces.encode(robot.interfaces.action_types(docking.type).feedback, feedback)
    assert end(robot, "/dock_robot") == (SUCCEEDED, {"success": True, "error_code": 0})
    robot.run(2)
    assert newest(robot, "/docked").data
    assert newest(robot, "/battery_state").power_supply_status == 1
    robot.robot.actions["/undock_robot"].begin(GOAL_ID, SimpleNamespace())
    assert end(robot, "/undock_robot")[0] == SUCCEEDED


def test_robot_is_driven_by_hand_only_in_that_mode(robot: Stepped) -> None:
    twist = {"twist": {"linear": {"x": 0.4}, "angular": {"z": 0.2}}}
    robot.hear("/cmd_vel_teleop", **twist)
    robot.run(0.3)
    assert not newest(robot, "/moving").data
    assert robot.call("/manual_mode", data=True).success
    robot.hear("/cmd_vel_teleop", **twist)
    robot.run(0.3)
    assert newest(robot, "/moving").data
    assert newest(robot, "/robot_mode").data == "MANUAL"


def test_robots_of_several_panels_do_not_share_a_pose() -> None:
    first, second = MobileRobot(), MobileRobot()
    first.navigate(PLACES["WRAPPER"])
    first.step(3.0)
    assert second.pose == START
    assert first.pose != START


def test_layers_of_the_map_are_in_frames_that_lead_to_it(robot: Stepped) -> None:
    robot.robot.actions[NAVIGATE].begin(GOAL_ID, goal(PLACES["WRAPPER"]))
    robot.run(3)
    scan, plan = newest(robot, "/scan"), newest(robot, "/plan")
    assert (scan.header.frame_id, plan.header.frame_id) == ("lidar", "map")
    assert len(scan.ranges) == round(2 * math.pi / scan.angle_increment)
    assert min(scan.ranges) > 0.2
    end_pose = plan.poses[-1].pose.position
    assert (end_pose.x, end_pose.y) == pytest.approx(PLACES["WRAPPER"][:2], abs=0.01)
    costmap = read_grid(robot.interfaces, robot.said["/local_costmap/costmap"][-1][1])
    assert costmap.geometry.frame == "odom"
    assert max(costmap.cells) <= 100
    corners = newest(robot, "/local_costmap/published_footprint").polygon.points
    assert len(corners) == 4
