"""What a map shows: pure, from (widget, robot, time)."""

import math
from typing import Any, Final

from app.cell.permission.robot_pose import locate, map_doubt
from app.cell.permission.verdict import topic_mismatch
from app.cell.robot.maps import Grid
from app.cell.robot.state import RobotState
from app.panel.widgets.map_view import MapView
from app.system.clock import format_time
from app.system.texts import TextLike, say

PLACES: Final = 2  # decimals of metres and radians that a page gets


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
    note = map_doubt(state, robot) or shown.note
    if not robot.link_up or not robot.graph.peers:
        note = say("map_no_connection") if shown.pose is None else note or say("map_no_connection")
    return {
        "state": "old" if note else "live",
        "note": note,
        "grid": _grid(state.grid),
        "pose": None if shown.pose is None else [round(part, PLACES) for part in shown.pose],
        "about": say("map_about", time=format_time(state.wall)),
    }, shown.until


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
