"""What a map shows: pure, from (widget, robot, time)."""

import math
from dataclasses import dataclass
from typing import Any, Final

from app.cell.permission.verdict import topic_mismatch
from app.cell.robot.maps import Geometry, Grid, MapState
from app.cell.robot.state import RobotState
from app.cell.robot.transforms import LocatedFrame, Pose
from app.panel.shared_keys import stale_at
from app.panel.widgets.map_view import MapView, PoseTopic
from app.system.clock import age_changes_at, format_age, format_time
from app.system.texts import TextLike, say

PLACES: Final = 2  # decimals of metres and radians that a page gets


@dataclass(frozen=True, slots=True)
class ShownPose:
    """Where the robot is, or was: None if it was never seen. `note` says what is wrong, "" if it is
    there now. `until` (monotonic seconds) is when time alone changes that."""

    pose: Pose | None
    note: TextLike = ""
    until: float = math.inf


def map_view(widget: MapView, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` (live, old, waiting, unreadable), `note`, `grid` (the map's geometry and
    version; None without one), `pose` ([x, y, yaw] in metres and radians in the map's frame, None if
    unknown) and `about`, the time of the map; and when they change."""
    state = robot.maps[robot.key(widget.topic)]
    if mismatch := topic_mismatch("MS", widget, robot):
        return _without_map("unreadable", mismatch.reason or ""), math.inf
    if state.problem:
        return _without_map("unreadable", state.problem), math.inf
    if state.grid is None:
        return _without_map("waiting", say("map_waiting")), math.inf
    geometry = state.grid.geometry
    shown = locate(widget, robot, geometry, now)
    note = _map_note(state, robot) or shown.note
    if not robot.link_up or not robot.graph.peers:
        note = say("map_no_connection") if shown.pose is None else note or say("map_no_connection")
    return {
        "state": "old" if note else "live",
        "note": note,
        "grid": _grid(state.grid),
        "pose": None if shown.pose is None else [round(part, PLACES) for part in shown.pose],
        "about": say("map_about", time=format_time(state.wall)),
    }, shown.until


def locate(widget: MapView, robot: RobotState, geometry: Geometry, now: float) -> ShownPose:
    """Where the robot is on the map."""
    if widget.pose is not None:
        return _by_topic(widget, widget.pose, robot, geometry, now)
    located = robot.transforms.locate(widget.base_frame, geometry.frame)
    if not isinstance(located, LocatedFrame):
        return ShownPose(None, located)
    if located.is_cut:
        return _old(located.pose, located.at, now)
    return _dated(located.pose, located.at, widget.max_age_s, now)


def _by_topic(
    widget: MapView, source: PoseTopic, robot: RobotState, geometry: Geometry, now: float
) -> ShownPose:
    if mismatch := topic_mismatch("MS", source, robot):
        return ShownPose(None, mismatch.reason or "")
    reading = robot.reading(source.topic)
    if reading.fields is None:
        return ShownPose(None, say("map_pose_waiting"))
    x, y, yaw, frame = (reading.value(path) for path in source.paths)
    if str(frame).lstrip("/") != geometry.frame:
        return ShownPose(None, say("map_pose_frame", frame=frame, map=geometry.frame))
    if yaw is None or not all(map(math.isfinite, (x, y, yaw))):
        return ShownPose(None, say("map_pose_not_finite"))
    if reading.status == "foreign":
        return ShownPose(None, say("readout_foreign", time=format_time(reading.wall)))
    if reading.status in ("cut", "ended"):
        return _old(Pose(x, y, yaw), reading.at, now)
    return _dated(Pose(x, y, yaw), reading.at, widget.max_age_s, now)


def _dated(pose: Pose, at: float, max_age_s: float, now: float) -> ShownPose:
    if now < (until := stale_at(at, max_age_s)):
        return ShownPose(pose, until=until)
    return _old(pose, at, now)


def _old(pose: Pose, at: float, now: float) -> ShownPose:
    return ShownPose(pose, say("map_pose_old", age=format_age(now - at)), age_changes_at(at, now))


def _map_note(state: MapState, robot: RobotState) -> TextLike:
    """Why the map may not be the robot's of now; "" if it is."""
    if state.is_cut:
        return say("readout_before_disconnect", time=format_time(state.wall))
    if robot.is_foreign(state.source):
        return say("readout_foreign", time=format_time(state.wall))
    return ""


def _without_map(state: str, note: TextLike) -> dict[str, Any]:
    return {"state": state, "note": note, "grid": None, "pose": None, "about": ""}


def _grid(grid: Grid) -> dict[str, Any]:
    geometry = grid.geometry
    origin = geometry.origin
    return {
        "version": grid.version,
        "width": geometry.width,
        "height": geometry.height,
        "resolution": geometry.resolution,
        "x": origin.x,
        "y": origin.y,
        "yaw": origin.yaw,
    }
