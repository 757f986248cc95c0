"""What a tour shows: its places, or the poses of the goal that runs and how far the robot is. Pure,
from (widget, robot, time)."""

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

from app.cell.permission.goal_places import (
    input_verdict,
    map_here,
    metres,
    robot_pose,
    tour_choices,
)
from app.cell.robot.maps import Grid
from app.cell.robot.state import RobotState
from app.cell.robot.waypoints import SUCCEEDED, Waypoint, WaypointGoal, waypoints_at
from app.cell.view.place_values import DECIMALS, distance, turned
from app.cell.view.times import BAD_S, GOOD_S
from app.panel.known_values import known_value
from app.panel.places import Place
from app.panel.shared_keys import stale_at
from app.panel.widgets.tour import Tour
from app.system.clock import format_age
from app.system.texts import TextLike, joined, number, say

SAME_M: Final = 0.02  # of a pose and the place that it is
SAME_RAD: Final = 0.02
ERRORS: Final = "nav2_msgs/action/FollowWaypoints"  # of what it missed
STATE_WORDS: Final = {
    "to_come": "tour_to_come",
    "current": "tour_current",
    "passed": "tour_passed",
    "reached": "tour_reached",
    "missed": "tour_missed",
    "left": "tour_left",
}
ENDS: Final = {4: "tour_all_reached", 5: "tour_canceled", 6: "tour_aborted"}


class Row(NamedTuple):
    """A pose of the list: its number from 1 on, what an operator calls it, and what is known of it."""

    number: int
    label: TextLike
    state: str
    word: TextLike
    note: TextLike
    pose: list[float] | None


