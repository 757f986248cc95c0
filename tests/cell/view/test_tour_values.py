"""A tour: when it is sent, and what its list shows of the panel's goals and of another program's."""

import math
from typing import Any, Final

import pytest

from app.cell.permission.goal_places import TourGoal, places_verdict, tour_of
from app.cell.permission.press_permission import judged
from app.cell.robot.map_layers import read_shape
from app.cell.robot.state import RobotState
from app.cell.robot.waypoints import MAX_WAYPOINTS, WaypointGoal, poses_of
from app.cell.view.times import BAD_S, GOOD_S
from app.cell.view.tour_values import tour
from app.panel.model import Panel
from app.panel.widgets.tour import PATH_TYPE, Tour
from app.system.errors import InputError
from app.tools.simulator.mobile_robot import FOLLOW_NO_PROGRESS
from tests.cell.permission.test_goal_places import HALL, PLACES, ZONES, code, put_map
from tests.cell.view.test_map_values import moved
from tests.support.builders import INTERFACES, NOW, panel_of, robot_there
from tests.support.words import english

pytestmark = pytest.mark.promise("places")

ACTION: Final = "/follow"
FIBONACCI: Final = "example_interfaces/action/Fibonacci"
ROUND: Final = {"id": "round", "kind": "tour", "label": "Round", "map": "hall"}
SEND: Final = {
    "id": "send",
    "kind": "publish",
    "label": "Send",
    "topic": "/poses",
    "type": "nav_msgs/msg/Path",
    "message": {"header": {"frame_id": "{round.frame}"}, "poses": "{round.poses}"},
}
FOLLOW: Final = {
    "id": "follow",
    "kind": "action",
    "label": "Follow",
    "action": ACTION,
    "type": FIBONACCI,
    "goal": {"order": 3},
}
GOOD: Final = ["dock", "named", "dock"]


def cell_with(places: Any = GOOD, **keys: Any) -> tuple[Panel, RobotState, Tour]:
    """A robot on its map, with a tour that a topic sends, and that shows the goals of an action."""
    of_tour = ROUND | {"action": "follow"} | ({"places": places} if places else {}) | keys
    commands = [SEND, FOLLOW] if places else [FOLLOW]
    panel = panel_of(HALL, of_tour, *commands, place=PLACES, zone=ZONES)
    robot = robot_there(panel)
    put_map(robot)
    moved(robot, 1.0)
    return panel, robot, panel.tours[0]


def shown(robot: RobotState, widget: Tour, now: float = NOW) -> Any:
    return english(tour(widget, robot, now)[0])


