"""What was received lately: bounded by its age and by its bytes."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from app.robot.state import Sample

OVERHEAD_BYTES: Final = 512  # bytes that a sample costs beside its payload
COPY_BELOW_BYTES: Final = (
    64 * 1024
)  # a smaller payload would keep the whole buffer that it was received in


@dataclass(frozen=True, slots=True)
class Buffered:
    """A sample of the topic with this key; `size` is in bytes, with what it costs to keep."""

    key: str
    sample: Sample
    size: int


def to_buffered(key: str, sample: Sample) -> Buffered:
    """A large payload is not copied: who writes it turns it into bytes."""
    length = len(sample.payload)
    if length < COPY_BELOW_BYTES:
        sample = sample._replace(payload=bytes(sample.payload))
    return Buffered(key, sample, length + OVERHEAD_BYTES)


class RingBuffer:
    """The newest samples, at most `longest_s` seconds and `most` bytes of them."""

    def __init__(self, longest_s: float, most: int) -> None:
        self._max_age_s = longest_s
        self._max_bytes = most
        self._samples: deque[Buffered] = deque()
        self.size = 0

    def add(self, one: Buffered) -> None:
        """Takes a sample; one that is larger than the ring is not kept, and what came before is."""
        if one.size <= self._max_bytes and self._max_age_s > 0:
            self._samples.append(one)
            self.size += one.size
        self._drop_old(one.sample.at)

    def recent(self, now: float) -> Iterator[Buffered]:
        """What is not older than `longest_s` at `now` (monotonic seconds), oldest first."""
        self._drop_old(now)
        yield from self._samples

    def _drop_old(self, now: float) -> None:
        while self._samples and (
            self.size > self._max_bytes or now - self._samples[0].sample.at > self._max_age_s
        ):
            self.size -= self._samples.popleft().size
