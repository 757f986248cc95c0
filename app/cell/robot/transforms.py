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

from app.ros.cdr.stamped import TRANSFORMS_TYPE, StampedTransform, read_transforms
from app.system.limits import BoundedDict
from app.system.texts import TextLike, say

TF_TYPE: Final = TRANSFORMS_TYPE
TF, TF_STATIC = "/tf", "/tf_static"
MAX_FRAMES: Final = 500
MAX_FRAME_NAME: Final = 200  # characters
KEPT: Final = 100  # transforms of a frame: two seconds or more
KEPT_S: Final = 10.0
STEP_S: Final = 0.02  # between two that are kept: the newest takes the place of one before it
PROBLEM_S: Final = 5.0  # a frame that had two parents since then may have them still
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
    return _rotation((quaternion.x, quaternion.y, quaternion.z, quaternion.w))


def _rotation(numbers: tuple[float, ...]) -> Quaternion | None:
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

    def pose(self) -> Pose:
        """The same in the plane."""
        return Pose(self.place[0], self.place[1], self.turned.yaw())

    def is_finite(self) -> bool:
        return all(map(math.isfinite, (*self.place, *self.turned)))


IDENTITY: Final = Transform((0.0, 0.0, 0.0), Quaternion(0.0, 0.0, 0.0, 1.0))


@dataclass(slots=True)
class _Frame:
    """A frame's transforms to its parent, the oldest first. `at` is when the newest arrived (monotonic
    seconds), `static` the one of `/tf_static`."""

    parent: str
    is_cut: bool = False  # it is from before the link was lost
    has_restarted: bool = False  # the robot's time went back: its stamps are of before
    static: Transform | None = None
    at: float = -math.inf
    stamps: deque[float] = field(default_factory=lambda: deque(maxlen=KEPT))
    transforms: deque[Transform] = field(default_factory=lambda: deque(maxlen=KEPT))

    def add(self, stamp: float, transform: Transform, at: float) -> None:
        """Takes one with a newer stamp: a robot whose stamps do not go on gets old."""
        # Further back, a recording or a simulation has begun again.
        if self.stamps and (self.has_restarted or stamp < self.stamps[-1] - BACK_S):
            self.stamps.clear()
            self.transforms.clear()
        self.has_restarted = False
        if not self.stamps or stamp > self.stamps[-1]:
            if len(self.stamps) > 1 and stamp - self.stamps[-2] < STEP_S:
                self.stamps.pop()
                self.transforms.pop()
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

    transform: Transform
    at: float
    stamp: float | None
    is_cut: bool = False

    @property
    def pose(self) -> Pose:
        return self.transform.pose()


class TransformTree:
    """The frames of one robot, bounded in number and time. Used on the event loop only."""

    def __init__(self) -> None:
        self._frames: dict[str, _Frame] = {}
        self._cut_at = math.inf
        self._newest_at = -math.inf  # when the newest transform arrived
        self.is_full = False  # more frames came than have room
        # By the child's name: what is wrong with its transforms, and when the newest such came.
        self._problems = BoundedDict[str, tuple[TextLike, float]](MAX_FRAMES)

    def __len__(self) -> int:
        return len(self._frames)

    def record(self, message: Any, at: float, *, is_static: bool) -> None:
        """A decoded `tf2_msgs/msg/TFMessage` that arrived at `at` (monotonic seconds)."""
        for each in message.transforms:
            stamp, way = each.header.stamp, each.transform
            transform = StampedTransform(
                each.header.frame_id,
                each.child_frame_id,
                stamp.sec + stamp.nanosec / 1e9,
                (way.translation.x, way.translation.y, way.translation.z),
                (way.rotation.x, way.rotation.y, way.rotation.z, way.rotation.w),
            )
            self._record(transform, at, is_static)

    def record_bytes(self, payload: bytes, at: float, *, is_static: bool) -> None:
        """The same of its bytes; DecodeError if they are no such message."""
        for transform in read_transforms(payload):
            self._record(transform, at, is_static)

    def cut(self, at: float) -> None:
        """The link was lost at `at` (monotonic seconds): what was known is where the robot was."""
        self._cut_at = at
        for frame in self._frames.values():
            frame.is_cut = True
        self.is_full = False
        self._problems.clear()

    def restart(self) -> None:
        """The robot's time went back: the next transforms that move count, whatever their stamps."""
        for frame in self._frames.values():
            frame.has_restarted = True

    def locate(self, base: str, fixed: str, wanted: float | None = None) -> LocatedFrame | TextLike:
        """Where the frame `base` is in the frame `fixed`, at the newest common time, or at the robot's
        time `wanted` if that is before it; or why that is not known."""
        ups, downs = self._chain(base), self._chain(fixed)
        common = next((name for name in ups if name in downs), None)
        if common is None:
            return self._missing(base, fixed, ups, downs)
        path = [*_until(ups, common), *_until(downs, common)]
        cut = [name for name in path if self._frames[name].is_cut]
        for name in path:  # two senders that disagree: which is right is not known
            problem, at = self._problems.get(name, ("", -math.inf))
            if at > self._newest_at - PROBLEM_S:
                return problem
        if 0 < len(cut) < len(path):  # the others are of another run of the robot
            return say("transform_unknown", base=base, fixed=fixed, name=cut[0])
        moving = [frame for frame in (self._frames[name] for name in path) if frame.static is None]
        newest = min((frame.stamps[-1] for frame in moving), default=math.inf)
        stamp = newest if wanted is None else min(newest, wanted)
        up, down = IDENTITY, IDENTITY
        for name in _until(ups, common):
            up = self._frames[name].at_stamp(stamp).then(up)
        for name in _until(downs, common):
            down = self._frames[name].at_stamp(stamp).then(down)
        transform = down.inverse().then(up)
        if not transform.is_finite():
            return say("transform_not_finite", base=base, fixed=fixed)
        at = min((frame.at for frame in moving), default=math.inf)
        known = stamp if moving else None
        return LocatedFrame(transform, min(at, self._cut_at) if cut else at, known, bool(cut))

    def _record(self, received: StampedTransform, at: float, is_static: bool) -> None:
        parent, child = _name(received.parent), _name(received.child)
        self._newest_at = at
        turned = _rotation(received.turned)
        if not parent or not child or parent == child:
            self._problems[child] = say("transform_no_frame", child=child, parent=parent), at
            return
        if turned is None or not all(map(math.isfinite, received.place)):
            self._problems[child] = say("transform_no_rotation", child=child, parent=parent), at
            return
        frame = self._frames.get(child)
        if frame is not None and frame.is_cut:
            frame = None
        if frame is not None and frame.parent != parent:
            two = say("transform_two_parents", child=child, first=frame.parent, second=parent)
            self._problems[child] = two, at
            frame = self._frames[child] = _Frame(parent)
        elif child in self._problems and at > self._problems[child][1] + PROBLEM_S:
            del self._problems[child]
        if frame is None:
            if len(self._frames) >= MAX_FRAMES:
                self._frames = {name: f for name, f in self._frames.items() if not f.is_cut}
            if len(self._frames) >= MAX_FRAMES:
                self.is_full = True
                return
            frame = self._frames[child] = _Frame(parent)
        transform = Transform(received.place, turned)
        if is_static:
            frame.static, frame.at = transform, at
        else:
            frame.static = None
            frame.add(received.stamp, transform, at)

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
        for name in (*ups, *downs):  # what ends the way, not what is wrong elsewhere
            if name in self._problems:
                return self._problems[name][0]
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
