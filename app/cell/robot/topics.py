"""The latest message of a topic, with the fields that the panel names.

The newest message counts. A message that takes longer to decode than a turn of the event loop allows is
continued in the next turns. Until the newest is decoded, the topic's value is unknown.
"""

import asyncio
import logging
import math
import time
from collections import deque
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal, Protocol, TypeVar

from app.ros.messages import Absence, FieldReader, Fields, Walk
from app.ros.zenoh.sample import Sample
from app.system.errors import DecodeError
from app.system.limits import BoundedQueue
from app.system.texts import TextLike

# Since when fields have had their values, as the panel has heard it.

NO_TIMES: Final[Mapping[str, float]] = {}


class ValueTimes:
    """The wall time of each field's last change, for some fields of one topic.

    The first value that is heard, and the first after a cut, may be older than its message: its time
    is not known.
    """

    def __init__(self, paths: Collection[str] = ()) -> None:
        self._paths = paths
        self._values: dict[str, Any] = {}
        self._times: Mapping[str, float] = NO_TIMES

    def update(self, fields: Fields, wall: float) -> Mapping[str, float]:
        """Path → seconds since the epoch of the fields whose change was heard, after a message that was
        received at `wall`."""
        for path in self._paths:
            value = fields.get(path)
            if path in self._values and value != self._values[path]:
                self._times = {**self._times, path: wall}
            self._values[path] = value
        return self._times

    def clear(self) -> None:
        """The last values are no longer valid."""
        self._values.clear()
        self._times = NO_TIMES


# The newest value of each field with a key, as `position[name=joint_2]`, over the messages of a topic.
#
# Several nodes may publish parts of a list on one topic, such as an arm and a gripper on /joint_states.
# So an element that a message lacks keeps its value, and has an age of its own.

# How long newer messages may lack an element where nothing else limits its age: slow publishers of
# parts, as those of /diagnostics, publish once a second.
KEPT_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class KeyedValue:
    """The value in the newest message that has the element; `at`, `wall` and `source` as in `Sample`.
    `is_ambiguous`: several elements have the key."""

    value: Any
    at: float
    wall: float
    source: str | None
    is_ambiguous: bool = False


KeyedValues = Mapping[str, KeyedValue]  # by path
NO_VALUES: Final[KeyedValues] = {}


def updated(values: KeyedValues, paths: Iterable[str], fields: Fields, sample: Sample) -> KeyedValues:
    """The values after a message."""
    newer = dict(values)
    for path in paths:
        value, is_ambiguous = fields.get(path), fields.is_ambiguous(path)
        if value is not None or is_ambiguous:
            newer[path] = KeyedValue(value, sample.at, sample.wall, sample.source, is_ambiguous)
    return newer


def without_source(values: KeyedValues, source: str) -> KeyedValues:
    """The values that did not come from a peer."""
    return {path: value for path, value in values.items() if value.source not in (source, None)}


def kept_s(max_age_s: float | None, *, single_publisher: bool = False) -> float:
    """How long newer messages may lack an element: if the topic has a single publisher, not at all;
    with `max_age_s` its own age decides."""
    if single_publisher:
        return 0.0
    return KEPT_S if max_age_s is None else math.inf


# Decodes large messages in slices: some milliseconds in each turn of the event loop.
#
# Small messages are decoded at once. No message of a robot delays a press or a permission by more than
# one slice.

log = logging.getLogger("kiosk")

FIRST_SHARE_S: Final = 0.01  # of a turn in which messages arrive, for all of them
LATER_SHARE_S: Final = 0.003  # of each later turn
CALM_SHARE_S: Final = 0.001  # of a turn, for what may wait a moment
CALM_PAUSE_S: Final = 0.004  # then
SMALL_BYTES: Final = 2_000  # decoded at once, however much has arrived in this turn

Resume = Callable[
    [float], bool
]  # continues until a time (monotonic seconds); returns whether it is done


Result = TypeVar("Result")
Read = TypeVar("Read", covariant=True)


class Reader(Protocol[Read]):
    """Of fields, or of the rows of a list."""

    def walk(self, data: bytes) -> Walk[Read]:
        """Starts to decode a message."""


