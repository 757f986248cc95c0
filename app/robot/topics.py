"""The latest message of a topic, with the fields that the panel names.

The newest message counts. A message that takes longer to decode than a turn of the event loop allows is
continued in the next turns. Until the newest is decoded, the topic's value is unknown.
"""

import math
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from app.errors import DecodeError
from app.interfaces import FieldReader, Fields, Walk
from app.robot.sample import Sample
from app.robot.slices import Slices

MAX_UNREAD: Final = (
    16  # undecoded messages of a lossless topic; of other topics only the newest is kept
)


@dataclass(frozen=True, slots=True)
class Reading:
    """The latest message of a topic.

    `status`: no message yet ("waiting"); received before a cut ("cut"); not decodable ("unreadable");
    being decoded, with the fields of the one before ("reading"); a valid message ("message"). `at` is
    in monotonic seconds, `wall` in seconds since the epoch.
    """

    status: Literal["waiting", "cut", "unreadable", "reading", "message"]
    fields: Fields | None = None
    at: float = -math.inf
    wall: float = 0.0

    def value(self, path: str) -> Any:
        """The field at a path; None if the message has no such element."""
        return None if self.fields is None else self.fields.get(path)

    def is_ambiguous(self, path: str) -> bool:
        """Whether the value is unknown because several elements have the path's key."""
        return self.fields is not None and self.fields.is_ambiguous(path)


WAITING: Final = Reading("waiting")


class Topic:
    """One topic of a robot."""

    def __init__(
        self,
        reader: FieldReader,
        slices: Slices,
        *,
        lossless: bool,
        on_unreadable: Callable[[Sample, DecodeError], None],
        on_late_reading: Callable[[Reading], None],
    ) -> None:
        """Of a `lossless` topic each message counts. `on_late_reading` takes a reading that needed more
        than one turn; `on_unreadable` a sample that can't be decoded."""
        self._reader = reader
        self._slices = slices
        self._on_unreadable = on_unreadable
        self._on_late_reading = on_late_reading
        self._lossless = lossless
        self._unread: deque[Sample] = deque(maxlen=MAX_UNREAD)
        self._walk: _PendingRead | None = None  # before the unread
        self._deferred = False
        self._last_reading = WAITING
        self.sample: Sample | None = None  # the newest
        self.cuts = 0  # how often the value before was no longer valid

    def update(self, sample: Sample) -> None:
        """Adds a newer message."""
        self.sample = sample
        if self._walk is None or not self._lossless:
            self._unread.clear()
        self._unread.append(sample)

    def reading(self) -> Reading:
        """The current reading."""
        if self._walk is None and not self._unread:
            return self._last_reading
        if not self._deferred and not self._read():
            self._deferred = True
            self._slices.schedule(self._resume)
        if self._walk is None and not self._unread:
            return self._last_reading
        return replace(self._last_reading, status="reading")

    def invalidate(self) -> None:
        """The last value is no longer valid."""
        if self.sample is not None:
            self.cuts += 1
            self._last_reading = replace(self.reading(), status="cut")
            self._unread.clear()
            self._walk = None

    def _read(self) -> bool:
        """Decodes as much as this turn allows; returns whether that was all."""
        while (walked := self._next_read()) is not None:
            reading = self._read_one(walked, lambda: self._slices.read(walked.walk, walked.size))
            if reading is None:
                return False
        return True

    def _resume(self, until: float) -> bool:
        """The same in a later turn; reports the reading if it is complete."""
        walked = self._next_read()
        if walked is not None:
            reading = self._read_one(walked, lambda: self._slices.read_until(walked.walk, until))
            self._deferred = self._next_read() is not None
            if reading is not None:
                self._on_late_reading(reading)
        else:
            self._deferred = False
        return not self._deferred

    def _next_read(self) -> "_PendingRead | None":
        """The message to be decoded now; None without one."""
        if self._walk is None and self._unread:
            sample = self._unread.popleft()
            data = bytes(sample.payload)
            self._walk = _PendingRead(sample, self._reader.walk(data), len(data))
        return self._walk

    def _read_one(self, walked: "_PendingRead", read: Callable[[], Fields | None]) -> Reading | None:
        """The message's reading, kept as the last one; None if it is not complete."""
        sample = walked.sample
        try:
            fields = read()
        except DecodeError as error:
            self._on_unreadable(sample, error)
            self._last_reading = Reading("unreadable", None, sample.at, sample.wall)
        else:
            if fields is None:
                return None
            self._last_reading = Reading("message", fields, sample.at, sample.wall)
        self._walk = None
        return self._last_reading


@dataclass(frozen=True, slots=True)
class _PendingRead:
    """A message that is being decoded; `size` in bytes."""

    sample: Sample
    walk: Walk
    size: int
