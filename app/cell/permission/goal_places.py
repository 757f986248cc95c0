"""Whether a place or a touched pose may be sent to a robot: pure, from (input, value, robot, time).

A lock that does not depend on the choice is that of the command; a choice is refused for a reason of
its own. Unknown means locked: an old pose, a map of before a cut, floor that the map does not know.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from app.cell.permission.map_masks import MaskState, is_in_mask, layer_label, mask_of
from app.cell.permission.robot_pose import ShownPose, locate, map_on, robot_level
from app.cell.permission.verdict import Verdict
from app.cell.robot.maps import Grid
from app.cell.robot.places import floor_at
from app.cell.robot.state import RobotState
from app.cell.robot.transforms import Pose
from app.panel.places import Place
from app.panel.widgets.map_layers import MapLayer
from app.panel.widgets.map_levels import MapLevel
from app.panel.widgets.map_view import MapView
from app.panel.widgets.place import MapInput, MapPose, PlaceInput, message_parts, read_pose
from app.panel.widgets.tour import Tour, tour_parts
from app.system.errors import InputError
from app.system.texts import TextLike, ended, joined, number, say

RECHECK_S: Final = 0.5  # after which a lock is judged again: transforms do not wake the commands
FLOOR_CODES: Final = {
    "outside": "place_outside",
    "occupied": "place_occupied",
    "unknown": "place_unknown_floor",
}


@dataclass(frozen=True, slots=True)
class Choice:
    """What is chosen: a place of the list, or None and a pose that was touched on the map with this
    version. `level` is the level that it is on, None if that is not known; `is_elsewhere`: the robot is
    on another one. `refusal` is why it may not be sent now, "" if it may."""

    place: Place | None
    pose: Pose
    version: str
    level: MapLevel | None
    is_elsewhere: bool = False
    refusal: TextLike = ""


class MapHere(NamedTuple):
    """The level on which the robot is, None if that is not known; its map, or why there is none; and
    the masks over it in whose cells no goal may be."""

    level: MapLevel | None
    grid: Grid | TextLike
    masks: tuple[tuple[MapLayer, MaskState], ...] = ()


class MapFrame(NamedTuple):
    """The frame of a map on which something may be sent."""

    frame_id: str


@dataclass(frozen=True, slots=True)
class MapPoint:
    """A pose on the map with this version, in its frame."""

    pose: Pose
    frame: str
    version: str


@dataclass(frozen=True, slots=True)
class Goal:
    """What is sent: a pose in the map's frame. `name` is what a receipt calls it."""

    pose: Pose
    frame: str
    name: TextLike

    @property
    def parts(self) -> dict[str, Any]:
        """What messages name of it."""
        return message_parts(*self.pose, self.frame, str(self.name))


@dataclass(frozen=True, slots=True)
class TourGoal:
    """The same of a tour: its poses in their order."""

    stops: tuple[Goal, ...]
    frame: str
    name: TextLike

    @property
    def parts(self) -> dict[str, Any]:
        """What messages name of it."""
        return tour_parts([stop.parts for stop in self.stops], self.frame, str(self.name))


def map_of(widget: MapInput, robot: RobotState) -> MapView:
    """The map that the input is of."""
    return robot.map_views[widget.map]


def radius_of(widget: MapInput, robot: RobotState) -> float:
    """How much floor must be free around a goal, in metres."""
    return map_of(widget, robot).radius if widget.radius is None else widget.radius


def places_of(widget: PlaceInput, robot: RobotState) -> Iterator[Place]:
    """The places that may be chosen: those of the file that are on a level of the map, in its order or
    that of the input, then those that were saved. An id of the file counts before that of a saved
    place."""
    known = {str(place.id): place for place in robot.places}
    if widget.places is None:
        view = map_of(widget, robot)
        yield from (place for place in robot.places if view.offers(place))
    else:
        yield from (known[name] for name in widget.places if name in known)
    if widget.places is None or widget.save:
        yield from (place for place in robot.saved_places if place.id not in known)


