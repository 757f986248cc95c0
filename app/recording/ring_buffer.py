"""The latest samples, limited by age and bytes."""

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from app.robot.state import Sample

OVERHEAD_BYTES: Final = 512  # memory of a sample besides its payload
COPY_BELOW_BYTES: Final = (
    64 * 1024
)  # a smaller payload is copied, so that it does not keep its receive buffer


@dataclass(frozen=True, slots=True)
class Buffered:
    """A sample of the topic `key`; `size` is its memory in bytes."""

    key: str
    sample: Sample
    size: int


def times_of(sample: Sample) -> tuple[int, int]:
    """When a sample was received and sent, in nanoseconds since the epoch."""
    received = round(sample.wall * 1e9)
    return received, received if sample.sent is None else round(sample.sent * 1e6) * 1000


def to_buffered(key: str, sample: Sample) -> Buffered:
    """The sample to be buffered. A large payload is not copied until it is written."""
    length = len(sample.payload)
    if length < COPY_BELOW_BYTES:
        sample = sample._replace(payload=bytes(sample.payload))
    return Buffered(key, sample, length + OVERHEAD_BYTES)


class RingBuffer:
    """The newest samples: at most `max_age_s` seconds and `max_bytes` bytes."""

    def __init__(self, max_age_s: float, max_bytes: int) -> None:
        self._max_age_s = max_age_s
        self._max_bytes = max_bytes
        self._samples: deque[Buffered] = deque()
        self.size = 0

    def add(self, buffered: Buffered) -> None:
        """Adds a sample. One that is larger than the ring is ignored; the others are kept."""
        if buffered.size <= self._max_bytes and self._max_age_s > 0:
            self._samples.append(buffered)
            self.size += buffered.size
        self._drop_old(buffered.sample.at)

    def recent(self, now: float, most_s: float = math.inf) -> Iterator[Buffered]:
        """The samples that are at most `max_age_s`, and `most_s`, old at `now` (monotonic seconds),
        oldest first."""
        self._drop_old(now)
        yield from (buffered for buffered in self._samples if now - buffered.sample.at <= most_s)

    def _drop_old(self, now: float) -> None:
        while self._samples and (
            self.size > self._max_bytes or now - self._samples[0].sample.at > self._max_age_s
        ):
            self.size -= self._samples.popleft().size
