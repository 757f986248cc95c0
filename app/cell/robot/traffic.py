"""How often the topics of a robot arrive, how large they are, and the round trips to its peer."""

import math
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final

from app.ros.zenoh.sample import Sample
from app.system.errors import DecodeError
from app.system.log import RobotLog

# How often the topics of a robot arrive, how large the newest message is, and what can't be decoded.
#
# A sample costs an addition: rates are computed from marks, one a second, when someone asks for them.

WINDOW_S: Final = 10.0
SLOW_WINDOW_S: Final = 60.0  # of a topic with fewer than `ENOUGH` messages in `WINDOW_S`
ENOUGH: Final = 5
MARK_EVERY_S: Final = 1.0
MOST_MARKS: Final = 61
STOPPED: Final = 3.0  # periods without a message: then the pause counts too
FIRST_BYTES: Final = 32
LOG_EVERY_S: Final = 60.0  # at most one log line for each topic in this time


@dataclass(frozen=True, slots=True)
class Undecodable:
    """The newest message that could not be decoded: its first bytes, its size, why, and when (seconds
    since the epoch)."""

    first: bytes
    size: int
    reason: str
    wall: float


class TopicTraffic:
    """The messages of one topic: how many arrived, and size (bytes) and time of the newest. `at` is in
    monotonic seconds, `wall` in seconds since the epoch."""

    __slots__ = ("_marks", "at", "count", "size", "undecodable", "wall")

    def __init__(self) -> None:
        self.count = 0
        self.size = 0
        self.at = self.wall = 0.0
        self.undecodable: Undecodable | None = None
        self._marks: deque[tuple[float, int]] = deque(maxlen=MOST_MARKS)  # (at, count with it)

    def record(self, sample: Sample) -> None:
        """The newest sample, and those before it that were not read. What a cache had kept is no
        message of now."""
        self.size, self.at, self.wall = len(sample.payload), sample.at, sample.wall
        if sample.cached:
            return
        self.count += sample.skipped + 1
        if not self._marks or sample.at - self._marks[-1][0] >= MARK_EVERY_S:
            self._marks.append((sample.at, self.count))

    def rate(self, now: float) -> float | None:
        """Messages a second at `now`, over the last seconds, or the last minute of a slow topic. None
        if that is not known: fewer than two arrived in a minute."""
        for window_s, enough in ((WINDOW_S, ENOUGH), (SLOW_WINDOW_S, 1)):
            began = next((mark for mark in self._marks if now - mark[0] <= window_s), None)
            if began is None or self.count - began[1] < enough:
                continue
            number, took_s = self.count - began[1], self.at - began[0]
            has_stopped = now - self.at > STOPPED * took_s / number
            return number / max(now - began[0] if has_stopped else took_s, 1e-3)
        return None


class Traffic:
    """The traffic of one robot's topics, by their keys. Used on the event loop only."""

    def __init__(self, log: RobotLog) -> None:
        self._log = log
        self._topics: dict[str, TopicTraffic] = {}
        self._logged_at: dict[str, float] = {}
        self.undecodable: Counter[str] = Counter()  # messages that could not be decoded

    @property
    def topics(self) -> Mapping[str, TopicTraffic]:
        return self._topics

    def record(self, key: str, sample: Sample) -> None:
        """A topic's newest sample was drained."""
        topic = self._topics.get(key)
        if topic is None:
            topic = self._topics[key] = TopicTraffic()
        topic.record(sample)

    def count_undecodable(self, key: str, sample: Sample, error: DecodeError) -> None:
        """Counts a sample that can't be decoded; logs at most one of a topic in `LOG_EVERY_S`."""
        self.undecodable[key] += 1
        data = bytes(sample.payload)
        topic = self._topics.setdefault(key, TopicTraffic())
        topic.undecodable = Undecodable(data[:FIRST_BYTES], len(data), str(error), sample.wall)
        if sample.at - self._logged_at.get(key, -math.inf) >= LOG_EVERY_S:
            self._logged_at[key] = sample.at
            self._log.error("/%s: %s (%d so far)", key, error, self.undecodable[key])


# Round trips to a robot's peer over the last minutes, in memory of a fixed size.

EVERY_S: Final = 5.0  # a column
MAX_COLUMNS: Final = 60  # columns: five minutes
MOST_IN_COLUMN: Final = 100


@dataclass(frozen=True, slots=True)
class RoundTripSummary:
    """Seconds, over the last minutes; `medians` are those of each `EVERY_S`, the oldest first."""

    least: float
    median: float
    most: float
    last: float
    medians: Sequence[float]


class RoundTrips:
    """The round trips of one robot. Used on the event loop only."""

    def __init__(self) -> None:
        self._columns: deque[tuple[float, list[float]]] = deque(
            maxlen=MAX_COLUMNS
        )  # when it began, its times

    def record(self, took_s: float, now: float) -> None:
        """A reply arrived at `now` (monotonic seconds), `took_s` after its query."""
        if not self._columns or now - self._columns[-1][0] >= EVERY_S:
            self._columns.append((now, []))
        times = self._columns[-1][1]
        if len(times) < MOST_IN_COLUMN:
            times.append(took_s)

    def summary(self, now: float) -> RoundTripSummary | None:
        """That of the last five minutes; None without a reply in them."""
        columns = [times for began, times in self._columns if now - began <= MAX_COLUMNS * EVERY_S]
        every = [took for times in columns for took in times]
        if not every:
            return None
        return RoundTripSummary(
            min(every), median(every), max(every), every[-1], [median(times) for times in columns]
        )
