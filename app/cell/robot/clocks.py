"""The clocks of a robot against the panel's: how far they are apart, and simulated time.

A stamp is made before its message arrives, so "stamp minus arrival" is how far the sender's clock is
ahead, less a delay that is never negative: the greatest of these offsets is the nearest to the skew.
Pure, with times injected; `put` of `SimulatedTime` is the only method that Zenoh's threads call.
"""

import math
import threading
import time
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass
from statistics import median_high
from typing import Final, Literal

from app.ros.cdr.stamped import NS_PER_S, first_stamp_ns
from app.system.errors import LinkError
from app.system.texts import say

APART_S: Final = 1.0  # clocks that differ by less count as equal
OTHER_TIME_S: Final = 86_400.0  # a larger difference is a recording's or a simulation's, no skew
COLUMN_S: Final = 300.0
COLUMNS: Final = 12  # an hour: a clock drifts by milliseconds in it
EVERY_S: Final = 1.0  # at most one stamp of a topic is read in this time
SET_BY_S: Final = 0.5  # the panel's wall clock was set if it differs by more from the monotonic clock
LARGEST_BYTES: Final = 64_000  # the stamp of a larger message is not read: its bytes would be copied
PAUSED_S: Final = 2.0  # a simulated time that has not gone on for so long stands still
BACK_NS: Final = 100_000_000  # back by more, it began again: messages may be reordered

CLOCK: Final = "/clock"
CLOCK_TYPE: Final = "rosgraph_msgs/msg/Clock"


def are_apart(offset_s: float) -> bool:
    """Whether clocks that differ by so much count as different."""
    return abs(offset_s) >= APART_S


def is_other_time(offset_s: float) -> bool:
    """Whether a difference is that of a simulated or recorded time, not of a clock that is wrong."""
    return abs(offset_s) >= OTHER_TIME_S


class Offsets:
    """The offsets of one sender's stamps in the last hour, in seconds; negative: behind."""

    __slots__ = ("_columns", "_last")

    def __init__(self) -> None:
        self._columns: deque[tuple[float, float]] = deque(maxlen=COLUMNS)  # (began, greatest offset)
        self._last = -math.inf  # the last stamp

    def add(self, stamp: float, received: float, at: float) -> None:
        """A stamp of a message that arrived at `received`, by the panel's clock, and at `at` (monotonic
        seconds). The first one, and one that does not go on, proves nothing: it may be repeated. Stamps
        that go back are of a clock that was set: what was known of it is forgotten."""
        last, self._last = self._last, stamp
        if stamp < last - APART_S:
            self._columns.clear()
        if last == -math.inf or stamp <= last:
            return
        while self._columns and at - self._columns[0][0] > COLUMN_S * COLUMNS:
            self._columns.popleft()
        offset = stamp - received
        if not self._columns or at - self._columns[-1][0] >= COLUMN_S:
            self._columns.append((at, offset))
        elif offset > self._columns[-1][1]:
            self._columns[-1] = self._columns[-1][0], offset

    @property
    def greatest(self) -> float | None:
        """None while nothing is known."""
        return max((offset for _, offset in self._columns), default=None)

    @property
    def spread(self) -> float:
        """By how much the greatest of five minutes differ: how steady the clock and the delay are."""
        offsets = [offset for _, offset in self._columns]
        return max(offsets) - min(offsets) if offsets else 0.0


