"""The samples and tokens that a link has received, as latest values: never a queue that grows.

The link's threads only replace values, under a lock. The event loop is woken once, until it drains the
inbox. Knows nothing of Zenoh.
"""

import itertools
import math
import threading
import time
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, Final, NamedTuple, Protocol

from app.ros.zenoh.sample import Buffer, Sample, SkippedPayload
from app.system.limits import BoundedQueue

UNSEEN_MOST: Final = 256  # changes of a lossless topic that are kept from one drain to the next
UNSEEN_BYTES: Final = 1_000_000  # and their bytes
TIMED_EVERY_S: Final = 1.0  # between two drains with the sender's time of samples
KEPT_MOST: Final = 4_000  # samples of all recorded topics that are kept from one drain to the next
KEPT_BYTES: Final = 32_000_000  # and their bytes

NO_KEYS: Final[frozenset[str]] = frozenset()
NUMBERS: Final = 2**32  # a publisher's numbers begin again after as many messages


class Number(NamedTuple):
    """The number of a message among those of its publisher (zid/entity id)."""

    publisher: str
    value: int

    def is_after(self, earlier: int) -> bool:
        return 0 < (self.value - earlier) % NUMBERS < NUMBERS // 2


class Stamp(Protocol):
    """When a sample was sent, by the sender's clock, and the sender's id."""

    def get_id(self) -> Any: ...
    def get_time(self) -> Any: ...


@dataclass(slots=True)
class Token:
    """The changes of a liveliness token since the last drain.

    `lost_seq` and `came_seq` order its last loss and its last appearance among the samples; 0 means
    none. `came_at` (monotonic seconds) is when it appeared, `lost_before` the `lost_seq` before that.
    """

    alive: bool = False
    lost_seq: int = 0
    came_seq: int = 0
    came_at: float = 0.0
    lost_before: int = 0


class Cache(NamedTuple):
    """The cache of a topic's publisher, by its token, from which the last message has to be fetched.
    `lost`: one that was published after the last that arrived."""

    key: str
    token: str
    lost: bool = False


@dataclass(slots=True)
class Changes:
    """Samples and tokens received since the last drain. `samples` has the newest of each topic, by key;
    `recorded_samples` has every sample of the recorded topics, and the changes of the changing ones.
    `caches` are those of publishers that are new, or have published more than has arrived.
    `reopen`: the session has to be opened again."""

    samples: dict[str, Sample]
    tokens: dict[str, Token]
    link_up: bool
    recorded_samples: Collection[tuple[str, Sample]] = ()
    caches: Collection[Cache] = ()
    reopen: bool = False


class Superseded:
    """The messages of a topic since the last drain, without the newest: each change once. If there are
    too many, the newest of them."""

    __slots__ = ("overrun", "values")

    def __init__(self) -> None:
        self.values: BoundedQueue[SkippedPayload] = BoundedQueue(UNSEEN_MOST, UNSEEN_BYTES)
        self.overrun = False

    def add(self, arrived: "_Arrived") -> None:
        if self.values.add(
            SkippedPayload(arrived.payload, arrived.at, arrived.wall), len(arrived.payload)
        ):
            self.overrun = True


@dataclass(slots=True)
class _Arrived:
    """A sample as received. Its stamp is read when it is drained."""

    payload: Buffer
    stamp: Stamp | None
    seq: int
    at: float
    wall: float
    cached: bool = False
    skipped: int = 0
    unseen: Superseded | None = None

    def sample(self, timed: bool = False) -> Sample:
        """`sent` is set for `timed` samples only: reading a stamp's time is slow."""
        source = None if self.stamp is None else str(self.stamp.get_id())
        sent = self.stamp.get_time().timestamp() if timed and self.stamp is not None else None
        sample = Sample(self.payload, self.seq, self.at, self.wall, source, self.skipped, sent)
        if self.cached:
            sample = sample._replace(cached=True)
        if self.unseen is None:
            return sample
        return sample._replace(skipped_payloads=tuple(self.unseen.values), overrun=self.unseen.overrun)