class Slices:
    """Limits the decoding time of each turn. Used on the event loop; without a running loop there is no
    limit."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._now = monotonic
        self._until: float | None = None  # deadline of this turn; None: nothing was decoded in it yet
        self._pending: deque[Resume] = deque()

    def read(self, walk: Walk[Result], size: int) -> Result | None:
        """Decodes a message of `size` bytes; None if this turn's time ends first. DecodeError if the
        bytes are no such message."""
        if size <= SMALL_BYTES:
            return self.read_until(walk, math.inf)
        until = self._turn_deadline()
        return None if self._now() >= until else self.read_until(walk, until)

    def read_until(self, walk: Walk[Result], until: float) -> Result | None:
        """The same until a time (monotonic seconds). What else a decoder throws is logged, and is a
        DecodeError too."""
        try:
            while (result := walk.advance()) is None:
                if self._now() >= until:
                    return None
        except DecodeError:
            raise
        except Exception as error:  # else who waits for this message would wait for ever
            log.exception("a message can't be decoded")
            raise DecodeError(f"its decoder failed: {error}") from error
        return result

    def schedule(self, go_on: Resume) -> None:
        """Calls it once a turn, from the next turn on, until it returns true."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            while not go_on(math.inf):
                pass
            return
        self._pending.append(go_on)
        if len(self._pending) == 1:
            loop.call_soon(self._resume_next)

    def schedule_calmly(self, go_on: Resume, is_behind: Callable[[], bool]) -> None:
        """The same in shorter slices, with pauses in which presses go on, until it is behind."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            self.schedule(go_on)
            return
        loop.call_soon(self._resume_calmly, loop, go_on, is_behind)

    async def read_all(self, reader: Reader[Result], data: bytes) -> Result:
        """Decodes a message, over as many turns as needed; DecodeError if the bytes are no such
        message."""
        walk = reader.walk(data)
        if (fields := self.read(walk, len(data))) is not None:
            return fields
        done: asyncio.Future[Result] = asyncio.get_running_loop().create_future()

        def go_on(until: float) -> bool:
            if not done.done():
                try:
                    if (fields := self.read_until(walk, until)) is not None:
                        done.set_result(fields)
                except Exception as error:
                    done.set_exception(error)
            return done.done()

        self.schedule(go_on)
        return await done

    def _turn_deadline(self) -> float:
        """When decoding in this turn must stop (monotonic seconds)."""
        if self._until is None:
            try:
                asyncio.get_running_loop().call_soon(self._end_turn)
            except RuntimeError:
                return math.inf
            self._until = self._now() + FIRST_SHARE_S
        return self._until

    def _end_turn(self) -> None:
        self._until = None

    def _resume_calmly(
        self, loop: asyncio.AbstractEventLoop, go_on: Resume, is_behind: Callable[[], bool]
    ) -> None:
        if go_on(self._now() + CALM_SHARE_S):
            return
        if is_behind():
            self.schedule(go_on)
        else:
            loop.call_later(CALM_PAUSE_S, self._resume_calmly, loop, go_on, is_behind)

    def _resume_next(self) -> None:
        """Continues the next pending message, round robin."""
        go_on = self._pending[0]
        through = True
        try:
            through = go_on(self._now() + LATER_SHARE_S)
        finally:
            self._pending.popleft()
            if not through:
                self._pending.append(go_on)
            if self._pending:
                asyncio.get_running_loop().call_soon(self._resume_next)


# Undecoded messages of a lossless topic; of other topics only the newest is kept.
MAX_UNREAD: Final = 16
# Of a topic with fields that have keys.
MAX_UNREAD_PARTS: Final = 256
MAX_UNREAD_BYTES: Final = 32_000_000


@dataclass(frozen=True, slots=True)
class Reading:
    """The latest message of a topic.

    `status`: no message yet ("waiting"); received before a cut ("cut"), or from
    a publisher that has ended ("ended"); not decodable ("unreadable");
    being decoded, with the fields of the one before ("reading"); of a Zenoh session that is none of the
    robot's ("foreign"); a valid message ("message"). `at` is in monotonic seconds, `wall` in seconds
    since the epoch. `keyed` are the newest values of fields with keys, over several messages. `since`
    has the wall time of the last change of timed fields.
    """

    status: Literal["waiting", "cut", "ended", "unreadable", "reading", "foreign", "message"]
    fields: Fields | None = None
    at: float = -math.inf
    wall: float = 0.0
    keyed: KeyedValues = field(default_factory=lambda: NO_VALUES)
    since: Mapping[str, float] = field(default_factory=lambda: NO_TIMES)

    def of_field(self, path: str, kept_s: float) -> "Reading":
        """The reading with the times of a field; one with a key has its own, see `KeyedValues`.
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
        time_at: Callable[[float], float] = lambda wall: wall,
    ) -> None:
        """Of a `lossless` topic each message counts, and of one with the paths `keyed` each message
        that has arrived. The changes of the fields `timed` are timed. `on_late_reading` takes a reading
        that needed more than one turn; `on_unreadable` a sample that can't be decoded. `time_at` is the
        robot's, see `RobotClock`: ages of stamps are by it."""
        self._reader = reader
        self._time_at = time_at
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

    def invalidate(self, status: Literal["cut", "ended"] = "cut") -> None:
        """The last value is no longer valid; `status` is why."""
        if self.sample is not None:
            self.cuts += 1
            self._last_reading = replace(self.reading(), status=status)
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
            fields = self._reader.read(bytes(newest.payload), self._time_at(newest.wall))
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
            walk = self._reader.walk(data, self._time_at(sample.wall))
            self._walk = _PendingRead(sample, walk, len(data))
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


# The state of a camera's topic while it is subscribed to: while a browser shows it.


@dataclass(slots=True)
class CameraTopicState:
    """`at` (monotonic seconds) and `wall` (seconds since the epoch) are those of the newest message,
    shown or not. `problem` is why the last frame that was requested can't be shown, "" if it can."""

    at: float = -math.inf
    wall: float = 0.0
    problem: TextLike = ""
