"""Where a robot is on a map, on which of its levels, and whether that map is the robot's of now. Pure,
from (widget, robot, time)."""

import math
from dataclasses import dataclass

from app.cell.permission.verdict import topic_mismatch
from app.cell.robot.maps import Geometry, Grid, MapState
from app.cell.robot.state import RobotState
from app.cell.robot.transforms import TF, TF_STATIC, TF_TYPE, LocatedFrame, Pose
from app.panel.base import TopicQos
from app.panel.shared_keys import stale_at
from app.panel.values import same_value
from app.panel.widgets.families import TopicSource
from app.panel.widgets.map_levels import MapLevel, RobotLevel
from app.panel.widgets.map_view import MapView, PoseTopic
from app.system.clock import age_changes_at, format_age, format_time
from app.system.texts import TextLike, say


@dataclass(frozen=True, slots=True)
class ShownPose:
    """Where the robot is, or was: None if it was never seen. `note` says what is wrong, "" if it is
    there now, and `age` how old the pose is, "" if not only that is wrong. `until` (monotonic seconds)
    is when time alone changes that."""

    pose: Pose | None
    note: TextLike = ""
    until: float = math.inf
    age: TextLike = ""


def locate(widget: MapView, robot: RobotState, geometry: Geometry, now: float) -> ShownPose:
    """Where the robot is on the map."""
    if widget.pose is not None:
        return _by_topic(widget, widget.pose, robot, geometry, now)
    located = robot.transforms.locate(widget.base_frame, geometry.frame)
    if not isinstance(located, LocatedFrame):
        return ShownPose(None, _unread_transforms(robot) or located)
    if located.is_cut:
        return _old(located.pose, located.at, now)
    return _dated(located.pose, located.at, widget.max_age_s, now)


def _unread_transforms(robot: RobotState) -> TextLike:
    """Why transforms of the robot can't be received; "" if nothing is known."""
    for topic in (TF, TF_STATIC):
        if mismatch := topic_mismatch("MS", TopicSource(topic, TF_TYPE, TopicQos(), ()), robot):
            return mismatch.reason or ""
    return ""


def _by_topic(
    widget: MapView, source: PoseTopic, robot: RobotState, geometry: Geometry, now: float
) -> ShownPose:
    if mismatch := topic_mismatch("MS", source, robot):
        return ShownPose(None, mismatch.reason or "")
    reading = robot.reading(source.topic)
    if reading.fields is None:
        return ShownPose(None, say("map_pose_waiting"))
    x, y, yaw, frame, age_s = (reading.value(path) for path in source.paths)
    if str(frame).lstrip("/") != geometry.frame:
        return ShownPose(None, say("map_pose_frame", frame=frame, map=geometry.frame))
    if yaw is None or not all(map(math.isfinite, (x, y, yaw))):
        return ShownPose(None, say("map_pose_not_finite"))
    if reading.status == "foreign":
        return ShownPose(None, say("readout_foreign", time=format_time(reading.wall)))
    if reading.status in ("cut", "ended"):
        return _old(Pose(x, y, yaw), reading.at, now)
    # A node repeats its last pose for a subscriber that comes later: by arrival that looks new.
    return _dated(Pose(x, y, yaw), reading.at - (age_s or 0.0), widget.max_age_s, now)


def _dated(pose: Pose, at: float, max_age_s: float, now: float) -> ShownPose:
    if now < (until := stale_at(at, max_age_s)):
        return ShownPose(pose, until=until)
    return _old(pose, at, now)


def _old(pose: Pose, at: float, now: float) -> ShownPose:
    age = format_age(now - at)
    return ShownPose(pose, say("map_pose_old", age=age), age_changes_at(at, now), age)


def map_doubt(state: MapState, robot: RobotState) -> TextLike:
    """Why the map may not be the robot's of now; "" if it is."""
    if state.is_cut:
        return say("readout_before_disconnect", time=format_time(state.wall))
    if robot.is_foreign(state.source):
        return say("readout_foreign", time=format_time(state.wall))
    return state.doubt


def map_on(level: MapLevel, robot: RobotState) -> Grid | TextLike:
    """The map of a level, if it is the robot's of now; else why it is not."""
    state = robot.maps[robot.key(level.topic)]
    if mismatch := topic_mismatch("MS", level, robot):
        return mismatch.reason or ""
    if state.problem:
        return state.problem
    if state.grid is None:
        return say("map_waiting")
    if not state.grid.geometry.frame:
        return say("map_no_frame")
    return map_doubt(state, robot) or state.grid


@dataclass(frozen=True, slots=True)
class KnownLevel:
    """The level on which the robot is: None if that is not known, and `note` says why. `until`
    (monotonic seconds) is when time alone changes that."""

    level: MapLevel | None
    note: TextLike = ""
    until: float = math.inf


def robot_level(widget: MapView, robot: RobotState, now: float) -> KnownLevel:
    """On which level of the map the robot is. A map without levels is its only one."""
    if not widget.levels:
        return KnownLevel(widget.maps[0])
    if widget.robot_level is not None:
        return _level_by_topic(widget, widget.robot_level, robot, now)
    return _level_by_pose(widget, robot, now)


def _level_by_topic(widget: MapView, source: RobotLevel, robot: RobotState, now: float) -> KnownLevel:
    if mismatch := topic_mismatch("MS", source, robot):
        return KnownLevel(None, mismatch.reason or "")
    reading = robot.reading(source.topic)
    if reading.fields is None:
        return KnownLevel(None, say("map_level_waiting"))
    if reading.status == "foreign":
        return KnownLevel(None, say("readout_foreign", time=format_time(reading.wall)))
    if reading.status in ("cut", "ended"):
        return KnownLevel(None, say("readout_before_disconnect", time=format_time(reading.wall)))
    if now >= (until := stale_at(reading.at, source.max_age_s)):
        note = say("map_level_old", age=format_age(now - reading.at))
        return KnownLevel(None, note, age_changes_at(reading.at, now))
    value = reading.value(source.field)
    for level in widget.levels:
        if same_value(level.compared, value):
            return KnownLevel(level, until=until)
    return KnownLevel(
        None,
        say("map_level_other", value=f"{value:.60}" if isinstance(value, str) else str(value)),
        until,
    )


def _level_by_pose(widget: MapView, robot: RobotState, now: float) -> KnownLevel:
    """The level to whose map the robot's pose leads, if it leads to no other."""
    levels: list[MapLevel] = []
    until = math.inf
    for level in widget.levels:
        if isinstance(grid := map_on(level, robot), Grid):
            shown = locate(widget, robot, grid.geometry, now)
            until = min(until, shown.until)
            if shown.pose is not None and not shown.note:
                levels.append(level)
    match levels:
        case [level]:
            return KnownLevel(level, until=until)
        case [first, second, *_]:
            note = say("map_level_several", first=first.label, second=second.label)
            return KnownLevel(None, note, until)
    return KnownLevel(None, say("map_level_nowhere"), until)