def _kept_samples() -> BoundedQueue[tuple[str, _Arrived]]:
    return BoundedQueue(KEPT_MOST, KEPT_BYTES)


class Inbox:
    """Samples and tokens received by the current session of a link. Those of earlier sessions are
    dropped."""

    def __init__(self, wake: Callable[[bool], None]) -> None:
        """`wake` is called on the link's threads, under the lock: with False for the first data after a
        drain, with True for the first immediate data, which must not wait for the next frame."""
        self._wake_loop = wake
        self._lock = threading.Lock()
        self._seq = itertools.count(1)
        self._session = 0
        self._immediate = self._lossless = self._recorded = self._changing = self._idle = NO_KEYS
        self._timed_until = -math.inf  # until then samples have no `sent`
        self._forget()

    def _forget(self) -> None:
        self._woken = self._has_immediate = False
        self._samples: dict[str, _Arrived] = {}
        self._idle_samples: dict[str, _Arrived] = {}
        self._connections_changed = False
        self._last_payloads: dict[str, bytes] = {}  # of the topics of which changes are kept
        self._live: dict[str, Stamp | None] = {}  # the last stamp of what did not come from a cache
        self._tokens: dict[str, Token] = {}
        self._numbers: dict[tuple[str, str], int] = {}  # (key, publisher) → of its last message
        self._caches: list[Cache] = []
        self._transports: set[str] = set()
        self._kept = _kept_samples()

    def set_topics(
        self,
        immediate: Collection[str],
        lossless: Collection[str],
        recorded: Collection[str],
        changing: Collection[str] = NO_KEYS,
    ) -> None:
        """Sets how topics are received, by their keys. A sample of an `immediate` topic wakes the event
        loop at once. Of `lossless` topics values that were replaced between two drains are kept. Every
        sample of a `recorded` topic is kept, and of a `changing` one each that differs from the one
        before."""
        self._immediate = frozenset(immediate)
        self._lossless = frozenset(lossless)
        self._recorded = frozenset(recorded)
        self._changing = frozenset(changing) - self._recorded

    def set_idle(self, idle: Collection[str]) -> None:
        """Sets the keys of the topics that no one looks at: their samples do not wake the event
        loop."""
        with self._lock:
            self._idle = frozenset(idle)
            self._samples |= self._idle_samples
            self._idle_samples = {key: self._samples.pop(key) for key in idle if key in self._samples}

    def renew(self) -> None:
        """Begins a new session, with an empty inbox."""
        with self._lock:
            self._session += 1
            self._forget()

    def guarded(self, function: Callable[[Any], None]) -> Callable[[Any], None]:
        """`function`, called under the lock. It does nothing once the session has been renewed."""
        session = self._session

        def handle(event: Any) -> None:
            with self._lock:
                if session == self._session:
                    function(event)

        return handle

    def probe(self) -> None:
        """Returns when the lock is free. Blocks while a callback holds it."""
        with self._lock:
            pass

    @property
    def has_idle(self) -> bool:
        """Whether samples of topics that no one looks at are waiting."""
        return bool(self._idle_samples)

    def drain(self, whole: bool = True) -> Changes:
        """Returns and removes everything received since the last call. Unless `whole`, what no one
        looks at stays, as long as there is no change of the graph or of a connection: a sample counts
        before what came after it."""
        with self._lock:
            self._woken = self._has_immediate = False
            samples, self._samples = self._samples, {}
            if self._idle_samples and (
                whole or self._tokens or self._caches or self._connections_changed
            ):
                samples |= self._idle_samples
                self._idle_samples = {}
            self._connections_changed = False
            tokens, self._tokens = self._tokens, {}
            caches, self._caches = self._caches, []
            kept, self._kept = self._kept, _kept_samples()
            link_up = bool(self._transports)
        is_due = bool(samples) and time.monotonic() >= self._timed_until
        if is_due:
            self._timed_until = time.monotonic() + TIMED_EVERY_S
        return Changes(
            {key: arrived.sample(timed=is_due) for key, arrived in samples.items()},
            tokens,
            link_up,
            [(key, arrived.sample(timed=True)) for key, arrived in kept] if kept else (),
            caches,
        )

    @property
    def has_immediate(self) -> bool:
        """Whether immediate data has been received since the last drain."""
        return self._has_immediate

    # Below: on the link's threads, under the lock. No work here, and nothing may raise.

    def put(self, key: str, payload: Buffer, stamp: Stamp | None, number: Number | None = None) -> None:
        """A sample of a topic. Samples are in the order of reception, not of stamps: clocks may be
        wrong."""
        self._live[key] = stamp
        if number is not None:
            self._numbers[key, number.publisher] = number.value
        self._add(key, payload, stamp)

    def put_cached(
        self, key: str, payload: Buffer, stamp: Stamp | None, number: Number | None = None
    ) -> None:
        """A sample from a publisher's cache; ignored if the publisher has published since."""
        known = None if number is None else self._numbers.get((key, number.publisher))
        if number is not None and known is not None:
            if not number.is_after(known):
                return
        elif key in self._live:
            last = self._live[key]
            if last is None or stamp is None or last.get_id() == stamp.get_id():
                return
        if number is not None:
            self._numbers[key, number.publisher] = number.value
        self._add(key, payload, stamp, cached=True)

    def _add(self, key: str, payload: Buffer, stamp: Stamp | None, cached: bool = False) -> None:
        arrived = _Arrived(payload, stamp, next(self._seq), time.monotonic(), time.time(), cached)
        is_idle = key in self._idle
        samples = self._idle_samples if is_idle else self._samples
        replaced = samples.get(key)
        if replaced is not None:
            arrived.skipped = replaced.skipped + 1
            if key in self._lossless:
                arrived.unseen = _unseen(replaced, payload)
        samples[key] = arrived
        if key in self._recorded:
            self._keep(key, arrived)
        elif key in self._changing and (content := bytes(payload)) != self._last_payloads.get(key):
            self._last_payloads[key] = content
            self._keep(key, arrived)
        if not is_idle:
            self._wake(key in self._immediate)

    def _keep(self, key: str, arrived: _Arrived) -> None:
        self._kept.add((key, arrived), len(arrived.payload))

    def token(self, key: str, alive: bool) -> None:
        """A liveliness token appeared or was lost."""
        seq = next(self._seq)
        token = self._tokens.setdefault(key, Token())
        token.alive = alive
        if alive:
            token.came_seq, token.came_at, token.lost_before = seq, time.monotonic(), token.lost_seq
        else:
            token.lost_seq = seq
        self._wake(True)

    def cache(self, key: str, token: str, lost: bool = False) -> None:
        """The token of a cache of a topic's publisher appeared, or a message of it was lost."""
        self._caches.append(Cache(key, token, lost))
        self._wake(True)

    def last_number(self, key: str, token: str, last: Number) -> None:
        """The publisher with this cache says which message was its last."""
        known = self._numbers.get((key, last.publisher))
        if known is None or last.is_after(known):
            self.cache(key, token, lost=known is not None)

    def publisher_lost(self, key: str, publisher: str) -> None:
        """A publisher with numbers is gone."""
        self._numbers.pop((key, publisher), None)

    def transport(self, zid: str, up: bool) -> None:
        """A connection was opened or closed."""
        if up:
            self._transports.add(zid)
        else:
            self._transports.discard(zid)
        self._connections_changed = True
        self._wake(True)

    def _wake(self, immediate: bool) -> None:
        if immediate and not self._has_immediate:
            self._has_immediate = self._woken = True
            self._wake_loop(True)
        elif not self._woken:
            self._woken = True
            self._wake_loop(False)


def _unseen(replaced: _Arrived, newest: Buffer) -> Superseded | None:
    """The messages before `newest` that have not been drained."""
    unseen = replaced.unseen
    if bytes(replaced.payload) != bytes(newest):
        unseen = unseen or Superseded()
        unseen.add(replaced)
    return unseen
