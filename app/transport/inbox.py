"""What comes in by a link, kept as latest values: never a queue that grows.

The link's threads put it in under a lock, and do no more than replace what was there; the event loop
is woken once, until it drains. Knows nothing of Zenoh.
"""

import itertools
import threading
import time
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, Final, Protocol

from app.robot.state import Buffer, Sample, SkippedPayload

BETWEEN_MOST: Final = 256  # changes of a watched topic that are kept from one drain to the next
BETWEEN_BYTES: Final = 1_000_000  # and their bytes
KEPT_MOST: Final = 4_000  # samples that are kept whole from one drain to the next, of all topics
KEPT_BYTES: Final = 32_000_000  # and their bytes

NO_KEYS: Final[frozenset[str]] = frozenset()


class Stamp(Protocol):
    """When a sample was sent, by the clock of who sent it."""

    def get_id(self) -> Any: ...
    def get_time(self) -> Any: ...


@dataclass(slots=True)
class Token:
    """What became of a liveliness token since the last drain.

    `lost_seq` and `came_seq` order its last loss and its last appearance among the samples, 0 where
    there was none; `came_at` (monotonic seconds) is when it appeared, `lost_before` the loss before.
    """

    alive: bool = False
    lost_seq: int = 0
    came_seq: int = 0
    came_at: float = 0.0
    lost_before: int = 0


@dataclass(slots=True)
class Changes:
    """All that came since the last drain; `kept` has each sample of the topics that are kept whole,
    `caches` are (topic, token) of the publishers that keep their last message for late subscribers."""

    samples: dict[str, Sample]
    tokens: dict[str, Token]
    link_up: bool
    kept: Collection[tuple[str, Sample]] = ()
    caches: Collection[tuple[str, str]] = ()


class _Between:
    """The messages of a topic before the newest that were not read, each change once; of too many the
    newest."""

    __slots__ = ("_bytes", "overrun", "values")

    def __init__(self) -> None:
        self.values: deque[SkippedPayload] = deque()
        self.overrun = False
        self._bytes = 0

    def add(self, one: "_Arrived") -> None:
        self.values.append(SkippedPayload(one.payload, one.at, one.wall))
        self._bytes += len(one.payload)
        while len(self.values) > BETWEEN_MOST or (self._bytes > BETWEEN_BYTES and len(self.values) > 1):
            self._bytes -= len(self.values.popleft().payload)
            self.overrun = True


@dataclass(slots=True)
class _Arrived:
    """A sample as it came; what it says of its source is read when it is drained."""

    payload: Buffer
    stamp: Stamp | None
    seq: int
    at: float
    wall: float
    skipped: int = 0
    between: _Between | None = None
    cached: bool = False

    def sample(self, kept: bool = False) -> Sample:
        """When it was sent is for what is kept only: to ask a stamp takes its time."""
        source = None if self.stamp is None else str(self.stamp.get_id())
        sent = self.stamp.get_time().timestamp() if kept and self.stamp is not None else None
        sample = Sample(self.payload, self.seq, self.at, self.wall, source, self.skipped, sent)
        if self.cached:
            sample = sample._replace(cached=True)
        if self.between is None:
            return sample
        between = self.between
        return sample._replace(skipped_payloads=tuple(between.values), overrun=between.overrun)


