"""The filter masks of Nav2 over a map: where no goal may be, and where the robot drives slowly. Pure,
from (layer, robot, time).

Source: nav2_msgs/msg/CostmapFilterInfo; the keepout and the speed filter of nav2_costmap_2d.
"""

import math
from collections.abc import Mapping
from functools import lru_cache
from typing import Final, NamedTuple

from app.cell.permission.verdict import topic_mismatch
from app.cell.robot.maps import Arrival, Geometry, Grid
from app.cell.robot.places import is_marked_near, values_of
from app.cell.robot.state import RobotState
from app.cell.robot.transforms import Pose
from app.panel.base import TopicQos
from app.panel.shared_keys import stale_at
from app.panel.widgets.families import TopicSource
from app.panel.widgets.map_layers import INFO_FIELDS, INFO_TYPE, LayerName, MapLayer
from app.system.clock import age_changes_at, format_age, format_time
from app.system.texts import TextLike, number, say

KEEP_OUT, SPEED_PERCENT, SPEED_M_S = 0, 1, 2  # types of filters
TYPES: Final[dict[LayerName, tuple[int, ...]]] = {
    "keep_out": (KEEP_OUT,),
    "speed": (SPEED_PERCENT, SPEED_M_S),
}
LETHAL: Final = 99.5  # of 100: Nav2 rounds
UNLIMITED: Final = 100.0  # percent
MAX_NAMED: Final = 4  # limits that are named


LABELS: Final[Mapping[LayerName, TextLike]] = {
    "path": say("map_layer_path"),
    "scan": say("map_layer_scan"),
    "footprint": say("map_layer_footprint"),
    "covariance": say("map_layer_covariance"),
    "costmap": say("map_layer_costmap"),
    "keep_out": say("map_layer_keep_out"),
    "speed": say("map_layer_speed"),
}


def layer_label(layer: MapLayer) -> TextLike:
    """Its label, or what its kind is called."""
    return layer.label or LABELS[layer.shows]


class Mask(NamedTuple):
    """A mask that is in force: what a cell says is `cell * multiplier + base`."""

    grid: Grid
    type: int
    base: float
    multiplier: float

    @property
    def version(self) -> str:
        """A short name of what it marks."""
        return f"{self.grid.version}-{self.type}_{self.base:g}_{self.multiplier:g}"

    @property
    def marked(self) -> bytes:
        """By the byte of a cell: 1 where the mask is in force, else 0."""
        return marked(self.type, self.base, self.multiplier)

    def limits(self) -> list[TextLike]:
        """The speed limits that it has, the lowest first."""
        unit = "%" if self.type == SPEED_PERCENT else "m/s"
        cells = [cell for cell in values_of(self.grid) if self.marked[cell]]
        values = sorted({round(cell * self.multiplier + self.base, 2) for cell in cells})
        return [number(f"{value:g}", unit) for value in values[:MAX_NAMED]]


@lru_cache(maxsize=32)
def marked(kind: int, base: float, multiplier: float) -> bytes:
    """By the byte of a cell: 1 where a mask of this kind is in force. Cells that are not known are
    not."""
    return bytes(cell <= 100 and _is_in_force(kind, cell * multiplier + base) for cell in range(256))


def _is_in_force(kind: int, value: float) -> bool:
    if kind == KEEP_OUT:
        return value >= LETHAL
    return 0 < value < UNLIMITED if kind == SPEED_PERCENT else value > 0


class MaskState(NamedTuple):
    """A mask, None if there is none that is in force: `code` (old, waiting, unreadable, unplaced) and
    `note` say why. `until` (monotonic seconds) is when time alone changes that."""

    mask: Mask | None
    note: TextLike = ""
    code: str = ""
    until: float = math.inf


def layer_doubt(
    layer: MapLayer, state: Arrival, robot: RobotState, now: float
) -> tuple[TextLike, str, float]:
    """Why a layer may not be drawn as what is there now, "" if it may; its state, and until when."""
    if mismatch := topic_mismatch("MS", layer, robot):
        return mismatch.reason or "", "unreadable", math.inf
    if state.problem:
        return state.problem, "unreadable", math.inf
    if state.at == -math.inf:
        return say("map_layer_waiting"), "waiting", math.inf
    if state.is_cut:
        return say("readout_before_disconnect", time=format_time(state.wall)), "old", math.inf
    if robot.is_foreign(state.source):
        return say("readout_foreign", time=format_time(state.wall)), "old", math.inf
    at = max(state.at, getattr(state, "updated_at", state.at))
    if now >= (until := stale_at(at, layer.most_age_s)):
        return say("map_layer_old", age=format_age(now - at)), "old", age_changes_at(at, now)
    return getattr(state, "doubt", ""), "old", until


def mask_of(layer: MapLayer, robot: RobotState, geometry: Geometry, now: float) -> MaskState:
    """The mask of a layer over the map with this geometry."""
    state = robot.maps[robot.key(layer.topic)]
    note, code, until = layer_doubt(layer, state, robot, now)
    if note:
        return MaskState(None, note, code, until)
    if state.grid is None:
        return MaskState(None, say("map_layer_waiting"), "waiting")
    info = _info(layer, robot)
    if not isinstance(info, tuple):
        return MaskState(None, info, "unreadable")
    kind, topic, base, multiplier = info
    if topic.strip("/") not in (layer.topic.strip("/"), robot.key(layer.topic)):
        return MaskState(None, say("map_mask_topic", theirs=topic, ours=layer.topic), "unreadable")
    if kind not in TYPES[layer.shows]:
        note = say("map_mask_type", type=str(kind))
        return MaskState(None, note, "unreadable")
    if not (math.isfinite(base) and math.isfinite(multiplier)):
        return MaskState(None, say("map_layer_not_finite"), "unreadable")
    if (frame := state.grid.geometry.frame) != geometry.frame:
        return MaskState(None, say("map_mask_frame", frame=frame, map=geometry.frame), "unplaced")
    return MaskState(Mask(state.grid, kind, base, multiplier), until=until)


def _info(layer: MapLayer, robot: RobotState) -> tuple[int, str, float, float] | TextLike:
    """The fields of the newest CostmapFilterInfo; or why there is none."""
    assert layer.info is not None
    if mismatch := topic_mismatch("MS", TopicSource(layer.info, INFO_TYPE, TopicQos(), ()), robot):
        return mismatch.reason or ""
    reading = robot.reading(layer.info)
    if reading.fields is None:
        return say("map_mask_waiting")
    if reading.status == "foreign":
        return say("readout_foreign", time=format_time(reading.wall))
    if reading.status in ("cut", "ended"):
        return say("readout_before_disconnect", time=format_time(reading.wall))
    kind, topic, base, multiplier = (reading.value(path) for path in INFO_FIELDS)
    return kind, str(topic), float(base), float(multiplier)


def is_in_mask(mask: Mask, pose: Pose, radius: float) -> bool:
    """Whether a circle (metres) touches a cell that the mask marks; also where it is too large to be
    looked at."""
    return is_marked_near(mask.grid, pose.x, pose.y, radius, mask.marked)
