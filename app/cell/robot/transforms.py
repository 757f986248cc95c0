"""The transforms of a robot, from `/tf` and `/tf_static`: pure, with the time of each message.

A frame has one parent. The pose of one frame in another is looked up at the newest time at which all
transforms between them are known, and interpolated there. What is missing is named.
"""

import math
from bisect import bisect_right
from collections import deque
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from app.system.texts import TextLike, say

TF_TYPE: Final = "tf2_msgs/msg/TFMessage"
TF, TF_STATIC = "/tf", "/tf_static"
MAX_FRAMES: Final = 500
MAX_FRAME_NAME: Final = 200  # characters
KEPT: Final = 100  # transforms of a frame: two seconds at 50 Hz
KEPT_S: Final = 10.0
BACK_S: Final = 5.0  # a stamp so far before the newest is of a clock that began again


class Pose(NamedTuple):
    """In the plane: metres, and radians from -pi to pi."""

    x: float
    y: float
    yaw: float


class Quaternion(NamedTuple):
    x: float
    y: float
    z: float
    w: float

    def times(self, other: "Quaternion") -> "Quaternion":
        ax, ay, az, aw = self
        bx, by, bz, bw = other
        return Quaternion(
            aw * bx + ax * bw + ay * bz - az * by,
            aw * by - ax * bz + ay * bw + az * bx,
            aw * bz + ax * by - ay * bx + az * bw,
            aw * bw - ax * bx - ay * by - az * bz,
        )

    def inverse(self) -> "Quaternion":
        return Quaternion(-self.x, -self.y, -self.z, self.w)

    def rotated(self, vector: tuple[float, float, float]) -> tuple[float, float, float]:
        x, y, z, _ = self.times(Quaternion(*vector, 0.0)).times(self.inverse())
        return x, y, z

    def yaw(self) -> float:
        x, y, z, w = self
        return math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))


def rotation(quaternion: Any) -> Quaternion | None:
    """A rotation of unit length from a `geometry_msgs/msg/Quaternion`; None if it is none."""
    numbers = (quaternion.x, quaternion.y, quaternion.z, quaternion.w)
    length = math.hypot(*numbers)
    if not (math.isfinite(length) and length > 1e-6):
        return None
    return Quaternion(*(part / length for part in numbers))


def yaw_of(quaternion: Any) -> float | None:
    """The heading of a `geometry_msgs/msg/Quaternion` in radians; None if it is no rotation."""
    turned = rotation(quaternion)
    return None if turned is None else turned.yaw()


class Transform(NamedTuple):
    """Where a frame is in its parent: metres, and a rotation."""

    place: tuple[float, float, float]
    turned: Quaternion

    def then(self, child: "Transform") -> "Transform":
        """Where the child's child is in this one's parent."""
        moved = self.turned.rotated(child.place)
        place = tuple(mine + its for mine, its in zip(self.place, moved, strict=True))
        return Transform((place[0], place[1], place[2]), self.turned.times(child.turned))

    def inverse(self) -> "Transform":
        back = self.turned.inverse()
        x, y, z = back.rotated(self.place)
        return Transform((-x, -y, -z), back)


IDENTITY: Final = Transform((0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))


@dataclass(slots=True)
class _Frame:
    """A frame's transforms to its parent, the oldest first. `at` is when the newest arrived (monotonic
    seconds), `static` the one of `/tf_static`."""

    parent: str
    is_cut: bool = False  # it is from before the link was lost
    static: Transform | None = None
    at: float = -math.inf
    stamps: deque[float] = field(default_factory=lambda: deque(maxlen=KEPT))
    transforms: deque[Transform] = field(default_factory=lambda: deque(maxlen=KEPT))

    def add(self, stamp: float, transform: Transform, at: float) -> None:
        """Takes one with a newer stamp: a robot whose stamps do not go on gets old."""
        if self.stamps and (
            stamp < self.stamps[-1] - BACK_S
        ):  # a recording or a simulation began again
            self.stamps.clear()
            self.transforms.clear()
        if not self.stamps or stamp > self.stamps[-1]:
            self.stamps.append(stamp)
            self.transforms.append(transform)
            self.at = at
        while self.stamps[-1] - self.stamps[0] > KEPT_S:
            self.stamps.popleft()
            self.transforms.popleft()

    def at_stamp(self, stamp: float) -> Transform:
        """At a time that is not after the newest."""
        if self.static is not None:
            return self.static
        after = bisect_right(self.stamps, stamp)
        if after == 0 or self.stamps[after - 1] == stamp:
            return self.transforms[max(after - 1, 0)]
        if after == len(self.stamps):
            return self.transforms[-1]
        before_s, after_s = self.stamps[after - 1], self.stamps[after]
        part = (stamp - before_s) / (after_s - before_s)
        return _between(self.transforms[after - 1], self.transforms[after], part)


def _between(first: Transform, second: Transform, part: float) -> Transform:
    place = tuple(a + part * (b - a) for a, b in zip(first.place, second.place, strict=True))
    sign = 1.0 if sum(a * b for a, b in zip(first.turned, second.turned, strict=True)) >= 0 else -1.0
    mixed = [a + part * (sign * b - a) for a, b in zip(first.turned, second.turned, strict=True)]
    length = math.hypot(*mixed) or 1.0
    return Transform((place[0], place[1], place[2]), Quaternion(*(part / length for part in mixed)))