def stamped(x: float, y: float = 3.0, yaw: float = 0.0, frame: str = "map") -> dict[str, Any]:
    turn = {"z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    pose = {"position": {"x": x, "y": y}, "orientation": turn}
    return {"header": {"frame_id": frame}, "pose": pose}


def runs(
    robot: RobotState, *poses: Any, command: str = "send", current: int | None = 0, at: float = NOW
) -> WaypointGoal:
    """A goal of the action runs; one without poses is another program's."""
    listed, total = poses_of({"poses": list(poses)}) or ((), 0)
    goal = WaypointGoal(b"1", command, listed if poses else None, total, at, current)
    robot.waypoint_goals[ACTION] = goal
    return goal


def test_a_tour_is_sent_with_each_pose_in_the_frame_of_the_map() -> None:
    _, robot, widget = cell_with()
    sent = tour_of(widget, "dock named dock", robot, NOW)
    assert isinstance(sent, TourGoal)
    assert (sent.frame, sent.name) == ("map", "Round")
    poses = sent.parts["poses"]
    assert [pose["header"]["frame_id"] for pose in poses] == ["map"] * 3
    assert [pose["pose"]["position"]["x"] for pose in poses] == [2.0, 2.0, 2.0]
    assert poses[1]["pose"]["orientation"]["w"] == 1.0
    path = {"header": {"frame_id": "map"}, "poses": poses}
    assert INTERFACES.encode(PATH_TYPE, path)


@pytest.mark.parametrize(
    ("name", "why"),
    [
        ("wall", "place_occupied"),
        ("away", "place_outside"),
        ("stairs", "place_in_zone"),
        ("old", "place_other_map"),
        ("odom", "place_other_frame"),
    ],
)
def test_one_place_that_may_not_be_sent_locks_the_button_and_is_named(name: str, why: str) -> None:
    panel, robot, widget = cell_with(["dock", name])
    refused = tour_of(widget, f"dock {name}", robot, NOW)
    assert code(refused) == "tour_stop_refused"
    assert f"2. {name.capitalize()}: " in english({"why": refused})["why"]
    verdict = places_verdict("send", robot, NOW)
    assert verdict is not None
    assert (verdict.permitted, verdict.code) == (False, "tour_stop_refused")
    button = panel.widget("send", type(panel.commands[0]))
    assert judged(button, (), robot, NOW).code == "tour_stop_refused"
    rows = shown(robot, widget)["rows"]
    assert (rows[0]["note"], rows[1]["note"] != "") == ("", True)
    assert why  # the reasons themselves: tests/cell/permission/test_goal_places.py


def test_what_is_not_known_now_locks_it_as_one_place() -> None:
    _, robot, widget = cell_with()
    for now, why in ((NOW, ""), (NOW + 6.0, "place_pose_old")):
        verdict = places_verdict("send", robot, now)
        assert verdict is not None
        assert verdict.permitted == (not why)
        assert isinstance(tour_of(widget, "dock named dock", robot, now), TourGoal) == (not why)
    assert shown(robot, widget, NOW + 6.0)["state"] == "missing"
    robot.maps["map"].is_behind = True
    assert code(tour_of(widget, "dock named dock", robot, NOW)) == "place_map_behind"


@pytest.mark.parametrize("value", ["", "dock", "dock dock named", None, 3, ["dock"]])
def test_another_list_than_that_of_the_panel_is_bad_input(value: Any) -> None:
    _, robot, widget = cell_with()
    with pytest.raises(InputError):
        tour_of(widget, value, robot, NOW)


def test_without_a_goal_its_places_are_listed_with_the_way_between_them() -> None:
    _, robot, widget = cell_with()
    view = shown(robot, widget)
    assert (view["state"], view["note"], view["title"], view["level"]) == ("live", "", "", "")
    assert [(row["number"], row["label"], row["word"]) for row in view["rows"]] == [
        (1, "Dock", "1.4 m"),
        (2, "Named", "0.0 m"),
        (3, "Dock", "0.0 m"),
    ]
    assert {row["state"] for row in view["rows"]} == {"planned"}
    assert view["rows"][0]["pose"] == [2.0, 3.0, 1.5]


def test_a_goal_that_runs_shows_each_pose_by_the_place_that_it_is() -> None:
    _, robot, widget = cell_with()
    goal = runs(robot, stamped(2.0, yaw=1.5), stamped(2.0), stamped(7.5, 1.0, 3.14))
    goal.current, goal.way_m = 1, 3.46
    view = shown(robot, widget)
    assert view["title"] == "Waypoint 2 of 3. 3.5 m left."
    assert [(row["label"], row["state"], row["word"]) for row in view["rows"]] == [
        ("Dock", "passed", "Passed"),
        ("Named", "current", "Driving there"),
        ("x 7.50 m, y 1.00 m, 180°, to the west", "to_come", "To come"),
    ]


def test_feedback_that_stops_is_old() -> None:
    _, robot, widget = cell_with(max_age_s=2.0)
    goal = runs(robot, stamped(2.0))
    goal.at = NOW
    assert tour(widget, robot, NOW)[1] == NOW + 2.0
    view = shown(robot, widget, NOW + 2.0)
    assert (view["state"], view["title"]) == ("old", "Waypoint 1 of 1. No news from the robot for 2 s.")


@pytest.mark.parametrize(
    ("end", "missed", "title", "shown_s"),
    [
        (4, {}, "All waypoints reached.", GOOD_S),
        (4, {0: FOLLOW_NO_PROGRESS}, "1 of 2 missed.", BAD_S),
        (5, {}, "Canceled.", BAD_S),
        (6, {1: 208}, "Aborted by the robot. 1 of 2 missed.", BAD_S),
        (7, {}, "The result is unknown.", BAD_S),
    ],
)
def test_the_end_of_a_goal_is_shown_as_long_as_a_result(
    end: int, missed: dict[int, int], title: str, shown_s: float
) -> None:
    _, robot, widget = cell_with()
    goal = runs(robot, stamped(2.0), stamped(7.5))
    goal.finish(end, missed, NOW)
    assert shown(robot, widget)["title"] == title
    assert tour(widget, robot, NOW)[1] == NOW + shown_s
    for index in missed:
        row = shown(robot, widget)["rows"][index]
        assert (row["state"], row["word"], row["note"] != "") == ("missed", "Missed", True)
    assert {row["state"] for row in shown(robot, widget, NOW + shown_s)["rows"]} == {"planned"}


def test_of_another_program_s_goal_only_the_number_is_known() -> None:
    _, robot, widget = cell_with()
    runs(robot, command="", current=2)
    view = shown(robot, widget)
    assert (view["title"], view["rows"]) == ("Sent by another program. Waypoint 3.", [])
    runs(robot, command="", current=None)
    assert shown(robot, widget)["title"] == "Sent by another program. Under way."


def test_another_program_s_list_is_shown_by_the_topic_that_has_it() -> None:
    _, robot, widget = cell_with(topic="/waypoints")
    poses = [stamped(2.0), stamped(7.5, 1.0), stamped(3.0, 1.0)]
    message = {"header": {"frame_id": "map"}, "poses": poses}
    state = robot.map_layers["waypoints"]
    state.shape = read_shape(INTERFACES, PATH_TYPE, INTERFACES.encode(PATH_TYPE, message))
    state.at = NOW
    runs(robot, command="", current=1)
    view = shown(robot, widget)
    assert view["title"] == "Sent by another program. Waypoint 2 of 3."
    assert [(row["label"], row["state"]) for row in view["rows"]] == [
        ("Dock", "passed"),
        ("x 7.50 m, y 1.00 m", "current"),
        ("x 3.00 m, y 1.00 m", "to_come"),
    ]
    runs(robot, command="", current=3)  # the list is of another goal
    assert shown(robot, widget)["rows"] == []
    runs(robot, command="", current=1)
    state.shape = None
    assert shown(robot, widget)["rows"] == []


def test_a_pose_in_another_frame_is_listed_and_not_on_the_map() -> None:
    _, robot, widget = cell_with()
    runs(robot, stamped(2.0, frame="/map"), stamped(2.0, frame="odom"))
    assert [row["pose"] is None for row in shown(robot, widget)["rows"]] == [False, True]


def test_a_long_list_is_cut_and_says_so() -> None:
    _, robot, widget = cell_with()
    runs(robot, *[stamped(2.0)] * 300)
    view = shown(robot, widget)
    assert len(view["rows"]) == MAX_WAYPOINTS
    assert view["title"] == "Waypoint 1 of 300. The first 200 of 300 are shown."


def test_a_tour_does_not_show_the_goal_of_another_button() -> None:
    _, robot, widget = cell_with()
    runs(robot, stamped(7.5), command="another")
    assert [row["state"] for row in shown(robot, widget)["rows"]] == ["planned"] * 3
    _, robot, widget = cell_with(places=None)
    runs(robot, stamped(7.5), command="another")
    assert [row["state"] for row in shown(robot, widget)["rows"]] == ["current"]


def test_a_tour_without_places_only_shows_goals() -> None:
    _, robot, widget = cell_with(places=None)
    view = shown(robot, widget)
    assert (view["title"], view["rows"], view["note"]) == ("No goal is running.", [], "")
