"""Clocks of real ROS 2 nodes over the real bridge: a node whose stamps are 41 s behind, and a node that
publishes `/clock`."""

import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("locks")

PANEL: Final = """
title = "Shuttle"
[[interlock]]
id = "localized"
topic = "/test_pose"
type = "geometry_msgs/msg/PoseStamped"
field = "age(header.stamp)"
max = 1.0
max_age_s = 5.0
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "goal"
kind = "publish"
label = "Goal"
topic = "/test_goal"
type = "geometry_msgs/msg/PoseStamped"
message = { header = { frame_id = "map", stamp = "{now}" } }
interlock = "localized"
"""
POSE: Final = "geometry_msgs/msg/PoseStamped"
CLOCK: Final = "rosgraph_msgs/msg/Clock"


@pytest.fixture
def robot(own_bridge: Bridge) -> Iterator[RosNode]:
    node = RosNode(own_bridge.domain, "localization")
    yield node
    node.end()


def stamp_of(seconds: float) -> dict[str, int]:
    return {"sec": int(seconds), "nanosec": int(seconds % 1 * 1e9)}


def publish_pose(node: RosNode, seconds: float) -> None:
    node.publish("/test_pose", {"header": {"frame_id": "map", "stamp": stamp_of(seconds)}})


def clock(kiosk: Server) -> dict[str, Any]:
    answer: dict[str, Any] = kiosk.http.get("/diagnostics").json()["clock"]
    return answer


def banner(kiosk: Server) -> str:
    return str(kiosk.snapshot()["notice"]["banner"])


def test_stamps_that_are_41_s_behind_are_named_and_lock(
    own_bridge: Bridge, robot: RosNode, tmp_path: Path
) -> None:
    robot.advertise("/test_pose", POSE)
    with live_server(own_bridge, tmp_path, PANEL) as kiosk:

        def is_apart() -> bool:
            publish_pose(robot, time.time() - 41.0)
            return bool(clock(kiosk)["state"] == "apart")

        until(is_apart, "the stamps are compared with the clock of the bridge")
        assert "41 s" in clock(kiosk)["reason"]
        assert abs(clock(kiosk)["skew_s"]) < 1.0

        def is_refused() -> bool:
            publish_pose(robot, time.time() - 41.0)
            return bool(kiosk.press("goal", inputs={}).json()["code"] == "interlock_condition_unmet")

        until(is_refused, "its node is known, and the age of the pose refuses")

        def is_permitted() -> bool:
            publish_pose(robot, time.time())
            return bool(kiosk.widget("goal")["enabled"])

        until(is_permitted, "a node whose clock is right permits")


def test_a_robot_on_simulated_time(own_bridge: Bridge, robot: RosNode, tmp_path: Path) -> None:
    robot.advertise("/test_pose", POSE)
    robot.subscribe("/test_goal", POSE)
    with live_server(own_bridge, tmp_path, PANEL) as kiosk:
        robot.advertise("/clock", CLOCK, reliability="best_effort", depth=1)
        until(lambda: clock(kiosk)["state"] == "simulated_awaited", "the panel sees /clock")
        until(lambda: banner(kiosk) == "SIMULATED TIME", "the header says so")

        def goes_on(seconds: float) -> bool:
            robot.publish("/clock", {"clock": stamp_of(seconds)})
            publish_pose(robot, seconds - 0.25)
            return bool(clock(kiosk)["state"] == "simulated" and kiosk.widget("goal")["enabled"])

        until(lambda: goes_on(100.0 + time.monotonic() % 60), "ages are by the simulated time")

        def has_arrived() -> bool:
            goes_on(300.5)
            kiosk.press("goal", inputs={})
            return bool(robot.heard("/test_goal"))

        until(has_arrived, "the goal arrives")
        assert robot.heard("/test_goal")[-1]["header"]["stamp"] == stamp_of(300.5)
        until(lambda: clock(kiosk)["state"] == "simulated_paused", "its time stands still")
        until(lambda: banner(kiosk) == "SIMULATED TIME\u00a0PAUSED", "the header says so")
        until(lambda: goes_on(7.0 + time.monotonic() % 60), "it begins again, and permits")
        robot.withdraw("/clock")
        until(lambda: banner(kiosk) == "", "no simulated time any more")
