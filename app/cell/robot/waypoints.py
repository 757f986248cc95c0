"""The goal of an action with several poses: where the robot is on the way. Pure, from messages.

Source: FollowWaypoints and NavigateThroughPoses of nav2_msgs, from Humble on. FollowWaypoints names the
poses that it missed in its result only: until then a pose behind the robot is passed, not reached.
"""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import islice
from typing import Any, Final, Literal, NamedTuple

from app.panel.widgets.tour import INDEX, LEFT, WAY
from app.ros.messages import Fields

WaypointState = Literal["planned", "to_come", "current", "passed", "reached", "missed", "left"]

MAX_WAYPOINTS: Final = 200  # that are shown of a goal
MAX_MISSED: Final = 2_000
SUCCEEDED: Final = 4  # action_msgs/msg/GoalStatus
SKIPPED, FAILED = 2, 3  # nav2_msgs/msg/WaypointStatus


class Waypoint(NamedTuple):
    """A pose in metres and radians in `frame`; `yaw` is None if it is not known."""

    x: float
    y: float
    yaw: float | None
    frame: str


@dataclass(slots=True)
class WaypointGoal:
    """A goal that an action has or had. `command` is the id of the one that sent it, "" of another
    program's. `poses` are the first of `total`, None if they are not known. `current` is the index of
    the pose that the robot drives to, None before it is known; `way_m` what is left to drive. The
    newest feedback arrived `at` (monotonic seconds). `end` is its last state, 0 while it runs, 7 where
    that is not known, since `ended_at`; `missed` has the error codes of missed poses, by their indices,
    0 without one."""

    id: bytes
    command: str
    poses: tuple[Waypoint, ...] | None
    total: int
    at: float
    current: int | None = None
    way_m: float | None = None
    end: int = 0
    ended_at: float = math.inf
    missed: Mapping[int, int] = field(default_factory=dict)

    def apply_feedback(self, message: Fields, prefix: str, at: float) -> None:
        """Takes the fields of a feedback. A count of 0 that is left comes before the first pose is
        known, and says nothing."""
        self.at = at
        index, left, way = (message.get(prefix + name) for name in (INDEX, LEFT, WAY))
        if index is not None:
            self.current = int(index)
        elif left is not None and left > 0 and self.poses is not None:
            self.current = max(0, self.total - int(left))
        self.way_m = float(way) if way is not None and math.isfinite(way) else None

    def finish(self, state: int, missed: Mapping[int, int], now: float) -> None:
        """It has ended in a state of action_msgs/msg/GoalStatus."""
        known = {index: error for index, error in missed.items() if index < self.total}
        self.end, self.ended_at, self.missed, self.way_m = state, now, known, None

    @property
    def is_good(self) -> bool:
        """Whether it has ended, and reached all."""
        return self.end == SUCCEEDED and not self.missed

    def state(self, index: int) -> WaypointState:
        """What is known of a pose."""
        if index in self.missed:
            return "missed"
        if self.end == SUCCEEDED:
            return "reached"
        behind = self.current is not None and index < self.current
        if behind:
            return "passed"
        if self.end:
            return "left"
        return "current" if index == self.current else "to_come"


def poses_of(goal: Mapping[str, Any]) -> tuple[tuple[Waypoint, ...], int] | None:
    """The poses of a goal that is to be sent, and how many there are; None for a goal without a list.
    Since Kilted they are in a message with a header."""
    listed = goal.get("poses")
    if isinstance(listed, Mapping):
        listed = listed.get("goals", listed.get("poses"))
    if not isinstance(listed, Sequence) or isinstance(listed, str | bytes):
        return None
    return tuple(_waypoint(each) for each in listed[:MAX_WAYPOINTS]), len(listed)


def _waypoint(stamped: Any) -> Waypoint:
    """Fields that a message leaves out are 0, as in ROS 2."""
    header, pose = (_table(stamped, name) for name in ("header", "pose"))
    position, turn = _table(pose, "position"), _table(pose, "orientation")
    x, y, z = (float(turn.get(name, 0)) for name in "xyz")
    w = float(turn.get("w", 1))
    yaw = math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    frame = str(header.get("frame_id", ""))
    return Waypoint(float(position.get("x", 0)), float(position.get("y", 0)), yaw, frame)


def _table(fields: Any, name: str) -> Mapping[str, Any]:
    inner = fields.get(name, {}) if isinstance(fields, Mapping) else {}
    return inner if isinstance(inner, Mapping) else {}


def waypoints_at(points: Iterable[float], frame: str) -> tuple[Waypoint, ...]:
    """Those of a published path, of which only the places are known: x, y, x, y … in metres."""
    parts = iter(points)
    pairs = islice(zip(parts, parts, strict=True), MAX_WAYPOINTS)
    return tuple(Waypoint(x, y, None, frame) for x, y in pairs)


def missed_of(result: Any) -> dict[int, int]:
    """The indices of the poses that a result calls missed, with their error codes, 0 without one. As
    numbers in Humble, as MissedWaypoint from Iron on, as WaypointStatus since Kilted."""
    missed: dict[int, int] = {}
    for each in list(getattr(result, "missed_waypoints", ()))[:MAX_MISSED]:
        index = getattr(each, "waypoint_index", getattr(each, "index", each))
        missed[int(index)] = int(getattr(each, "error_code", 0))
    for each in list(getattr(result, "waypoint_statuses", ()))[:MAX_MISSED]:
        if each.waypoint_status in (SKIPPED, FAILED):
            missed[int(each.waypoint_index)] = int(each.error_code)
    return missed
