"""The poses of a goal as the definitions of each distribution have them, and what is known of each."""

import math
from types import SimpleNamespace as Message
from typing import Any, Final

import pytest

from app.cell.robot.waypoints import (
    MAX_WAYPOINTS,
    Waypoint,
    WaypointGoal,
    missed_of,
    poses_of,
    waypoints_at,
)
from app.ros.messages import Fields

pytestmark = pytest.mark.promise("places")

TURNED: Final = {"z": math.sin(0.75), "w": math.cos(0.75)}
STAMPED: Final = {
    "header": {"frame_id": "map"},
    "pose": {"position": {"x": 1.0, "y": 2.0}, "orientation": TURNED},
}


def goal_with(total: int = 4, known: bool = True) -> WaypointGoal:
    poses = tuple(Waypoint(float(n), 0.0, 0.0, "map") for n in range(total)) if known else None
    return WaypointGoal(b"1", "send", poses, total if known else 0, 0.0, 0 if known else None)


def said(goal: WaypointGoal, **fields: Any) -> list[str]:
    """The states after a feedback with these fields."""
    message = Fields({f"feedback.{name}": value for name, value in fields.items()})
    goal.apply_feedback(message, "feedback.", 5.0)
    return [goal.state(index) for index in range(goal.total)]


@pytest.mark.parametrize("form", [[STAMPED], {"goals": [STAMPED]}, {"poses": [STAMPED]}])
def test_poses_are_read_in_the_form_of_each_distribution(form: Any) -> None:
    (pose,), total = poses_of({"poses": form}) or ((), 0)
    assert (pose.x, pose.y, pose.frame, total) == (1.0, 2.0, "map", 1)
    assert pose.yaw == pytest.approx(1.5)


def test_what_a_message_leaves_out_is_0_and_another_goal_has_no_poses() -> None:
    assert poses_of({"poses": [{}]}) == ((Waypoint(0.0, 0.0, 0.0, ""),), 1)
    assert poses_of({"pose": STAMPED}) is None
    assert poses_of({"poses": "text"}) is None


def test_no_more_poses_are_kept_than_are_shown() -> None:
    poses, total = poses_of({"poses": [STAMPED] * 1000}) or ((), 0)
    assert (len(poses), total) == (MAX_WAYPOINTS, 1000)
    assert len(waypoints_at([0.0] * 2000, "map")) == MAX_WAYPOINTS


@pytest.mark.parametrize(
    ("fields", "states"),
    [
        ({}, ["current", "to_come", "to_come", "to_come"]),
        ({"current_waypoint": 2}, ["passed", "passed", "current", "to_come"]),
        ({"current_waypoint": 9}, ["passed"] * 4),
        ({"number_of_poses_remaining": 3}, ["passed", "current", "to_come", "to_come"]),
        ({"number_of_poses_remaining": 9}, ["current", "to_come", "to_come", "to_come"]),
        ({"number_of_poses_remaining": 0}, ["current", "to_come", "to_come", "to_come"]),
    ],
)
def test_a_feedback_says_which_pose_is_the_current_one(fields: Any, states: list[str]) -> None:
    assert said(goal_with(), **fields) == states


def test_a_loop_begins_again() -> None:
    goal = goal_with()
    said(goal, current_waypoint=3)
    assert said(goal, current_waypoint=0) == ["current", "to_come", "to_come", "to_come"]


def test_a_count_without_the_list_says_nothing() -> None:
    goal = goal_with(known=False)
    said(goal, number_of_poses_remaining=3)
    assert goal.current is None
    said(goal, current_waypoint=2)
    assert goal.current == 2


@pytest.mark.parametrize("way", [math.nan, math.inf, None])
def test_a_way_that_is_no_number_is_not_shown(way: Any) -> None:
    goal = goal_with()
    said(goal, distance_remaining=3.5)
    assert goal.way_m == 3.5
    said(goal, distance_remaining=way)
    assert goal.way_m is None


@pytest.mark.parametrize(
    ("end", "missed", "states"),
    [
        (4, {}, ["reached"] * 4),
        (4, {1: 105}, ["reached", "missed", "reached", "reached"]),
        (5, {}, ["passed", "passed", "left", "left"]),
        (6, {2: 208, 9: 208}, ["passed", "passed", "missed", "left"]),
        (7, {}, ["passed", "passed", "left", "left"]),
    ],
)
def test_an_end_marks_each_pose(end: int, missed: dict[int, int], states: list[str]) -> None:
    goal = goal_with()
    said(goal, current_waypoint=2)
    goal.finish(end, missed, 9.0)
    assert [goal.state(index) for index in range(4)] == states
    assert goal.is_good == (states == ["reached"] * 4)


@pytest.mark.parametrize(
    ("result", "missed"),
    [
        (Message(), {}),
        (Message(missed_waypoints=[1, 3]), {1: 0, 3: 0}),  # Humble
        (Message(missed_waypoints=[Message(index=1, error_code=105)]), {1: 105}),  # Jazzy
        (Message(missed_waypoints=[Message(waypoint_index=1, error_code=208)]), {1: 208}),  # Kilted
        (
            Message(
                waypoint_statuses=[
                    Message(waypoint_status=1, waypoint_index=0, error_code=0),
                    Message(waypoint_status=2, waypoint_index=1, error_code=0),
                    Message(waypoint_status=3, waypoint_index=2, error_code=105),
                ]
            ),
            {1: 0, 2: 105},
        ),
        (Message(missed_waypoints=range(10_000)), dict.fromkeys(range(2_000), 0)),
    ],
)
def test_missed_poses_are_read_in_the_form_of_each_distribution(
    result: Any, missed: dict[int, int]
) -> None:
    assert missed_of(result) == missed