def tour(widget: Tour, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` (live, missing, old), `note`, why the tour may not be sent now, `title`, how
    far the goal is, "" without one, and `rows`, each with `number`, `label`, `state`, its `word`, a
    `note` and its `pose` on the map, None for one that is not on it; `level` is the level that they are
    on. And when they change. A goal that has ended is shown as long as its result."""
    goal = _goal(widget, robot, now)
    here, grid, _ = map_here(widget, robot, now)
    level = "" if here is None else here.id
    if goal is None:
        planned, changes = _planned(widget, robot, now)
        return {**planned, "level": level}, changes
    poses, total = _poses(widget, goal, robot)
    frame = grid.geometry.frame if isinstance(grid, Grid) else None
    version = grid.version if isinstance(grid, Grid) else None
    places = [
        place
        for place in (*robot.places, *robot.saved_places)
        if place.level in (None, level)
        and place.frame in (None, frame)
        and place.map_version in (None, version)
    ]
    rows = [_row(index, pose, goal, frame, places) for index, pose in enumerate(poses)]
    until = stale_at(goal.at, widget.max_age_s)
    is_old = not goal.end and now >= until
    if is_old:
        until = now + 1.0
    title = [_title(goal, total)]
    if is_old:
        title.append(say("tour_old", age=format_age(now - goal.at)))
    if total > len(poses) and poses:
        title.append(say("tour_first", count=len(poses), total=total))
    shown: dict[str, Any] = {"state": "old" if is_old else "live", "note": "", "title": joined(title)}
    shown |= {"rows": [row._asdict() for row in rows], "level": level}
    return shown, _gone_at(goal) if goal.end else until


def _gone_at(goal: WaypointGoal) -> float:
    return goal.ended_at + (GOOD_S if goal.is_good else BAD_S)


def _goal(widget: Tour, robot: RobotState, now: float) -> WaypointGoal | None:
    """The goal that it shows: of its actions the one that runs, else the newest. Of a tour with places
    not one of another button of the panel."""
    goals = [
        goal
        for action in robot.tour_actions.get(widget.id, ())
        if (goal := robot.waypoint_goals.get(action.action)) is not None
        and (not goal.end or now < _gone_at(goal))
        and (not goal.command or not widget.places or _sends(goal.command, widget, robot))
    ]
    return max(goals, key=lambda goal: (not goal.end, goal.at), default=None)


def _sends(command: str, widget: Tour, robot: RobotState) -> bool:
    return widget in robot.place_inputs.get(command, ())


def _planned(widget: Tour, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """The places of the panel file, each with why it may not be sent now."""
    verdict = input_verdict(widget, robot, now)
    note: TextLike = "" if verdict.permitted or not widget.places else verdict.reason or ""
    choices = tour_choices(widget, widget.default_value, robot, now) if widget.places else []
    shown = robot_pose(widget, robot, now)
    before = None if shown.note else shown.pose
    rows = []
    for index, choice in enumerate(choices, start=1):
        way = "" if before is None or choice.is_elsewhere else distance(before, choice.pose)
        assert choice.place is not None
        pose = [round(part, DECIMALS) for part in choice.pose]
        rows.append(Row(index, choice.place.label, "planned", way, choice.refusal, pose)._asdict())
        before = None if choice.is_elsewhere else choice.pose
    title = "" if choices else say("tour_none")
    state = "missing" if note else "live"
    return {"state": state, "note": note, "title": title, "rows": rows}, verdict.until


def _poses(widget: Tour, goal: WaypointGoal, robot: RobotState) -> tuple[tuple[Waypoint, ...], int]:
    """The poses of a goal, and how many it has: of another program's those of the tour's topic, if
    there are so many."""
    if goal.poses is not None:
        return goal.poses, goal.total
    if widget.topic is None or goal.command:
        return (), 0
    state = robot.map_layers[robot.key(widget.topic)]
    if state.shape is None or state.problem or state.is_cut or robot.is_foreign(state.source):
        return (), 0
    total = len(state.shape.points) // 2
    if goal.current is not None and goal.current >= total:
        return (), 0  # of another goal
    return waypoints_at(state.shape.points, state.shape.frame), total


def _title(goal: WaypointGoal, total: int) -> TextLike:
    """How far a goal is; of another program's only what its feedback says."""
    if goal.end:
        ended = say(ENDS.get(goal.end, "tour_end_unknown"))
        if not goal.missed:
            return ended
        missed = say("tour_missed_count", count=len(goal.missed), total=total)
        return missed if goal.end == SUCCEEDED else joined([ended, missed])
    if goal.current is None:
        texts = [say("tour_under_way")]
    elif total:
        texts = [say("tour_at", number=min(goal.current + 1, total), total=total)]
    else:
        texts = [say("tour_at_unknown", number=goal.current + 1)]
    if not goal.command:
        texts.insert(0, say("tour_other_program"))
    if goal.way_m is not None:
        texts.append(say("tour_way", way=number(f"{goal.way_m:.1f}", "m")))
    return joined(texts)


def _row(
    index: int, pose: Waypoint, goal: WaypointGoal, frame: str | None, places: Sequence[Place]
) -> Row:
    state = goal.state(index)
    error = goal.missed.get(index, 0)
    note = known_value(ERRORS, "error_code", error) or (str(error) if error else "")
    is_on_map = frame is not None and pose.frame.lstrip("/") == frame
    shown = [round(pose.x, DECIMALS), round(pose.y, DECIMALS), round(pose.yaw or 0.0, DECIMALS)]
    label = _label(pose, places)
    return Row(index + 1, label, state, say(STATE_WORDS[state]), note, shown if is_on_map else None)


def _label(pose: Waypoint, places: Sequence[Place]) -> TextLike:
    """The place that a pose is, else where it is and which way it looks."""
    same = next((place for place in places if _is_at(place, pose)), None)
    if same is not None:
        return same.label
    where = say("place_at", x=metres(pose.x), y=metres(pose.y))
    return where if pose.yaw is None else joined([where, turned(pose.yaw)], "between_names")


def _is_at(place: Place, pose: Waypoint) -> bool:
    is_near = abs(place.x - pose.x) <= SAME_M and abs(place.y - pose.y) <= SAME_M
    turn = 0.0 if pose.yaw is None else math.remainder(place.yaw - pose.yaw, math.tau)
    return is_near and abs(turn) <= SAME_RAD