class SimulatedTime:
    """The time that a robot publishes on `/clock`."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._ns: int | None = None
        self._moved_at = -math.inf
        self.jumps = 0  # how often it went back

    def put(self, data: bytes, at: float) -> None:
        """A `rosgraph_msgs/msg/Clock` that arrived at `at` (monotonic seconds). On any thread."""
        ns = first_stamp_ns(data)
        if ns is None:
            return
        with self._lock:
            if self._ns is not None and ns < self._ns - BACK_NS:
                self.jumps += 1
            elif self._ns is not None and ns <= self._ns:
                return
            self._ns, self._moved_at = ns, at

    @property
    def ns(self) -> int | None:
        """In nanoseconds; None before the first."""
        return self._ns

    @property
    def seconds(self) -> float:
        """NaN before the first."""
        return math.nan if self._ns is None else self._ns / NS_PER_S

    def state(self, now: float) -> Literal["unknown", "running", "paused"]:
        """Whether it goes on at `now` (monotonic seconds); "unknown" before the first message."""
        if self._ns is None:
            return "unknown"
        return "paused" if now - self._moved_at >= PAUSED_S else "running"


Witness = Literal["peer", "stamps"]
ClockState = Literal["unknown", "even", "apart", "other_time"]


@dataclass(frozen=True, slots=True)
class Skew:
    """By how many seconds the robot's clock is ahead of the panel's; negative: behind. `witness` is
    what it is known by: the time stamps of its peer, or those in its messages. `spread_s` is by how
    much it changed in the last hour. `state`: of another time, as that of a recording, where the
    difference is no skew."""

    seconds: float
    witness: Witness
    spread_s: float = 0.0

    @property
    def state(self) -> ClockState:
        if is_other_time(self.seconds):
            return "other_time"
        return "apart" if are_apart(self.seconds) else "even"


class RobotClock:
    """The clock of one robot. Used on the event loop only. `simulated` is its simulated time while it
    publishes one, `skew` how far its wall clock is ahead: None while that is not known.

    A peer's time stamps count before those in messages: a message that waited for minutes has an old
    stamp too. With several senders the middle one counts. `stamps_s` is that of the stamps in messages,
    from the panel's clock, or from the simulated time; None while nothing is known of them.
    """

    def __init__(self) -> None:
        self._peers: dict[str, Offsets] = {}  # by zid
        self._topics: dict[str, Offsets] = {}  # by key
        self._due: dict[str, float] = {}  # when the next stamp of a sender is read
        self._panel_ahead: float | None = None  # of the panel's wall clock before its monotonic clock
        self.simulated: SimulatedTime | None = None
        self.skew: Skew | None = None
        self.stamps_s: float | None = None
        self._shown: tuple[object, ...] = ()
        self.version = 0  # changes with what is said of it

    def is_due(self, sender: str, at: float) -> bool:
        """Whether a stamp of a topic (its key) or a peer (its zid) is to be read now (monotonic
        seconds), which counts as read."""
        if at < self._due.get(sender, -math.inf):
            return False
        self._due[sender] = at + EVERY_S
        return True

    def record_topic(self, key: str, stamp: float, wall: float, at: float) -> None:
        """A stamp in a message that arrived at `wall` (seconds since the epoch) and `at` (monotonic
        seconds)."""
        self._check_panel(wall, at)
        received = wall if self.simulated is None else self.simulated.seconds
        if not math.isnan(received):
            self._topics.setdefault(key, Offsets()).add(stamp, received, at)
            self._measure()

    def record_peer(self, zid: str, sent: float, wall: float, at: float) -> None:
        """The time stamp that a peer has put on a sample."""
        self._check_panel(wall, at)
        self._peers.setdefault(zid, Offsets()).add(sent, wall, at)
        self._measure()

    def _check_panel(self, wall: float, at: float) -> None:
        """Offsets from before the panel's own clock was set say nothing."""
        ahead = wall - at
        if self._panel_ahead is None or abs(ahead - self._panel_ahead) > SET_BY_S:
            self._peers.clear()
            self._topics.clear()
        self._panel_ahead = ahead

    def _measure(self) -> None:
        peers, topics = _greatest(self._peers), _greatest(self._topics)
        self.stamps_s = median_high(topics.values()) if topics else None
        self.skew = None
        if peers:
            self.skew = _skew("peer", self._peers, median_high(peers.values()))
        elif self.stamps_s is not None and self.simulated is None:
            self.skew = _skew("stamps", self._topics, self.stamps_s)
        seconds = None if self.skew is None else round(self.skew.seconds)
        shown = (seconds, self.skew and self.skew.state, *sorted(self.topics_apart))
        if shown != self._shown:
            self._shown, self.version = shown, self.version + 1

    def peer_ahead(self, zid: str) -> float | None:
        """By how many seconds the clock of a peer is ahead of the panel's; None while that is not
        known."""
        offsets = self._peers.get(zid)
        return None if offsets is None else offsets.greatest

    def forget(self) -> None:
        """The link was lost: nothing is known of its clock, and no simulated time arrives."""
        self._peers.clear()
        self._topics.clear()
        self._due.clear()
        self.simulated = None
        self._measure()

    def forget_peer(self, zid: str) -> None:
        """A peer was lost."""
        self._peers.pop(zid, None)
        self._due.pop(zid, None)
        self._measure()

    def begin_simulated(self) -> SimulatedTime:
        """The robot publishes a simulated time from now on."""
        self.simulated = SimulatedTime()
        self.forget_stamps()
        return self.simulated

    def end_simulated(self) -> None:
        """It publishes none any more."""
        self.simulated = None
        self.forget_stamps()

    def forget_stamps(self) -> None:
        """The stamps in messages begin again."""
        self._topics.clear()
        self._measure()

    @property
    def topics_apart(self) -> Mapping[str, float]:
        """The offsets of the topics, by their keys, of which the stamps differ from what they are
        compared with: the clock of the robot's peer, the simulated time, or the other topics."""
        base = self.skew.seconds if self.skew is not None and self.simulated is None else 0.0
        offsets = _greatest(self._topics)
        return {key: offset for key, offset in offsets.items() if are_apart(offset - base)}

    def time_at(self, wall: float) -> float:
        """The robot's time in seconds when the panel's clock showed `wall`, by which ages of stamps are
        judged: the simulated time where there is one, else the panel's clock with the skew. NaN where
        stamps can't be compared with it: no simulated time has arrived, or they are of another time."""
        if self.simulated is not None:
            return self.simulated.seconds
        skew_s = self.skew.seconds if self.skew is not None else 0.0
        if is_other_time(skew_s) or (self.stamps_s is not None and is_other_time(self.stamps_s)):
            return math.nan
        return wall + skew_s

    @property
    def is_awaited(self) -> bool:
        """Whether the robot's simulated time is not known yet."""
        return self.simulated is not None and self.simulated.ns is None

    def now_ns(self) -> int:
        """What `{now}` is in a message to the robot, in nanoseconds: the simulated time where there is
        one, else the panel's clock. LinkError before the simulated time is known."""
        if self.simulated is None:
            return time.time_ns()
        if self.simulated.ns is None:
            raise LinkError(say("clock_awaited_lock"))
        return self.simulated.ns

    def stop_ns(self) -> int:
        """The same for what stops, which is sent all the same: 0, ROS 2's unset time, before the
        simulated time is known."""
        return 0 if self.is_awaited else self.now_ns()


def _skew(witness: Witness, senders: Mapping[str, Offsets], seconds: float) -> Skew:
    spread = next((each.spread for each in senders.values() if each.greatest == seconds), 0.0)
    return Skew(seconds, witness, spread)


def _greatest(senders: Mapping[str, Offsets]) -> dict[str, float]:
    known = ((sender, offsets.greatest) for sender, offsets in senders.items())
    return {sender: greatest for sender, greatest in known if greatest is not None}
