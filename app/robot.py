"""What the kiosk knows of the robot at this moment; changed on the event loop only.

One latest sample per topic, as raw bytes, decoded when it is first asked for.
"""

import logging
import math
from collections import Counter
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol

from app.declared import Declared
from app.errors import DecodeError, FieldError
from app.graph import Graph
from app.interfaces import Interfaces, value_at
from app.keys import ROSOUT_TOPIC, key_of
from app.logs import RobotLog
from app.panel.model import Panel, RobotEntry
from app.progress import Progress
from app.seen import Seen, ends
from app.silent_publishers import SilentPublishers

log = logging.getLogger("kiosk.robot")

UNREADABLE_LOG_S = 60.0  # one line per topic in this time, at most


class Buffer(Protocol):
    """Bytes, or what becomes bytes when asked (Zenoh's buffers: no copy until then)."""

    def __bytes__(self) -> bytes: ...
    def __len__(self) -> int: ...


class Passed(NamedTuple):
    """A payload that came and went before anybody looked, and when: see `Sample`."""

    payload: Buffer
    at: float
    wall: float


class Sample(NamedTuple):
    """One message as it came: `at` monotonic seconds, `wall` seconds since the epoch.

    `source` is the zid of the bridge that sent it (from its timestamp), None if it did not say;
    `seq` orders samples and losses of bridges as this session saw them; `skipped` is how many came
    just before it that nobody looked at; `sent` is the timestamp of its sender's clock, in seconds
    since the epoch; `between` are other payloads that came and went unseen, for watched topics, and
    `overrun` says that there were more before these, of which nobody knows what they said.
    """

    payload: Buffer
    seq: int
    at: float
    wall: float
    source: str | None
    skipped: int = 0
    sent: float | None = None
    between: tuple[Passed, ...] = ()
    overrun: bool = False


@dataclass(frozen=True, slots=True)
class Reading:
    """The latest of a topic: not seen yet, seen before a cut, not readable, or a message."""

    status: Literal["waiting", "cut", "unreadable", "message"]
    message: Any = None
    at: float = -math.inf
    wall: float = 0.0


WAITING = Reading("waiting")


class Robot:
    """Latest samples, the graph, and the state of the link."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        own_zid: str = "",
        entry: RobotEntry | None = None,
    ) -> None:
        """`entry` is which of the panel's robots this is, where it has several."""
        self.name = entry.name if entry else ""
        self.namespace = entry.namespace if entry else panel.namespace
        self.link_up = False
        self.endpoints: tuple[str, ...] = ()  # where its bridge is looked for, as Zenoh names it
        self.settled_at = math.inf  # monotonic: when a bridge that came has set up its routes
        self._keys: dict[str, str] = {}  # of what the panel names
        self._told_apart = entry.namespace if entry else None
        needed = list(ends(panel))
        named = (*panel.subscriptions(), *panel.publications(), *(n for _, n in needed), ROSOUT_TOPIC)
        self._needed = frozenset(map(self.key, named))
        self.graph = Graph(own_zid, self._told_apart, self._needed)
        self._judged = frozenset(self.key(interlock.topic) for interlock in panel.interlocks)
        self.silent = SilentPublishers(self._judged)
        self.progress: dict[str, Progress] = {}  # of what widgets have asked, by their ids
        self.parameters: dict[str, Declared] = {}  # what nodes said of them, by their widgets' ids
        self.held: dict[str, str] = {}  # by the ids of hold widgets: since when, in words
        self._log = RobotLog(log, self.name)
        self.answers = True  # False: its bridges are silent, though nobody knows yet why
        self.caught_up = True  # False: the event loop stood still, and may not know what came meanwhile
        self.seen = Seen({(role, name): (role, self.key(name)) for role, name in needed})
        self.undecodable: Counter[str] = Counter()
        self._interfaces = interfaces
        self._types = {self.key(topic): name for topic, name in panel.subscriptions().items()}
        self._required = [self.key(i.topic) for i in panel.interlocks if i.require_publisher]
        self._published: set[str] = set()
        self._samples: dict[str, Sample] = {}
        self._readings: dict[str, Reading] = {}
        self._logged_at: dict[str, float] = {}

    def key(self, topic: str) -> str:
        """The key expression of a topic of this robot."""
        key = self._keys.get(topic)
        if key is None:
            key = self._keys[topic] = key_of(topic, self.namespace)
        return key

    def take(self, key: str, sample: Sample) -> None:
        """A newer sample of a topic."""
        self._samples[key] = sample
        self.silent.message(key, sample.source, sample.seq, sample.at)
        self._readings.pop(key, None)

    def cut(self, bridge: str, seq: int) -> None:
        """A bridge went away at `seq`: what came by it before no longer says what is so."""
        self.silent.lose_bridge(bridge)
        for key, sample in self._samples.items():
            if sample.seq < seq and sample.source in (bridge, None):
                self._cut(key, sample)

    def follow_publishers(self, before: float = math.inf) -> None:
        """After every change of the graph: where a publisher is required, what it said (`before` this
        number of a sample) goes with it, and its successor has to say it again."""
        self.seen.follow(self.graph)
        for key in self._required:
            if self.graph.on_robot("MP", key):
                self._published.add(key)
            elif key in self._published:
                self._published.discard(key)
                sample = self._samples.get(key)
                if sample is not None and sample.seq < before:
                    self._cut(key, sample)

    def doubt(self, key: str) -> None:
        """It is not known what a topic said last."""
        if sample := self._samples.get(key):
            self._cut(key, sample)

    def lose(self) -> None:
        """The link is lost: nobody is known to be there, and nothing that came says what is so."""
        self.link_up = False
        self.settled_at = math.inf
        self.graph = Graph("", self._told_apart, self._needed)
        self.silent = SilentPublishers(self._judged)
        self.seen.forget()
        for key, sample in self._samples.items():
            self._cut(key, sample)

    def _cut(self, key: str, sample: Sample) -> None:
        old = self._reading(key, sample)
        if old.status != "waiting":
            self._readings[key] = Reading("cut", old.message, old.at, old.wall)

    def reading(self, topic: str) -> Reading:
        """The latest of a topic that the panel listens to."""
        key = self.key(topic)
        sample = self._samples.get(key)
        if sample is None:
            return WAITING
        found = self._reading(key, sample)
        if sample.source is not None and sample.source not in self.graph.bridges:
            return Reading("cut", found.message, found.at, found.wall)
        return found

    def _reading(self, key: str, sample: Sample) -> Reading:
        known = self._readings.get(key)
        if known is None:
            known = self._readings[key] = self._decoded(key, sample)
        return known

    def _decoded(self, key: str, sample: Sample) -> Reading:
        try:
            message = self._interfaces.decode(self._types[key], bytes(sample.payload))
        except DecodeError as error:
            self.count_unreadable(key, sample, error)
            return Reading("unreadable", None, sample.at, sample.wall)
        return Reading("message", message, sample.at, sample.wall)

    def count_unreadable(self, key: str, sample: Sample, error: DecodeError) -> None:
        """Counts a sample that can't be read; logs one of a topic in `UNREADABLE_LOG_S`."""
        self.undecodable[key] += 1
        if sample.at - self._logged_at.get(key, -math.inf) >= UNREADABLE_LOG_S:
            self._logged_at[key] = sample.at
            self._log.error("/%s: %s (%d so far)", key, error, self.undecodable[key])


def value_of(message: Any, path: str) -> Any:
    """The field at a path of a decoded message; None where a list in it is too short."""
    try:
        return value_at(message, path)
    except FieldError:
        return None