def places_verdict(command: str, robot: RobotState, now: float) -> Verdict | None:
    """The lock of a command whose message has a place, while no place could be sent, or until when it
    may be; None for another command."""
    verdicts = [
        tour_verdict(widget, robot, now)
        if isinstance(widget, Tour)
        else input_verdict(widget, robot, now)
        for widget in robot.place_inputs.get(command, ())
    ]
    return min(verdicts, key=lambda verdict: (verdict.permitted, verdict.until)) if verdicts else None


def map_versions(command: str, robot: RobotState, now: float) -> str:
    """The maps of the places that a command sends: it may be sent while the operator sees these."""
    grids = (map_here(widget, robot, now).grid for widget in robot.place_inputs[command])
    return " ".join(grid.version for grid in grids if isinstance(grid, Grid))


def input_verdict(
    widget: MapInput, robot: RobotState, now: float, require_pose: bool | None = None
) -> Verdict:
    """The lock that does not depend on the choice: the map or, by default if the input requires it, the
    robot's pose is not known now."""
    require_pose = widget.require_pose if require_pose is None else require_pose
    _, grid, masks = map_here(widget, robot, now)
    if not isinstance(grid, Grid):
        return Verdict(False, "place_no_map", _no_map(grid), now + RECHECK_S)
    for layer, state in masks:
        if state.mask is None:
            why = say("map_layer_note", layer=layer_label(layer), note=ended(state.note))
            reason = joined((why, say("place_no_mask")))
            return Verdict(False, "place_no_mask", reason, now + RECHECK_S)
    if not require_pose:
        return Verdict(True, until=now + RECHECK_S)
    shown = locate(map_of(widget, robot), robot, grid.geometry, now)
    until = min(shown.until, now + RECHECK_S)
    if not shown.note:
        return Verdict(True, until=until)
    if shown.age:
        return Verdict(False, "place_pose_old", say("place_pose_old", age=shown.age), until)
    reason = joined((say("place_pose_unknown"), ended(shown.note)))
    return Verdict(False, "place_pose_unknown", reason, until)


def _no_map(why: TextLike) -> TextLike:
    return joined((ended(why), say("place_no_map")))


def map_here(widget: MapInput, robot: RobotState, now: float) -> MapHere:
    """The map of the level on which the robot is, if it is the robot's of now."""
    view = map_of(widget, robot)
    known = robot_level(view, robot, now)
    if known.level is None:
        return MapHere(None, known.note)
    if not isinstance(grid := map_on(known.level, robot), Grid):
        return MapHere(known.level, grid)
    layers = (layer for layer in view.keep_out if layer.level in (None, known.level.id))
    masks = ((layer, mask_of(layer, robot, grid.geometry, now)) for layer in layers)
    return MapHere(known.level, grid, tuple(masks))


def robot_pose(widget: MapInput, robot: RobotState, now: float) -> ShownPose:
    """Where the robot is on the input's map; without a pose if that is not known."""
    grid = map_here(widget, robot, now).grid
    if not isinstance(grid, Grid):
        return ShownPose(None, grid, until=now + RECHECK_S)
    return locate(map_of(widget, robot), robot, grid.geometry, now)


def choice_of(widget: PlaceInput, value: Any, robot: RobotState, now: float) -> Choice:
    """What a value chooses; InputError for one that is neither a place nor, with `touch`, a pose."""
    text = widget.check_value(value)
    if (touched := read_pose(text)) is not None and widget.touch:
        return _touched_choice(widget, touched, robot, map_here(widget, robot, now))
    for place in places_of(widget, robot):
        if place.id == text:
            return place_choice(widget, place, robot, map_here(widget, robot, now))
    raise InputError(say("place_gone", label=widget.label))


