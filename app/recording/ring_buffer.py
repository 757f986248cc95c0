"""What was received lately: bounded by its age and by its bytes."""

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from app.robot.state import Sample

OVERHEAD: Final = 512  # bytes that a sample costs beside its payload
COPIED: Final = 64 * 1024  # a smaller payload would keep the whole buffer that it was received in


@dataclass(frozen=True, slots=True)
class Buffered:
    """A sample of the topic with this key; `size` is in bytes, with what it costs to keep."""

    key: str
    sample: Sample
    size: int


def buffered(key: str, sample: Sample) -> Buffered:
    """A large payload is not copied: who writes it turns it into bytes."""
    length = len(sample.payload)
    if length < COPIED:
        sample = sample._replace(payload=bytes(sample.payload))
    return Buffered(key, sample, length + OVERHEAD)


class RingBuffer:
    """The newest samples, at most `longest_s` seconds and `most` bytes of them."""

    def __init__(self, longest_s: float, most: int) -> None:
        self._longest_s = longest_s
        self._most = most
        self._kept: deque[Buffered] = deque()
        self.size = 0

    def add(self, one: Buffered) -> None:
        """Takes a sample; one that is larger than the ring is not kept, and what came before is."""
        if one.size <= self._most and self._longest_s > 0:
            self._kept.append(one)
            self.size += one.size
        self._forget(one.sample.at)

    def since(self, now: float) -> Iterator[Buffered]:
        """What is not older than `longest_s` at `now` (monotonic seconds), oldest first."""
        self._forget(now)
        yield from self._kept

    def _forget(self, now: float) -> None:
        while self._kept and (
            self.size > self._most or now - self._kept[0].sample.at > self._longest_s
        ):
            self.size -= self._kept.popleft().size
