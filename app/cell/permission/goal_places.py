"""Whether a place or a touched pose may be sent to a robot: pure, from (input, value, robot, time).

A lock that does not depend on the choice is that of the command; a choice is refused for a reason of
its own. Unknown means locked: an old pose, a map of before a cut, floor that the map does not know.
"""

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any, Final

from app.cell.permission.robot_pose import ShownPose, locate, map_doubt
from app.cell.permission.verdict import Verdict, topic_mismatch
from app.cell.robot.maps import Grid
from app.cell.robot.places import floor_at
from app.cell.robot.state import RobotState
from app.cell.robot.transforms import Pose
from app.panel.places import Place
from app.panel.widgets.map_view import MapView
from app.panel.widgets.place import MapPose, PlaceInput, message_parts, read_pose
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
    version. `refusal` is why it may not be sent now, "" if it may."""

    place: Place | None
    pose: Pose
    version: str
    refusal: TextLike = ""


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


def map_of(widget: PlaceInput, robot: RobotState) -> MapView:
    """The map that the input is of."""
    return robot.map_views[widget.map]


def radius_of(widget: PlaceInput, robot: RobotState) -> float:
    """How much floor must be free around a goal, in metres."""
    return map_of(widget, robot).radius if widget.radius is None else widget.radius


def places_of(widget: PlaceInput, robot: RobotState) -> Iterator[Place]:
    """The places that may be chosen: those of the file, in its order or that of the input, then those
    that were saved. An id of the file counts before that of a saved place."""
    known = {str(place.id): place for place in robot.places}
    if widget.places is None:
        yield from robot.places
    else:
        yield from (known[name] for name in widget.places if name in known)
    if widget.places is None or widget.save:
        yield from (place for place in robot.saved_places if place.id not in known)


def places_verdict(command: str, robot: RobotState, now: float) -> Verdict | None:
    """The lock of a command whose message has a place, while no place could be sent, or until when it
    may be; None for another command."""
    verdicts = [input_verdict(widget, robot, now) for widget in robot.place_inputs.get(command, ())]
    return min(verdicts, key=lambda verdict: (verdict.permitted, verdict.until)) if verdicts else None


def map_versions(command: str, robot: RobotState) -> str:
    """The maps of the places that a command sends: it may be sent while the operator sees these."""
    grids = (current_map(widget, robot) for widget in robot.place_inputs[command])
    return " ".join(grid.version for grid in grids if isinstance(grid, Grid))


def input_verdict(
    widget: PlaceInput, robot: RobotState, now: float, require_pose: bool | None = None
) -> Verdict:
    """The lock that does not depend on the choice: the map or, by default if the input requires it, the
    robot's pose is not known now."""
    require_pose = widget.require_pose if require_pose is None else require_pose
    grid = current_map(widget, robot)
    if not isinstance(grid, Grid):
        return Verdict(False, "place_no_map", _no_map(grid), now + RECHECK_S)
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


def current_map(widget: PlaceInput, robot: RobotState) -> Grid | TextLike:
    """The map, if it is the robot's of now; else why it is not."""
    view = map_of(widget, robot)
    state = robot.maps[robot.key(view.topic)]
    if mismatch := topic_mismatch("MS", view, robot):
        return mismatch.reason or ""
    if state.problem:
        return state.problem
    if state.grid is None:
        return say("map_waiting")
    if not state.grid.geometry.frame:
        return say("map_no_frame")
    return map_doubt(state, robot) or state.grid


def robot_pose(widget: PlaceInput, robot: RobotState, now: float) -> ShownPose:
    """Where the robot is on the input's map; without a pose if that is not known."""
    grid = current_map(widget, robot)
    if not isinstance(grid, Grid):
        return ShownPose(None, grid, until=now + RECHECK_S)
    return locate(map_of(widget, robot), robot, grid.geometry, now)


def choice_of(widget: PlaceInput, value: Any, robot: RobotState) -> Choice:
    """What a value chooses; InputError for one that is neither a place nor, with `touch`, a pose."""
    text = widget.check_value(value)
    if (touched := read_pose(text)) is not None and widget.touch:
        pose = Pose(touched.x, touched.y, touched.yaw)
        return Choice(None, pose, touched.version, _touched_refusal(widget, touched, robot))
    for place in places_of(widget, robot):
        if place.id == text:
            return place_choice(widget, place, robot)
    raise InputError(say("place_gone", label=widget.label))


def place_choice(widget: PlaceInput, place: Place, robot: RobotState) -> Choice:
    """A place of the list, with why it may not be sent now."""
    grid = current_map(widget, robot)
    pose = Pose(place.x, place.y, math.remainder(place.yaw, math.tau))
    refusal: TextLike = ""
    if isinstance(grid, Grid):
        if place.map_version not in (None, grid.version):
            refusal = say("place_other_map", place=place.label)
        elif place.frame not in (None, grid.geometry.frame):
            frame = str(place.frame)
            refusal = say("place_other_frame", place=place.label, frame=frame, map=grid.geometry.frame)
        else:
            refusal = _floor_refusal(widget, pose, grid, robot)
    return Choice(place, pose, place.map_version or "", refusal)


def _touched_refusal(widget: PlaceInput, touched: MapPose, robot: RobotState) -> TextLike:
    grid = current_map(widget, robot)
    if not isinstance(grid, Grid):
        return ""  # the command's lock says it
    if touched.version != grid.version:
        return say("place_map_changed")
    return _floor_refusal(widget, Pose(touched.x, touched.y, touched.yaw), grid, robot)


def _floor_refusal(widget: PlaceInput, pose: Pose, grid: Grid, robot: RobotState) -> TextLike:
    radius = radius_of(widget, robot)
    floor = floor_at(grid, pose.x, pose.y, radius)
    if floor == "outside":
        return say("place_outside")
    if zone := robot.keep_out.at(grid.version, pose.x, pose.y, radius):
        return say("place_in_zone", zone=zone.label)
    return "" if floor == "free" else say(FLOOR_CODES[floor], radius=number(f"{radius:g}", "m"))


def goal_of(widget: PlaceInput, value: Any, robot: RobotState, now: float) -> Goal | TextLike:
    """What is sent for a value, or why nothing is; InputError for a value that chooses nothing."""
    choice = choice_of(widget, value, robot)
    verdict = input_verdict(widget, robot, now)
    if not verdict.permitted:
        return verdict.reason or ""
    if choice.refusal:
        return choice.refusal
    if robot.maps[robot.key(map_of(widget, robot).topic)].is_behind:
        return say("place_map_behind")
    grid = current_map(widget, robot)
    if not isinstance(grid, Grid):
        return _no_map(grid)
    return Goal(choice.pose, grid.geometry.frame, name_of(choice))


def point_to_save(
    widget: PlaceInput, value: str, version: str, robot: RobotState, now: float
) -> MapPoint | TextLike:
    """The pose that a place is saved of, or why there is none: of a touched pose by the rule for goals
    without that for the robot's pose; for "" where the robot is now. `version` is that of the map that
    the screen showed. InputError for a value that is no touched pose."""
    choice = choice_of(widget, value, robot) if value else None
    if choice is not None and choice.place is not None:
        raise InputError("value must be a pose that was touched on the map, not the id of a place")
    verdict = input_verdict(widget, robot, now, require_pose=choice is None)
    if not verdict.permitted:
        return verdict.reason or ""
    grid = current_map(widget, robot)
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
