"""A goal on a map to the action server of a robot with Nav2's own types, over the real bridge: the pose
of a place, feedback, cancel, an abort with Nav2's code, and docking. The server is a DDS peer on
Cyclone DDS: the nodes of the wheels are on Fast DDS, whose services the bridge can't call."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, Final

import pytest

from app.ros.messages import load_interfaces
from tests.bridge.test_goals_on_bridge import publish_map, publish_pose
from tests.bridge.test_map_on_bridge import GRID, POSE, WITH_TOPIC
from tests.support.cyclone import NAV2, Client, CycloneRobot, served
from tests.support.parts import Bridge, RosNode, Server, until
from tests.support.servers import live_server

pytestmark = pytest.mark.promise("places")

DRIVE: Final = "/navigate_to_pose"
DOCK: Final = "/dock_robot"
FOLLOW: Final = "/follow_waypoints"
STAMPED: Final = 'header = { frame_id = "{goal.frame}", stamp = "{now}" }, pose = "{goal.pose}"'
PANEL: Final = f"""
title = "Shuttle"
interfaces = ["{NAV2}"]
[[place]]
id = "bay"
label = "Bay"
x = 1.25
y = 0.75
yaw = 1.5708
[[place]]
id = "gap"
label = "Gap"
x = 0.5
y = -0.5
[[page]]
id = "main"
title = "Main"
[[page.widget]]
id = "hall"
kind = "map"
label = "Hall"
max_age_s = 60.0
{WITH_TOPIC}
[[page.widget]]
id = "goal"
kind = "place"
label = "Places"
map = "hall"
[[page.widget]]
id = "send"
kind = "action"
label = "Send"
action = "{DRIVE}"
type = "nav2_msgs/action/NavigateToPose"
goal = {{ pose = {{ {STAMPED} }} }}
progress = "distance_remaining"
progress_falls = true
feedback = "{{distance_remaining:.1f}} m left"
[[page.widget]]
id = "round"
kind = "tour"
label = "Round"
map = "hall"
places = ["bay", "gap", "bay"]
topic = "/waypoints"
[[page.widget]]
id = "follow"
kind = "action"
label = "Follow"
action = "{FOLLOW}"
type = "nav2_msgs/action/FollowWaypoints"
goal = {{ poses = "{{round.poses}}" }}
[[page.widget]]
id = "dock"
kind = "action"
label = "Dock"
action = "{DOCK}"
type = "nav2_msgs/action/DockRobot"
goal = {{ dock_id = "charger" }}
feedback = "state {{state}}"
"""
NEVER_S: Final = 600.0  # a step that does not come within a test
ABORTED: Final = 6


@pytest.fixture
def nav2(
    own_cyclone_bridge: Bridge, own_client: Client, cyclone_robots: Callable[..., CycloneRobot]
) -> CycloneRobot:
    robot = cyclone_robots(own_cyclone_bridge.domain)
    robot.serve_nav2(step_s=0.02)
    served(robot, own_client)
    return robot


@pytest.fixture
def localization(own_cyclone_bridge: Bridge) -> Iterator[RosNode]:
    node = RosNode(own_cyclone_bridge.domain, "localization")
    node.advertise("/map", GRID, durability="transient_local", depth=1)
    node.advertise("/pose", POSE)
    node.advertise("/waypoints", "nav_msgs/msg/Path")
    publish_map(node)
    yield node
    node.end()


@pytest.fixture
def kiosk(
    own_cyclone_bridge: Bridge, nav2: CycloneRobot, localization: RosNode, tmp_path: Path
) -> Iterator[Server]:
    """The panel, with a robot that is on the map and offers its actions."""
    with live_server(own_cyclone_bridge, tmp_path, PANEL) as server:

        def is_permitted() -> bool:
            publish_pose(localization)
            return all(server.widget(name)["enabled"] for name in ("send", "dock", "follow"))

        until(is_permitted, "the robot is on the map and offers its actions")
        yield server


def press(kiosk: Server, widget: str, **inputs: str) -> Any:
    receipt = kiosk.http.post(f"/widgets/{widget}", json={"inputs": inputs})
    assert (receipt.status_code, receipt.json()["outcome"]) == (200, "accepted"), receipt.text
    return receipt.json()


def ended(kiosk: Server, widget: str, outcome: str) -> str:
    until(lambda: kiosk.widget(widget)["outcome"] == outcome, f"it is {outcome}")
    return str(kiosk.widget(widget)["result"])


def test_a_place_is_driven_to_with_feedback_and_arrives_once(kiosk: Server, nav2: CycloneRobot) -> None:
    receipt = press(kiosk, "send", goal="bay")
    assert receipt["reason"].startswith("Bay: ")
    assert "Succeeded at" in ended(kiosk, "send", "succeeded")
    (goal,) = nav2.goals_of_nav2(name=DRIVE)
    pose = goal["pose"]
    assert (pose["header"]["frame_id"], goal["left"]) == ("map", 0)
    assert pose["header"]["stamp"]["sec"] > 0
    assert (pose["pose"]["position"]["x"], pose["pose"]["position"]["y"]) == (1.25, 0.75)
    assert pose["pose"]["orientation"]["z"] == pytest.approx(0.7071, abs=1e-3)
    nav2.step_nav2(name=DRIVE, step_s=0.5)
    press(kiosk, "send", goal="bay")
    until(lambda: "m left" in kiosk.widget("send")["result"], "its feedback is shown")
    nav2.step_nav2(name=DRIVE, step_s=0.01)
    ended(kiosk, "send", "succeeded")
    assert len(nav2.goals_of_nav2(name=DRIVE)) == 2


def test_a_goal_is_canceled_at_the_robot(kiosk: Server, nav2: CycloneRobot) -> None:
    nav2.step_nav2(name=DRIVE, step_s=NEVER_S)
    press(kiosk, "send", goal="bay")
    until(lambda: kiosk.widget("send")["stoppable"], "it can be canceled")
    assert not kiosk.widget("send")["enabled"]
    canceled = kiosk.http.post("/widgets/send/cancel", json={}).json()
    assert canceled["outcome"] == "accepted", canceled
    assert "Canceled at" in ended(kiosk, "send", "canceled")
    assert len(nav2.requests(f"{DRIVE}/_action/cancel_goal")) == 1


@pytest.mark.parametrize(
    ("widget", "error", "words"),
    [("send", 105, "The way is blocked (105)."), ("send", 206, "(206)"), ("dock", 904, "(904)")],
)
def test_an_abort_says_why_in_words(
    kiosk: Server, nav2: CycloneRobot, widget: str, error: int, words: str
) -> None:
    name = {"send": DRIVE, "dock": DOCK}[widget]
    nav2.step_nav2(name=name, step_s=NEVER_S)
    press(kiosk, widget, goal="bay")
    until(lambda: kiosk.widget(widget)["goal"] == "EXECUTING", "it is under way")
    assert nav2.abort_nav2(name=name, error=error) == 1
    result = ended(kiosk, widget, "aborted")
    assert "Aborted by the robot at" in result
    assert words in result
    assert nav2.goals_of_nav2(name=name)[0]["status"] == ABORTED


def test_the_robot_docks(kiosk: Server, nav2: CycloneRobot) -> None:
    press(kiosk, "dock")
    ended(kiosk, "dock", "succeeded")
    (goal,) = nav2.goals_of_nav2(name=DOCK)
    assert (goal["dock_id"], goal["state"]) == ("charger", 4)
    (sent,) = nav2.requests(f"{DOCK}/_action/send_goal")
    assert (sent["use_dock_id"], sent["navigate_to_staging_pose"]) == (True, True)  # Nav2's defaults
    assert sent["max_staging_time"] == 1000.0


def states(kiosk: Server) -> list[str]:
    return [row["state"] for row in kiosk.widget("round")["rows"]]


def test_a_tour_is_followed_and_a_missed_pose_is_named(kiosk: Server, nav2: CycloneRobot) -> None:
    assert states(kiosk) == ["planned"] * 3
    nav2.step_nav2(name=FOLLOW, step_s=0.5)
    press(kiosk, "follow")
    until(
        lambda: states(kiosk) == ["passed", "current", "to_come"], "the second pose is the current one"
    )
    assert kiosk.widget("round")["title"] == "Waypoint 2 of 3."
    result = ended(kiosk, "follow", "succeeded")
    assert "1 missed: waypoints 2." in result
    until(lambda: states(kiosk) == ["reached", "missed", "reached"], "the list is marked")
    assert "The way is blocked (105)." in kiosk.widget("round")["rows"][1]["note"]
    (goal,) = nav2.goals_of_nav2(name=FOLLOW)
    assert [pose["header"]["frame_id"] for pose in goal["poses"]] == ["map"] * 3
    assert [pose["pose"]["position"]["y"] for pose in goal["poses"]] == [0.75, -0.5, 0.75]


def test_a_canceled_tour_marks_what_was_not_driven_to(kiosk: Server, nav2: CycloneRobot) -> None:
    nav2.step_nav2(name=FOLLOW, step_s=NEVER_S)
    press(kiosk, "follow")
    until(lambda: states(kiosk)[0] == "current", "it is under way")
    assert kiosk.http.post("/widgets/follow/cancel", json={}).json()["outcome"] == "accepted"
    ended(kiosk, "follow", "canceled")
    until(lambda: states(kiosk) == ["left"] * 3, "the list is marked")
    assert kiosk.widget("round")["title"].startswith("Canceled.")


def test_a_goal_of_another_program_is_shown(
    kiosk: Server, nav2: CycloneRobot, own_client: Client, localization: RosNode
) -> None:
    nav2.step_nav2(name=FOLLOW, step_s=0.5)
    types = load_interfaces("jazzy", (NAV2,))
    poses = [
        {"header": {"frame_id": "map"}, "pose": {"position": {"x": x}}} for x in (0.0, 1.0, 2.0, 2.5)
    ]
    goal = {"goal_id": {"uuid": [7] * 16}, "goal": {"poses": poses}}
    send_goal = types.action_types("nav2_msgs/action/FollowWaypoints").send_goal_request
    (reply,) = own_client.get("follow_waypoints/_action/send_goal", types.encode(send_goal, goal))
    assert reply.ok is not None
    title = "Sent by another program. Waypoint 2."
    until(lambda: kiosk.widget("round")["title"] == title, "its feedback is shown")
    assert kiosk.widget("round")["rows"] == []
    localization.publish("/waypoints", {"header": {"frame_id": "map"}, "poses": poses})
    until(lambda: states(kiosk)[:1] == ["passed"], "its list is shown")
    assert len(states(kiosk)) == 4
    until(lambda: states(kiosk) == ["planned"] * 3, "it has ended")
