"""Listens to a robot's topics for some seconds: which samples arrive, when, and how many copies."""

import asyncio
import time
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain, pairwise
from typing import Final

from app.cell.robot.clocks import RobotClock
from app.ros.cdr.stamped import first_stamp
from app.ros.dialects.dialect import Dialect
from app.ros.zenoh.declarations import Declarations
from app.ros.zenoh.inbox import Changes
from app.ros.zenoh.sample import Sample
from app.ros.zenoh.session import ZenohSession

POLL_S: Final = 0.05
LEAST_S: Final = 1.0  # for samples from the caches of latched publishers, and for copies
ENOUGH: Final = 3  # messages of a topic
COPIES_WITHIN_S: Final = 0.02
APART: Final = 3  # times `COPIES_WITHIN_S`: the least time between messages that are no copies


@dataclass(slots=True)
class ReceivedSamples:
    """The samples received on each topic within `window_s`, by key. `began` and `ended` are in
    monotonic seconds. `lost` are the keys of topics whose publisher ended."""

    began: float = 0.0
    ended: float = 0.0
    samples: defaultdict[str, list[Sample]] = field(default_factory=lambda: defaultdict(list))
    lost: set[str] = field(default_factory=set)

    @property
    def window_s(self) -> float:
        return self.ended - self.began

    def live(self, key: str) -> list[Sample]:
        """The samples of a topic without those from a publisher's cache."""
        return [sample for sample in self.samples[key] if not sample.cached]

    def clock(self, key: str, *, is_stamped: bool) -> RobotClock:
        """The robot's clock, by the time stamps of its peers on all topics and, where the messages of a
        topic begin with a stamp, by those."""
        clock = RobotClock()
        samples = sorted(chain.from_iterable(map(self.live, self.samples)), key=lambda each: each.seq)
        for sample in samples:
            if sample.sent is not None:
                clock.record_peer(sample.source or "", sample.sent, sample.wall, sample.at)
        for sample in self.live(key) if is_stamped else ():
            if (stamp := first_stamp(bytes(sample.payload))) is not None:
                clock.record_topic(key, stamp, sample.wall, sample.at)
        return clock

    def longest_gap(self, key: str) -> float:
        """The longest time without a message in seconds: between two, or from the last to the end."""
        times = [sample.at for sample in self.live(key)]
        return max((b - a for a, b in pairwise([*times, self.ended])), default=self.window_s)


async def receive(
    session: ZenohSession,
    dialect: Dialect,
    topics: Mapping[str, str],
    wanted: Iterable[str],
    longest_s: float,
) -> ReceivedSamples:
    """Subscribes to the topics (key → key expression) until `ENOUGH` samples of each of `wanted` have
    been received, `longest_s` at most."""
    received = ReceivedSamples(began=time.monotonic())
    session.start(Declarations(subscribe=topics, recorded=topics.keys()))
    waited_for = set(wanted)
    end = received.began + longest_s
    while (now := time.monotonic()) < end:
        await asyncio.sleep(POLL_S)
        changes = session.drain()
        for key, sample in changes.recorded_samples:
            received.samples[key].append(sample)
        received.lost |= {key for token in _lost(changes) if (key := _published(dialect, token))}
        if now - received.began >= min(LEAST_S, longest_s):
            heard = {key for key in waited_for if len(received.live(key)) >= ENOUGH}
            waited_for -= heard | received.lost
            if not waited_for:
                break
    received.ended = time.monotonic()
    return received


def _lost(changes: Changes) -> Iterable[str]:
    return (token for token, change in changes.tokens.items() if change.lost_seq)


def _published(dialect: Dialect, token: str) -> str:
    """The key that a publisher's token is about; "" for any other token."""
    endpoint = dialect.endpoint(token)
    return endpoint.key if endpoint is not None and endpoint.role == "MP" else ""


def copies(samples: Sequence[Sample]) -> int:
    """How many times each message comes from one bridge: 1 where they may be those of a publisher
    that repeats itself. Pure."""
    by_source: defaultdict[str | None, list[Sample]] = defaultdict(list)
    for sample in samples:
        by_source[sample.source].append(sample)
    return max((_copies(several) for several in by_source.values()), default=1)


def _copies(samples: Sequence[Sample]) -> int:
    groups: list[list[Sample]] = []
    for sample in samples:
        last = groups[-1][-1] if groups else None
        same = last is not None and bytes(last.payload) == bytes(sample.payload)
        if last is not None and same and sample.at - last.at <= COPIES_WITHIN_S:
            groups[-1].append(sample)
        else:
            groups.append([sample])
    apart = [b[0].at - a[-1].at for a, b in pairwise(groups)]
    if not apart or min(apart) < APART * COPIES_WITHIN_S:
        return 1
    return min(map(len, groups))