def place_choice(widget: MapInput, place: Place, robot: RobotState, now: MapHere) -> Choice:
    """A place of the list, with why it may not be sent now."""
    here, grid, _ = now
    level = _level_of(widget, place, robot)
    is_elsewhere = here is not None and level is not None and level.id != here.id
    pose = Pose(place.x, place.y, math.remainder(place.yaw, math.tau))
    refusal: TextLike = ""
    if here is not None and isinstance(grid, Grid):
        if level is not None and is_elsewhere:
            refusal = say("place_other_level", place=place.label, level=level.label, here=here.label)
        elif place.map_version not in (None, grid.version):
            refusal = say("place_other_map", place=place.label)
        elif place.frame not in (None, grid.geometry.frame):
            frame = str(place.frame)
            refusal = say("place_other_frame", place=place.label, frame=frame, map=grid.geometry.frame)
        else:
            refusal = _floor_refusal(widget, pose, now, robot)
    return Choice(place, pose, place.map_version or "", level, is_elsewhere, refusal)


def _level_of(widget: MapInput, place: Place, robot: RobotState) -> MapLevel | None:
    """The level that a place says, or whose map now has its version; None if that is not known."""
    levels = map_of(widget, robot).maps
    if place.level is not None:
        return next((level for level in levels if level.id == place.level), None)
    on = _levels_with(place.map_version or "", widget, robot)
    return on[0] if len(on) == 1 else None


def _levels_with(version: str, widget: MapInput, robot: RobotState) -> list[MapLevel]:
    """The levels whose map has this version."""
    states = ((level, robot.maps[robot.key(level.topic)]) for level in map_of(widget, robot).maps)
    return [level for level, state in states if state.grid and state.grid.version == version]


def _touched_choice(widget: PlaceInput, touched: MapPose, robot: RobotState, now: MapHere) -> Choice:
    """A pose on the map that the screen showed."""
    here, grid, _ = now
    pose = Pose(touched.x, touched.y, touched.yaw)
    on = _levels_with(touched.version, widget, robot)
    level = on[0] if len(on) == 1 else None
    is_elsewhere = here is not None and level is not None and level.id != here.id
    refusal: TextLike = ""
    if here is not None and isinstance(grid, Grid):  # else the command's lock says it
        if len(on) > 1:
            refusal = say("place_levels_alike", first=on[0].label, second=on[1].label)
        elif level is not None and is_elsewhere:
            refusal = say("place_touched_level", level=level.label, here=here.label)
        elif touched.version != grid.version:
            refusal = say("place_map_changed")
        else:
            refusal = _floor_refusal(widget, pose, now, robot)
    return Choice(None, pose, touched.version, level, is_elsewhere, refusal)


def _floor_refusal(widget: MapInput, pose: Pose, here: MapHere, robot: RobotState) -> TextLike:
    level, grid, masks = here
    assert level is not None
    assert isinstance(grid, Grid)
    radius = radius_of(widget, robot)
    floor = floor_at(grid, pose.x, pose.y, radius)
    if floor == "outside":
        return say("place_outside")
    if zone := robot.keep_out.at(grid.version, level.id, pose.x, pose.y, radius):
        return say("place_in_zone", zone=zone.label)
    for layer, state in masks:
        if state.mask is not None and is_in_mask(state.mask, pose, radius):
            return say("place_in_zone", zone=layer_label(layer))
    return "" if floor == "free" else say(FLOOR_CODES[floor], radius=number(f"{radius:g}", "m"))


def goal_of(widget: PlaceInput, value: Any, robot: RobotState, now: float) -> Goal | TextLike:
    """What is sent for a value, or why nothing is; InputError for a value that chooses nothing."""
    choice = choice_of(widget, value, robot, now)
    verdict = input_verdict(widget, robot, now)
    if not verdict.permitted:
        return verdict.reason or ""
    if choice.refusal:
        return choice.refusal
    frame = _frame_now(widget, robot, now)
    return Goal(choice.pose, frame.frame_id, name_of(choice)) if isinstance(frame, MapFrame) else frame


