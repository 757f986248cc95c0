"""What the layers of a map show: pure, from (layer, robot, time)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from app.cell.permission.map_masks import Mask, layer_doubt, layer_label, mask_of
from app.cell.robot.map_layers import LayerState, Shape, placed
from app.cell.robot.maps import Arrival, Geometry, Grid
from app.cell.robot.state import RobotState
from app.cell.robot.transforms import IDENTITY, LocatedFrame, Pose, Quaternion, Transform
from app.panel.shared_keys import stale_at
from app.panel.widgets.map_layers import GRID_TYPE, MapLayer
from app.panel.widgets.map_view import MapView
from app.system.clock import format_age
from app.system.texts import TextLike, joined, number, say

COSTMAP: Final = "cost-"  # before the version of a costmap
AHEAD_S: Final = 1.0  # by which a message may be newer than the transforms


@dataclass(frozen=True, slots=True)
class ShownLayer:
    """A layer's attributes, and when time alone changes them (monotonic seconds)."""

    attributes: Mapping[str, Any]
    until: float = math.inf


def map_layer(
    widget: MapView, layer: MapLayer, robot: RobotState, geometry: Geometry, now: float
) -> ShownLayer:
    """Attributes: `label`, `state` (live, old, waiting, unreadable, unplaced), `note`; `warning`, the
    note with the label where the map has to say it. While it is live also what is drawn: `points` as x,
    y, x, y … in centimetres of the map's frame, `ellipse` (half axes in metres and turn in radians) or
    `grid`, as a map's."""
    key = robot.key(layer.topic)
    state: Arrival = robot.maps[key] if layer.type == GRID_TYPE else robot.map_layers[key]
    problem, code, until = layer_doubt(layer, state, robot, now)
    if not problem:
        shown = _drawn(widget, layer, robot, geometry, now)
        if isinstance(shown, ShownLayer):
            attributes = {"label": layer_label(layer), **shown.attributes}
            return ShownLayer(attributes, min(shown.until, until))
        problem, code, until = shown, "unplaced", _soon(now)
    label = layer_label(layer)
    is_usual = layer.row.ends and code in ("old", "waiting")
    warning = "" if is_usual else say("map_layer_note", layer=label, note=problem)
    attributes = {"label": label, "state": code, "note": problem, "warning": warning}
    return ShownLayer(attributes, until)


def _drawn(
    widget: MapView, layer: MapLayer, robot: RobotState, geometry: Geometry, now: float
) -> ShownLayer | TextLike:
    """What is drawn, or why it has no place on the map."""
    key = robot.key(layer.topic)
    if layer.row.is_mask:
        return _drawn_mask(layer, robot, geometry, now)
    if layer.type == GRID_TYPE:
        grid = robot.maps[key].grid
        if grid is None:
            return say("map_layer_waiting")
        located = _located(widget, grid.geometry.frame, None, robot, geometry, now)
        if not isinstance(located, LocatedFrame):
            return located
        return ShownLayer(_live(grid=costmap_grid(grid, located.transform)), _old_at(widget, located))
    state = robot.map_layers[key]
    shape = state.shape
    if shape is None:
        return say("map_layer_waiting")
    if layer.shows == "scan" and state.placed and state.placed[:2] == (shape, geometry.frame):
        return ShownLayer(_live(points=state.placed[3]))
    stamp = shape.stamp if layer.shows == "scan" and shape.stamp else None
    located = _located(widget, shape.frame, stamp, robot, geometry, now)
    if not isinstance(located, LocatedFrame):
        return located
    if stamp is not None and located.stamp is not None and stamp - located.stamp > AHEAD_S:
        return say("map_layer_ahead", seconds=number(f"{stamp - located.stamp:.1f}"))
    if shape.ellipse is not None:
        long, short, turn = shape.ellipse
        ellipse = [round(long, 3), round(short, 3), round(turn + located.pose.yaw, 3)]
        return ShownLayer(_live(ellipse=ellipse), _old_at(widget, located))
    points = _placed(state, shape, geometry.frame, located.transform)
    return ShownLayer(_live(points=points), _old_at(widget, located))


def _drawn_mask(
    layer: MapLayer, robot: RobotState, geometry: Geometry, now: float
) -> ShownLayer | TextLike:
    """A mask; that of speeds with its limits as the note."""
    state = mask_of(layer, robot, geometry, now)
    if (mask := state.mask) is None:
        return state.note
    placed_at = mask.grid.geometry
    grid = grid_values(placed_at, mask_version(layer, mask), placed_at.origin)
    note = say("map_mask_limits", limits=joined(mask.limits(), "between_names"))
    has_limits = layer.shows == "speed" and bool(mask.limits())
    return ShownLayer(_live(grid=grid) | {"note": note if has_limits else ""}, state.until)


def mask_version(layer: MapLayer, mask: Mask) -> str:
    """What the paths of its tiles name it."""
    return f"{layer.shows}-{mask.version}"


def _placed(state: LayerState, shape: Shape, frame: str, transform: Transform) -> list[int]:
    """The points in the map's frame: the same list again while nothing moves."""
    x, y, z = (round(part, 4) for part in transform.place)
    rounded = Transform((x, y, z), Quaternion(*(round(part, 4) for part in transform.turned)))
    if state.placed is None or state.placed[:3] != (shape, frame, rounded):
        state.placed = shape, frame, rounded, placed(shape, transform)
    return state.placed[3]


def _located(
    widget: MapView,
    frame: str,
    stamp: float | None,
    robot: RobotState,
    geometry: Geometry,
    now: float,
) -> LocatedFrame | TextLike:
    """Where a frame is on the map, by transforms that are not old."""
    if frame == geometry.frame:
        return LocatedFrame(IDENTITY, math.inf, None)
    located = robot.transforms.locate(frame, geometry.frame, stamp)
    if not isinstance(located, LocatedFrame):
        return located
    if located.is_cut or now >= _old_at(widget, located):
        age = format_age(now - located.at)
        return say("map_layer_transform_old", frame=frame, map=geometry.frame, age=age)
    return located


def _old_at(widget: MapView, located: LocatedFrame) -> float:
    return stale_at(located.at, widget.max_age_s)


def _soon(now: float) -> float:
    return now + 1.0


def _live(**drawn: Any) -> dict[str, Any]:
    return {"state": "live", "note": "", "warning": "", **drawn}


def no_layer(layer: MapLayer) -> dict[str, Any]:
    """The attributes of a layer over no map."""
    return {"label": layer_label(layer), "state": "waiting", "note": "", "warning": ""}


def costmap_grid(grid: Grid, transform: Transform) -> dict[str, Any]:
    """The geometry of a costmap in the map's frame, with its version."""
    geometry, origin = grid.geometry, grid.geometry.origin
    x, y, _ = transform.place
    turned = transform.turned.rotated((origin.x, origin.y, 0.0))
    pose = Pose(turned[0] + x, turned[1] + y, origin.yaw + transform.turned.yaw())
    return grid_values(geometry, COSTMAP + grid.version, pose)


def grid_values(geometry: Geometry, version: str, origin: Pose) -> dict[str, Any]:
    """What a browser needs to draw a grid."""
    return {
        "version": version,
        "width": geometry.width,
        "height": geometry.height,
        "resolution": geometry.resolution,
        "x": round(origin.x, 3),
        "y": round(origin.y, 3),
        "yaw": round(origin.yaw, 4),
    }
