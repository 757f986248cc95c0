"""Stamps, and messages with many stamped parts, read from their bytes: without an object for each part,
which costs more than the part is worth."""

import math
from array import array
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from struct import Struct
from typing import Final, NamedTuple

from app.ros.cdr.reader import ByteOrder, check_end, split_header
from app.ros.messages.definitions import Structure
from app.ros.messages.field_path import TIME
from app.system.errors import DecodeError

TRANSFORMS_TYPE: Final = "tf2_msgs/msg/TFMessage"
PATH_TYPE: Final = "nav_msgs/msg/Path"
_COUNT_BYTES: Final = 4
_STAMP_BYTES: Final = 8
_NUMBERS_BYTES: Final = 56  # place and rotation
_LEAST_POSE: Final = _STAMP_BYTES + _COUNT_BYTES + 1 + _NUMBERS_BYTES
# A count, a stamp, a place with a rotation, and a place in the plane.
_ORDERS: Final[tuple[ByteOrder, ...]] = ("<", ">")
_FORMS: Final[Mapping[ByteOrder, tuple[Struct, Struct, Struct, Struct]]] = {
    order: (Struct(f"{order}I"), Struct(f"{order}iI"), Struct(f"{order}7d"), Struct(f"{order}2d"))
    for order in _ORDERS
}


# The stamp of a message that begins with it: CDR's four bytes of encapsulation, of which the second one
# names the byte order, then `sec` and `nanosec` of builtin_interfaces/msg/Time.
_FIRST: Final = (Struct(">4xiI"), Struct("<4xiI"))
HEADER: Final = "std_msgs/msg/Header"
NS_PER_S: Final = 10**9


def begins_with_stamp(type_name: str, structures: Mapping[str, Structure]) -> bool:
    """Whether messages of a type begin with a stamp: with a `std_msgs/Header`, or a time."""
    structure = structures.get(type_name)
    first = structure.fields[0].type if structure is not None and structure.fields else None
    return first is not None and str(first) in (HEADER, TIME)


def first_stamp_ns(data: bytes) -> int | None:
    """The stamp in nanoseconds with which a message begins; None for bytes that have none."""
    if len(data) < _FIRST[0].size:
        return None
    seconds, nanoseconds = _FIRST[data[1] & 1].unpack_from(data)
    return int(seconds * NS_PER_S + nanoseconds) if nanoseconds < NS_PER_S else None


def first_stamp(data: bytes) -> float | None:
    """The same in seconds; None for one that is not set, too."""
    ns = first_stamp_ns(data)
    return ns / NS_PER_S if ns else None


class StampedTransform(NamedTuple):
    """A `geometry_msgs/msg/TransformStamped`: `stamp` in seconds, `place` in metres, `turned` as x, y,
    z, w of its quaternion."""

    parent: str
    child: str
    stamp: float
    place: tuple[float, float, float]
    turned: tuple[float, float, float, float]


class StampedPath(NamedTuple):
    """A `nav_msgs/msg/Path`: `stamp` in seconds, `points` as x, y, x, y … in metres, thinned, of
    `total` poses."""

    frame: str
    stamp: float
    points: "array[float]"
    total: int


class _Parts:
    """Reads one message from its beginning on. Whatever the bytes are, nothing beyond them is read."""

    def __init__(self, payload: bytes) -> None:
        self.body, order = split_header(payload)
        self._count, self._stamp, self._numbers, self._plane = _FORMS[order]
        self.at = 0

    def count(self) -> int:
        at = self.at + -self.at % _COUNT_BYTES
        self.at = at + _COUNT_BYTES
        count: int = self._count.unpack_from(self.body, at)[0]
        return count

    def stamp(self) -> float:
        at = self.at + -self.at % _COUNT_BYTES
        self.at = at + _STAMP_BYTES
        sec, nanosec = self._stamp.unpack_from(self.body, at)
        return float(sec + nanosec / 1e9)

    def text(self) -> str:
        start, end = self._text()
        return str(self.body[start : end - 1], "utf-8")

    def skip_text(self) -> None:
        self._text()

    def _text(self) -> tuple[int, int]:
        size = self.count()
        start, end = self.at, self.at + size
        if not size or end > len(self.body) or self.body[end - 1]:
            raise ValueError(f"a text of {size} bytes at {start} is cut off or has no end")
        self.at = end
        return start, end

    def numbers(self) -> tuple[float, ...]:
        at = self.at + -self.at % 8
        self.at = at + _NUMBERS_BYTES
        return self._numbers.unpack_from(self.body, at)

    def plane(self) -> tuple[float, float]:
        """x and y of a place; the rest of its pose is skipped."""
        at = self.at + -self.at % 8
        self.at = at + _NUMBERS_BYTES
        x, y = self._plane.unpack_from(self.body, at)
        return x, y


def read_transforms(payload: bytes) -> list[StampedTransform]:
    """Those of a `tf2_msgs/msg/TFMessage`; DecodeError if the bytes are none."""
    with _decoding(TRANSFORMS_TYPE, payload):
        parts = _Parts(payload)
        transforms = []
        for _ in range(parts.count()):
            stamp, parent, child = parts.stamp(), parts.text(), parts.text()
            x, y, z, *turned = parts.numbers()
            rotation = (turned[0], turned[1], turned[2], turned[3])
            transforms.append(StampedTransform(parent, child, stamp, (x, y, z), rotation))
        check_end(parts.body, parts.at)
    return transforms


def read_path(payload: bytes, most: int) -> StampedPath:
    """A path with at most about `most` points: every so many-th, and the last. DecodeError if the bytes
    are none."""
    with _decoding(PATH_TYPE, payload):
        parts = _Parts(payload)
        stamp, frame, total = parts.stamp(), parts.text(), parts.count()
        if total * _LEAST_POSE > len(parts.body):
            raise ValueError(f"{total} poses are more than there are")
        every = max(1, math.ceil(total / most))
        points = array("d")
        for number in range(total):
            parts.at += -parts.at % _COUNT_BYTES + _STAMP_BYTES
            parts.skip_text()
            place = parts.plane()
            if number % every == 0 or number == total - 1:
                points.extend(place)
        check_end(parts.body, parts.at)
    return StampedPath(frame, stamp, points, total)


@contextmanager
def _decoding(type_name: str, payload: bytes) -> Iterator[None]:
    try:
        yield
    except Exception as error:  # no received bytes may stop the panel
        raise DecodeError(f"{len(payload)} bytes are not a {type_name}: {error}") from error
