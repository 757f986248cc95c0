"""The history of numeric fields, in bounded memory: the newest samples, and buckets of older ones.

A bucket has the lowest, the highest and the last value of its time, so that no peak is lost however
long the time is that is looked at. A gap is a silence, a lost connection, or what is no number: nothing
is drawn over it. Times are those of the monotonic clock, so that a clock that is set corrupts nothing.
"""

import math
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator, Sequence
from itertools import chain
from typing import Final, NamedTuple

from app.panel.widgets.trend import RAW_S, RAW_SAMPLES, bucket_counts
from app.system.texts import TextLike

CLOCK_SET_S: Final = 0.5  # the wall clock was set if it differs by more from the monotonic clock


class Bucket(NamedTuple):
    """Values of some time, from `at` on, in seconds; `gap`: none was known just before."""

    at: float
    low: float
    high: float
    last: float
    gap: bool


class Column(NamedTuple):
    """The same for one column of a plot, by its number: its time is `number` times the width."""

    number: int
    low: float
    high: float
    last: float
    gap: bool


class Level:
    """The newest `most` buckets of `width` seconds; of width 0 each sample is one of its own."""

    __slots__ = ("at", "gaps", "grows_until", "high", "last", "low", "most", "width")

    def __init__(self, width: float, most: int) -> None:
        self.width = width
        self.most = most
        self.at = array("d")
        self.last = array("d")
        self.low = array("d") if width else self.last
        self.high = array("d") if width else self.last
        self.gaps = bytearray()
        self.grows_until = -math.inf  # the end of the last bucket, if it is of this run

    @property
    def _columns(self) -> "list[array[float]]":
        return [self.at, self.last, self.low, self.high] if self.width else [self.at, self.last]

    def add(self, at: float, value: float, gap: bool) -> None:
        """Adds a value that is not older than those before."""
        if at < self.grows_until:
            if value < self.low[-1]:
                self.low[-1] = value
            if value > self.high[-1]:
                self.high[-1] = value
            self.last[-1] = value
            return
        self.at.append(at)
        self.last.append(value)
        if self.width:
            self.grows_until = (at // self.width + 1) * self.width
            self.low.append(value)
            self.high.append(value)
        self.gaps.append(gap)
        if len(self.at) > self.most + self.most // 8:
            self._drop(len(self.at) - self.most)

    def _drop(self, count: int) -> None:
        for column in self._columns:
            del column[:count]
        del self.gaps[:count]

    def drop_before(self, at: float) -> None:
        """Removes what is older, some of it at a time."""
        if (count := bisect_left(self.at, at)) > self.most // 8:
            self._drop(count)
            if not self.at:
                self.grows_until = -math.inf

    def put_before(self, buckets: Iterable[Bucket]) -> None:
        """Buckets in order, all older than those here."""
        older = Level(self.width, self.most)
        for bucket in list(buckets)[-self.most :]:
            older.at.append(bucket.at)
            older.last.append(bucket.last)
            older.low.append(bucket.low)
            older.high.append(bucket.high)
            older.gaps.append(bucket.gap)
        for mine, theirs in zip(self._columns, older._columns, strict=True):
            mine[:0] = theirs
        self.gaps[:0] = older.gaps

    def since(self, at: float) -> Iterator[Bucket]:
        """The buckets from a time on."""
        for i in range(bisect_left(self.at, at), len(self.at)):
            yield Bucket(self.at[i], self.low[i], self.high[i], self.last[i], bool(self.gaps[i]))

    def columns(self, begin: float, end: float, width: float, shift: float) -> Iterator[Column]:
        """What is from `begin` until `end`, in columns of `width` seconds; column 0 is at `-shift`."""
        i, stop = bisect_left(self.at, begin), bisect_left(self.at, end)
        while i < stop:
            number = math.floor((self.at[i] + shift) / width)
            after = max(bisect_left(self.at, (number + 1) * width - shift, i, stop), i + 1)
            low, high = min(self.low[i:after]), max(self.high[i:after])
            yield Column(number, low, high, self.last[after - 1], bool(self.gaps[i]))
            i = after


class FieldHistory:
    """The history of one field, kept for `keep_s`; silence for longer than `max_age_s` is a gap."""

    def __init__(self, keep_s: float, max_age_s: float) -> None:
        self.keep_s = keep_s
        self.max_age_s = max_age_s
        self.raw = Level(0.0, RAW_SAMPLES)
        self.levels = [Level(width, most) for width, most in bucket_counts(keep_s)]
        self._newest = -math.inf
        self._gap = True

    def add(self, at: float, value: float) -> None:
        """A value at a time in seconds; what is no finite number is a gap."""
        if not math.isfinite(value):
            self._gap = True
            return
        at = max(at, self._newest)
        gap = self._gap or at - self._newest > self.max_age_s
        self.raw.add(at, value, gap)
        for level in self.levels:
            level.add(at, value, gap)
        self._newest, self._gap = at, False

    def interrupt(self) -> None:
        """Marks a gap before the next value."""
        self._gap = True

    def forget_old(self, now: float) -> None:
        """Removes what is older than it is kept."""
        self.raw.drop_before(now - RAW_S)
        for level in self.levels:
            level.drop_before(now - self.keep_s)

    def columns(
        self, begin: float, end: float, width: float, shift: float = 0.0, *, reach: bool = True
    ) -> Iterator[Column]:
        """The columns of a width that show the time from `begin` to `end`, in order; each level for the
        time that no finer one that is needed reaches back to. With `reach` before them the one before
        `begin`, from which a line comes in."""
        fitting = [level for level in self.levels if level.width <= width]
        first = self.levels.index(fitting[-1]) if fitting else -1
        # The finest first: where it begins, the next one ends.
        parts: list[tuple[Level, float, float]] = []
        for level in ([] if fitting else [self.raw]) + self.levels[max(first, 0) :]:
            starts = level.at[0] if level.at else math.inf
            if starts < end:
                parts.append((level, max(starts, begin), end))
                end = starts
            if end <= begin:
                break
        if parts and reach:
            level, start, stop = parts[-1]
            parts[-1] = level, _reaching(level, start), stop
        columns = (level.columns(at, to, width, shift) for level, at, to in reversed(parts))
        yield from _merged(chain.from_iterable(columns))


def _reaching(level: Level, begin: float) -> float:
    """The time of the last bucket that is not after `begin`."""
    i = bisect_right(level.at, begin)
    return level.at[i - 1] if i else begin


def _merged(columns: Iterable[Column]) -> Iterator[Column]:
    """Columns in order, each number once: two levels may meet within one."""
    held: Column | None = None
    for column in columns:
        if held is not None and column.number <= held.number:
            low, high = min(held.low, column.low), max(held.high, column.high)
            held = held._replace(low=low, high=high, last=column.last)
            continue
        if held is not None:
            yield held
        held = column
    if held is not None:
        yield held


class History:
    """The histories of one robot's fields, by (key of the topic, path of the field).

    Its time is the wall clock's at the start, and goes on with the monotonic clock. `shift` is by how
    much the wall clock differs from it now: what was recorded since the start is shown by the clock as
    it is now, what is from earlier runs by the clock of then. `fault` is the sentence for the operator
    while it can't be written to disk, else "".
    """

    def __init__(self, monotonic: float, wall: float) -> None:
        self._offset = wall - monotonic
        self.start = wall
        self.shift = 0.0
        self.fault: TextLike = ""
        self.fields: dict[tuple[str, str], FieldHistory] = {}

    def time(self, monotonic: float) -> float:
        """The time of this history."""
        return monotonic + self._offset

    def set_clock(self, monotonic: float, wall: float) -> None:
        """Follows a clock that was set."""
        shift = wall - self.time(monotonic)
        if abs(shift - self.shift) > CLOCK_SET_S:
            self.shift = shift

    def interrupt(self) -> None:
        """Marks a gap in all fields before the next value."""
        for field in self.fields.values():
            field.interrupt()

    def begin_after(self, at: float) -> None:
        """This run begins after a time of the run before, whatever the clock says."""
        if at >= self.start:
            moved = at + 1.0 - self.start
            self._offset += moved
            self.start += moved
            self.shift -= moved

    def columns(self, field: FieldHistory, begin: float, end: float, width: float) -> Sequence[Column]:
        """The columns of a field; `begin` and `end` are by the wall clock."""
        columns: list[Column] = []
        turn = self.start + self.shift
        if begin < turn and (earlier := min(end, turn, self.start)) > begin:
            columns += field.columns(begin, earlier, width)
        if end > turn:
            first, last = max(begin, turn) - self.shift, end - self.shift
            own = field.columns(first, last, width, self.shift, reach=begin > turn)
            columns += [column for column in own if not columns or column.number >= columns[-1].number]
        return list(_merged(columns))