class Inbox:
    """What came by the newest session of a link; of the sessions before it, nothing comes in."""

    def __init__(self, wake: Callable[[bool], None]) -> None:
        """`wake` is called on the link's threads, under the lock: once after a drain, and once more
        with True when something came that is not to wait for the next frame."""
        self._wake_loop = wake
        self._lock = threading.Lock()
        self._seq = itertools.count(1)
        self._session = 0
        self._prompt = self._watched = self._whole = NO_KEYS
        self._forget()

    def _forget(self) -> None:
        self._woken = self._hurried = False
        self._samples: dict[str, _Arrived] = {}
        self._live: dict[str, Stamp | None] = {}  # the last stamp of what did not come from a cache
        self._tokens: dict[str, Token] = {}
        self._caches: list[tuple[str, str]] = []
        self._transports: set[str] = set()
        self._kept: deque[tuple[str, _Arrived]] = deque()
        self._kept_bytes = 0

    def expect(self, prompt: Collection[str], watched: Collection[str], whole: Collection[str]) -> None:
        """What comes of `prompt` topics wakes the loop at once. Of `watched` ones, which are prompt
        too, a value that came and went between two drains is kept, and of `whole` ones all."""
        self._prompt, self._watched = frozenset(prompt) | frozenset(watched), frozenset(watched)
        self._whole = frozenset(whole)

    def renew(self) -> None:
        """Forgets all: what comes next is of another session."""
        with self._lock:
            self._session += 1
            self._forget()

    def guarded(self, function: Callable[[Any], None]) -> Callable[[Any], None]:
        """The same, under the lock; it does nothing any more once there is another session."""
        session = self._session

        def handle(what: Any) -> None:
            with self._lock:
                if session == self._session:
                    function(what)

        return handle

    def respond(self) -> None:
        """Returns when the lock does not stand still."""
        with self._lock:
            pass

    def drain(self) -> Changes:
        """Takes all that came since the last call."""
        with self._lock:
            self._woken = self._hurried = False
            samples, self._samples = self._samples, {}
            tokens, self._tokens = self._tokens, {}
            caches, self._caches = self._caches, []
            kept, self._kept, self._kept_bytes = self._kept, deque(), 0
            link_up = bool(self._transports)
        return Changes(
            {key: arrived.sample() for key, arrived in samples.items()},
            tokens,
            link_up,
            [(key, arrived.sample(kept=True)) for key, arrived in kept] if kept else (),
            caches,
        )

    @property
    def hurried(self) -> bool:
        """Whether something came since the last drain that is not to wait for the next frame."""
        return self._hurried

    # Below: on the link's threads, under the lock. No work here, and nothing may raise.

    def put(self, key: str, payload: Buffer, stamp: Stamp | None) -> None:
        """A sample of a topic, as it is published. Its stamp does not order it: clocks may be wrong."""
        self._live[key] = stamp
        self._add(key, payload, stamp)

    def put_cached(self, key: str, payload: Buffer, stamp: Stamp | None) -> None:
        """A sample that was published before, unless its source has published since."""
        if key in self._live:
            last = self._live[key]
            if last is None or stamp is None or last.get_id() == stamp.get_id():
                return
        self._add(key, payload, stamp, cached=True)

    def _add(self, key: str, payload: Buffer, stamp: Stamp | None, cached: bool = False) -> None:
        arrived = _Arrived(
            payload, stamp, next(self._seq), time.monotonic(), time.time(), cached=cached
        )
        unseen = self._samples.get(key)
        if unseen is not None:
            arrived.skipped = unseen.skipped + 1
            if key in self._watched:
                arrived.between = _between(unseen, payload)
        self._samples[key] = arrived
        if key in self._whole:
            self._keep(key, arrived)
        self._wake(key in self._prompt)

    def _keep(self, key: str, arrived: _Arrived) -> None:
        self._kept.append((key, arrived))
        self._kept_bytes += len(arrived.payload)
        while len(self._kept) > KEPT_MOST or (self._kept_bytes > KEPT_BYTES and len(self._kept) > 1):
            _, oldest = self._kept.popleft()
            self._kept_bytes -= len(oldest.payload)

    def token(self, key: str, alive: bool) -> None:
        """A liveliness token came or ended."""
        seq = next(self._seq)
        token = self._tokens.setdefault(key, Token())
        token.alive = alive
        if alive:
            token.came_seq, token.came_at, token.lost_before = seq, time.monotonic(), token.lost_seq
        else:
            token.lost_seq = seq
        self._wake(True)

    def cache(self, key: str, token: str) -> None:
        """The token of the cache of a topic's publisher came."""
        self._caches.append((key, token))
        self._wake(True)

    def transport(self, zid: str, up: bool) -> None:
        """A connection came or ended."""
        if up:
            self._transports.add(zid)
        else:
            self._transports.discard(zid)
        self._wake(True)

    def _wake(self, prompt: bool) -> None:
        if prompt and not self._hurried:
            self._hurried = self._woken = True
            self._wake_loop(True)
        elif not self._woken:
            self._woken = True
            self._wake_loop(False)


def _between(unseen: _Arrived, newest: Buffer) -> _Between | None:
    """What is between the last that was looked at and the newest."""
    between = unseen.between
    if bytes(unseen.payload) != bytes(newest):
        between = between or _Between()
        between.add(unseen)
    return between
