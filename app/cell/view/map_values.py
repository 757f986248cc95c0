"""What a map shows: pure, from (widget, robot, time)."""

import math
from typing import Any, Final

from app.cell.permission.robot_pose import KnownLevel, locate, map_doubt, robot_level
from app.cell.permission.verdict import topic_mismatch
from app.cell.robot.maps import Geometry, Grid
from app.cell.robot.state import RobotState
from app.cell.view.map_layer_values import ShownLayer, grid_values, map_layer, no_layer
from app.cell.view.map_robots import without_others
from app.panel.places import Zone
from app.panel.widgets.map_levels import MapLevel
from app.panel.widgets.map_view import MapView
from app.system.clock import format_time
from app.system.texts import TextLike, number, say

PLACES: Final = 2  # decimals of metres and radians that a page gets
ROTATED: Final = 1e-3  # radians: an origin that is turned by more is rotated


def map_view(widget: MapView, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` (live, old, waiting, unreadable), `note`, `grid` (the map's geometry and
    version; None without one), `pose` ([x, y, yaw] in metres and radians in the map's frame, None if
    unknown), `zones`, `about`, the time of the map and how precise the pose is, `detail`, `layer_0` and
    so on, and `layer_note`, what is wrong with the first layer that is not drawn, `routes` if the panel
    file has a route graph. All of these are of the level on which the robot is; with levels also
    `level`, its id ("" if unknown), `level_note`, which says so where another one is shown, and
    `levels`, each with `id`, `label`, `grid`, `zones`, `about`, `detail` and `note`, why its map is not
    shown. And when they change."""
    known = robot_level(widget, robot, now)
    shown, until = _on_level(widget, known, robot, now)
    return {**shown, **_levels(widget, known, robot)}, min(until, known.until)


def _on_level(
    widget: MapView, known: KnownLevel, robot: RobotState, now: float
) -> tuple[dict[str, Any], float]:
    """The attributes of the level on which the robot is."""
    level = known.level
    if level is None:
        return _without_map(widget, robot, "waiting", known.note), math.inf
    state = robot.maps[robot.key(level.topic)]
    if (why := _not_shown(level, robot)) is not None:
        return _without_map(widget, robot, *why), math.inf
    assert state.grid is not None
    geometry = state.grid.geometry
    shown = locate(widget, robot, geometry, now)
    note = map_doubt(state, robot) or shown.note
    if not robot.link_up or not robot.graph.peers:
        note = say("map_no_connection") if shown.pose is None else note or say("map_no_connection")
    layers = [
        map_layer(widget, layer, robot, geometry, now)
        if layer.level in (None, level.id)
        else ShownLayer(no_layer(layer))
        for layer in widget.layers
    ]
    routes = _routes(widget, robot, level)
    too_fast = say("map_too_fast") if state.is_too_fast else ""
    warnings = [too_fast, *(layer.attributes["warning"] for layer in layers)]
    warnings += [each["note"] for each in routes.values()]
    ellipses = [layer.attributes["ellipse"] for layer in layers if "ellipse" in layer.attributes]
    return {
        "state": "old" if note else "live",
        "note": note,
        "grid": grid_values(geometry, state.grid.version, geometry.origin),
        "pose": None if shown.pose is None else [round(part, PLACES) for part in shown.pose],
        "zones": _zones(level, state.grid, robot),
        "about": _about(state.wall, ellipses if shown.pose is not None and not shown.note else []),
        "detail": too_fast or _detail(geometry),
        "layer_note": next(filter(None, warnings), ""),
        **{f"layer_{number}": dict(layer.attributes) for number, layer in enumerate(layers)},
        **routes,
        **without_others(widget, shown.age),
    }, min([shown.until, *(layer.until for layer in layers)])


def _not_shown(level: MapLevel, robot: RobotState) -> tuple[str, TextLike] | None:
    """The state of a map that can't be shown, and why; None for one that can."""
    state = robot.maps[robot.key(level.topic)]
    if mismatch := topic_mismatch("MS", level, robot):
        return "unreadable", mismatch.reason or ""
    if state.problem:
        return "unreadable", state.problem
    return ("waiting", say("map_waiting")) if state.grid is None else None


def _levels(widget: MapView, known: KnownLevel, robot: RobotState) -> dict[str, Any]:
    if not widget.levels:
        return {}
    here = known.level
    note = known.note if here is None else say("map_level_robot", level=here.label)
    rows = [_level_row(level, robot) for level in widget.levels]
    return {"level": "" if here is None else here.id, "level_note": note, "levels": rows}


def _level_row(level: MapLevel, robot: RobotState) -> dict[str, Any]:
    """What a level shows while the robot is not there."""
    row: dict[str, Any] = {"id": level.id, "label": level.label, "zones": [], "about": "", "detail": ""}
    if (why := _not_shown(level, robot)) is not None:
        return {**row, "grid": None, "note": why[1]}
    state = robot.maps[robot.key(level.topic)]
    assert state.grid is not None
    geometry = state.grid.geometry
    return {
        **row,
        "grid": grid_values(geometry, state.grid.version, geometry.origin),
        "zones": _zones(level, state.grid, robot),
        "about": _about(state.wall, []),
        "detail": _detail(geometry),
        "note": map_doubt(state, robot),
    }


def _zones(level: MapLevel, grid: Grid, robot: RobotState) -> list[dict[str, Any]]:
    return [_zone(zone) for zone in robot.zones if zone.counts_on(grid.version, level.id)]


def _about(wall: float, ellipses: list[list[float]]) -> TextLike:
    """When the map came; and how far the robot may be from where it is drawn."""
    if not ellipses:
        return say("map_about", time=format_time(wall))
    metres = ellipses[0][0]
    within = number(f"{metres:.1f}", "m") if metres >= 1 else number(f"{100 * metres:.0f}", "cm")
    return say("map_about_within", time=format_time(wall), within=within)


def _routes(widget: MapView, robot: RobotState, here: MapLevel | None = None) -> dict[str, Any]:
    """The version of the route graph, "" while it is not drawn, and why: it is in another frame than
    the map of its level, or there is no map. `here` is the level of a map without levels."""
    if widget.routes is None:
        return {}
    graph = widget.routes.graph
    level = next((each for each in widget.levels if each.id == widget.routes.level), here)
    grid = None if level is None else robot.maps[robot.key(level.topic)].grid
    if grid is None or not grid.geometry.frame:
        return {"routes": {"version": "", "note": ""}}
    if graph.frame not in ("", frame := grid.geometry.frame):
        note = say("map_routes_frame", frame=graph.frame, map=frame)
        return {"routes": {"version": "", "note": note}}
    return {"routes": {"version": graph.version, "note": ""}}


def _zone(zone: Zone) -> dict[str, Any]:
    """An area for the page: its outline and its holes, by corners in metres, and where a one-way zone
    leads, in radians."""
    return {"label": zone.label, "kind": zone.kind, "rings": zone.rings, "yaw": zone.yaw}


def _detail(geometry: Geometry) -> TextLike:
    """What the map's origin means for Nav2."""
    if abs(geometry.origin.yaw) <= ROTATED:
        return ""
    return say("map_rotated", degrees=number(f"{math.degrees(geometry.origin.yaw):.1f}", "°"))


def _without_map(widget: MapView, robot: RobotState, state: str, note: TextLike) -> dict[str, Any]:
    return {
        "state": state,
        "note": note,
        "grid": None,
        "pose": None,
        "zones": [],
        "about": "",
        "detail": "",
        "layer_note": "",
        **{f"layer_{number}": no_layer(layer) for number, layer in enumerate(widget.layers)},
        **_routes(widget, robot),
        **without_others(widget, ""),
    }