@dataclass(frozen=True, slots=True)
class LocatedFrame:
    """`at` (monotonic seconds) is when the oldest of the transforms that move arrived, inf if none
    moves; `stamp` is the robot's time of them, None if none moves. `is_cut`: they are from before the
    link was lost, at `at` at the latest."""

    pose: Pose
    at: float
    stamp: float | None
    is_cut: bool = False


class TransformTree:
    """The frames of one robot, bounded in number and time. Used on the event loop only."""

    def __init__(self) -> None:
        self._frames: dict[str, _Frame] = {}
        self._cut_at = math.inf
        self.is_full = False  # more frames came than have room
        self.problem: TextLike = ""  # the newest of a transform: two parents, or no rotation

    def __len__(self) -> int:
        return len(self._frames)

    def record(self, message: Any, at: float, *, is_static: bool) -> None:
        """A `tf2_msgs/msg/TFMessage` that arrived at `at` (monotonic seconds)."""
        for transform in message.transforms:
            self._record(transform, at, is_static)

    def cut(self, at: float) -> None:
        """The link was lost at `at` (monotonic seconds): what was known is where the robot was."""
        self._cut_at = at
        for frame in self._frames.values():
            frame.is_cut = True
        self.is_full, self.problem = False, ""

    def locate(self, base: str, fixed: str) -> LocatedFrame | TextLike:
        """Where the frame `base` is in the frame `fixed`, at the newest common time; or why that is not
        known."""
        ups, downs = self._chain(base), self._chain(fixed)
        common = next((name for name in ups if name in downs), None)
        if common is None:
            return self._missing(base, fixed, ups, downs)
        path = [*_until(ups, common), *_until(downs, common)]
        cut = [name for name in path if self._frames[name].is_cut]
        if 0 < len(cut) < len(path):  # the others are of another run of the robot
            return say("transform_unknown", base=base, fixed=fixed, name=cut[0])
        moving = [frame for frame in (self._frames[name] for name in path) if frame.static is None]
        stamp = min((frame.stamps[-1] for frame in moving), default=math.inf)
        up, down = IDENTITY, IDENTITY
        for name in _until(ups, common):
            up = self._frames[name].at_stamp(stamp).then(up)
        for name in _until(downs, common):
            down = self._frames[name].at_stamp(stamp).then(down)
        place, turned = down.inverse().then(up)
        pose = Pose(place[0], place[1], turned.yaw())
        if not all(map(math.isfinite, pose)):
            return say("transform_not_finite", base=base, fixed=fixed)
        at = min((frame.at for frame in moving), default=math.inf)
        known = stamp if moving else None
        return LocatedFrame(pose, min(at, self._cut_at) if cut else at, known, bool(cut))

    def _record(self, message: Any, at: float, is_static: bool) -> None:
        parent, child = (_name(name) for name in (message.header.frame_id, message.child_frame_id))
        turned = rotation(message.transform.rotation)
        moved = message.transform.translation
        place = (moved.x, moved.y, moved.z)
        if not parent or not child or parent == child:
            self.problem = say("transform_no_frame", child=child, parent=parent)
            return
        if turned is None or not all(map(math.isfinite, place)):
            self.problem = say("transform_no_rotation", child=child, parent=parent)
            return
        frame = self._frames.get(child)
        if frame is not None and frame.is_cut:
            frame = None
        if frame is None:
            if len(self._frames) >= MAX_FRAMES:
                self._frames = {name: f for name, f in self._frames.items() if not f.is_cut}
            if len(self._frames) >= MAX_FRAMES:
                self.is_full = True
                return
            frame = self._frames[child] = _Frame(parent)
        elif frame.parent != parent:
            self.problem = say("transform_two_parents", child=child, first=frame.parent, second=parent)
            frame = self._frames[child] = _Frame(parent)
        if is_static:
            frame.static, frame.at = Transform(place, turned), at
        else:
            stamp = message.header.stamp
            frame.static = None
            frame.add(stamp.sec + stamp.nanosec / 1e9, Transform(place, turned), at)

    def _chain(self, name: str) -> Mapping[str, None]:
        """The frame and those above it, up to the root; a loop ends it."""
        chain: dict[str, None] = {}
        while name not in chain:
            chain[name] = None
            frame = self._frames.get(name)
            if frame is None:
                break
            name = frame.parent
        return chain

    def _missing(
        self, base: str, fixed: str, ups: Mapping[str, None], downs: Mapping[str, None]
    ) -> TextLike:
        """Names the frame at which the way ends."""
        known = {frame.parent for frame in self._frames.values()} | self._frames.keys()
        if self.is_full:
            return say("transforms_full", most=MAX_FRAMES)
        if self.problem:
            return self.problem
        for name in (base, fixed):
            if name not in known:
                return say("transform_unknown", base=base, fixed=fixed, name=name)
        top, other = [*ups][-1], [*downs][-1]
        if self._frames.get(top) is not None:
            return say("transform_loop", name=top)
        return say("transform_unconnected", base=base, fixed=fixed, first=top, second=other)


def _until(chain: Mapping[str, None], end: str) -> Iterator[str]:
    for name in chain:
        if name == end:
            return
        yield name


def _name(frame: str) -> str:
    """Old nodes write a slash before it."""
    return frame.lstrip("/")[:MAX_FRAME_NAME]
