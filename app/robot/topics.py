"""The latest message of a topic, with the fields that the panel names.

The newest message counts. A message that takes longer to decode than a turn of the event loop allows is
continued in the next turns. Until the newest is decoded, the topic's value is unknown.
"""

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

from app.bounded import BoundedQueue
from app.errors import DecodeError
from app.interfaces import Absence, FieldReader, Fields, Walk
from app.robot.keyed_values import NO_VALUES, KeyedValues, updated, without_source
from app.robot.sample import Sample
from app.robot.slices import SMALL_BYTES, Slices
from app.robot.value_times import NO_TIMES, ValueTimes

# Undecoded messages of a lossless topic; of other topics only the newest is kept.
MAX_UNREAD: Final = 16
# Of a topic with fields that have keys.
MAX_UNREAD_PARTS: Final = 256
MAX_UNREAD_BYTES: Final = 32_000_000


@dataclass(frozen=True, slots=True)
class Reading:
    """The latest message of a topic.

    `status`: no message yet ("waiting"); received before a cut ("cut"); not decodable ("unreadable");
    being decoded, with the fields of the one before ("reading"); of a Zenoh session that is none of the
    robot's ("foreign"); a valid message ("message"). `at` is in monotonic seconds, `wall` in seconds
    since the epoch. `keyed` are the newest values of fields with keys, over several messages. `since`
    has the wall time of the last change of timed fields.
    """

    status: Literal["waiting", "cut", "unreadable", "reading", "foreign", "message"]
    fields: Fields | None = None
    at: float = -math.inf
    wall: float = 0.0
    keyed: KeyedValues = field(default_factory=lambda: NO_VALUES)
    since: Mapping[str, float] = field(default_factory=lambda: NO_TIMES)

    def of_field(self, path: str, kept_s: float) -> "Reading":
        """The reading with the times of a field; one with a key has its own, see `keyed_values`.
        `kept_s` is how long newer messages may lack it."""
        known = self.keyed.get(path)
        if known is None:
            return self
        if self.at - known.at > kept_s:
            return replace(self, keyed=NO_VALUES)
        return replace(self, at=known.at, wall=known.wall)

    def value(self, path: str) -> Any:
        """The field at a path; None if the message has no such element."""
        if (known := self.keyed.get(path)) is not None:
            return known.value
        return None if self.fields is None else self.fields.get(path)

    def absence(self, path: str) -> Absence | None:
        """Why a function of fields has no value, if one has none."""
        return None if self.fields is None else self.fields.absence(path)

    def is_ambiguous(self, path: str) -> bool:
        """Whether the value is unknown because several elements have the path's key."""
        if (known := self.keyed.get(path)) is not None:
            return known.is_ambiguous
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
        keyed: Collection[str] = (),
        timed: Collection[str] = (),
    ) -> None:
        """Of a `lossless` topic each message counts, and of one with the paths `keyed` each message
        that has arrived. The changes of the fields `timed` are timed. `on_late_reading` takes a reading
        that needed more than one turn; `on_unreadable` a sample that can't be decoded."""
        self._reader = reader
        self._slices = slices
        self._on_unreadable = on_unreadable
        self._on_late_reading = on_late_reading
        self._lossless = lossless
        self._keyed = keyed
        self._values = NO_VALUES
        self._times = ValueTimes(timed)
        most = MAX_UNREAD_PARTS if keyed else MAX_UNREAD
        self._unread: BoundedQueue[Sample] = BoundedQueue(most, MAX_UNREAD_BYTES)
        self._walk: _PendingRead | None = None  # before the unread
        self._deferred = False
        self._last_reading = WAITING
        self.sample: Sample | None = None  # the newest
        self.cuts = 0  # how often the value before was no longer valid

    @property
    def is_keyed(self) -> bool:
        """Whether fields with keys are read."""
        return bool(self._keyed)

    def update(self, sample: Sample) -> None:
        """Adds a newer message."""
        self.sample = sample
        if not self._keyed and (self._walk is None or not self._lossless):
            self._unread.clear()
        self._unread.add(sample, len(sample.payload))

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
            self._values = NO_VALUES
            self._times.clear()

    def forget_source(self, source: str) -> None:
        """A peer was lost: values of fields with keys that came from it are no longer valid."""
        if self._values:
            self._values = without_source(self._values, source)
            self._last_reading = replace(self._last_reading, keyed=self._values)

    def drop(self) -> None:
        """No message counts that was received so far."""
        if self.sample is not None:
            self.cuts += 1
            self.sample, self._walk, self._last_reading = None, None, WAITING
            self._unread.clear()
            self._values = NO_VALUES
            self._times.clear()

    def _read(self) -> bool:
        """Decodes as much as this turn allows; returns whether that was all."""
        self._skip_parts()
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

    def _skip_parts(self) -> None:
        """Passes over messages before the newest, if that has every element: there is one publisher."""
        if not self._keyed or self._lossless or self._walk is not None or len(self._unread) < 2:
            return
        newest = self._unread[-1]
        if len(newest.payload) > SMALL_BYTES:
            return
        try:
            fields = self._reader.read(bytes(newest.payload), newest.wall)
        except DecodeError:
            return
        if all(fields.get(path) is not None for path in self._keyed):
            self._unread.clear()
            self._unread.add(newest, len(newest.payload))

    def _next_read(self) -> "_PendingRead | None":
        """The message to be decoded now; None without one."""
        if self._walk is None and self._unread:
            sample = self._unread.take()
            data = bytes(sample.payload)
            self._walk = _PendingRead(sample, self._reader.walk(data, sample.wall), len(data))
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
            if self._keyed:
                self._values = updated(self._values, self._keyed, fields, sample)
            since = self._times.update(fields, sample.wall)
            self._last_reading = Reading("message", fields, sample.at, sample.wall, self._values, since)
        self._walk = None
        return self._last_reading


@dataclass(frozen=True, slots=True)
class _PendingRead:
    """A message that is being decoded; `size` in bytes."""

    sample: Sample
    walk: Walk[Fields]
    size: int