def tour_of(widget: Tour, value: Any, robot: RobotState, now: float) -> TourGoal | TextLike:
    """The same of a tour."""
    choices = tour_choices(widget, value, robot, now)
    verdict = tour_verdict(widget, robot, now)
    if not verdict.permitted:
        return verdict.reason or ""
    frame = _frame_now(widget, robot, now)
    if not isinstance(frame, MapFrame):
        return frame
    goals = (Goal(each.pose, frame.frame_id, name_of(each)) for each in choices)
    return TourGoal(tuple(goals), frame.frame_id, widget.label)


def _frame_now(widget: MapInput, robot: RobotState, now: float) -> MapFrame | TextLike:
    """The frame of the map of now, or why nothing may be sent on it."""
    here, grid, masks = map_here(widget, robot, now)
    topics = [here.topic, *(layer.topic for layer, _ in masks)] if here is not None else []
    if any(robot.maps[robot.key(topic)].is_behind for topic in topics):
        return say("place_map_behind")
    return MapFrame(grid.geometry.frame) if isinstance(grid, Grid) else _no_map(grid)


def tour_choices(widget: Tour, value: Any, robot: RobotState, now: float) -> list[Choice]:
    """The places of a tour in their order; InputError for a value that is not the tour."""
    widget.check_value(value)
    known, here = {str(place.id): place for place in robot.places}, map_here(widget, robot, now)
    if not known.keys() >= {*(widget.places or ())}:
        raise InputError(say("place_gone", label=widget.label))
    return [place_choice(widget, known[name], robot, here) for name in widget.places or ()]


def tour_verdict(widget: Tour, robot: RobotState, now: float) -> Verdict:
    """The lock of what sends a tour: that of an input, or a place that may not be sent now."""
    verdict = input_verdict(widget, robot, now)
    if not verdict.permitted:
        return verdict
    choices = tour_choices(widget, widget.default_value, robot, now)
    for stop, choice in enumerate(choices, start=1):
        if choice.refusal:
            return Verdict(False, "tour_stop_refused", stop_refusal(stop, choice), verdict.until)
    return verdict


def stop_refusal(stop: int, choice: Choice) -> TextLike:
    """Why a tour is not sent, by its place that may not be sent now."""
    return say("tour_stop_refused", number=stop, place=name_of(choice), why=choice.refusal)


def point_to_save(
    widget: PlaceInput, value: str, version: str, robot: RobotState, now: float
) -> MapPoint | TextLike:
    """The pose that a place is saved of, or why there is none: of a touched pose by the rule for goals
    without that for the robot's pose; for "" where the robot is now. `version` is that of the map that
    the screen showed. InputError for a value that is no touched pose."""
    choice = choice_of(widget, value, robot, now) if value else None
    if choice is not None and choice.place is not None:
        raise InputError("value must be a pose that was touched on the map, not the id of a place")
    verdict = input_verdict(widget, robot, now, require_pose=choice is None)
    if not verdict.permitted:
        return verdict.reason or ""
    grid = map_here(widget, robot, now).grid
    if not isinstance(grid, Grid):
        return _no_map(grid)
    if choice is not None and choice.refusal:
        return choice.refusal
    if version not in ("", grid.version):
        return say("place_map_changed")
    pose = choice.pose if choice is not None else robot_pose(widget, robot, now).pose
    if pose is None:
        return say("place_pose_unknown")
    return MapPoint(pose, grid.geometry.frame, grid.version)


def name_of(choice: Choice) -> TextLike:
    """The place's label, or where it was touched."""
    if choice.place is not None:
        return choice.place.label
    return say("place_at", x=metres(choice.pose.x), y=metres(choice.pose.y))


def metres(length: float) -> TextLike:
    """A length on the map."""
    return number(f"{length:.2f}", "m")
