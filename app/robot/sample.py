"""What comes of a topic, as it came."""

from typing import NamedTuple, Protocol


class Buffer(Protocol):
    """Bytes, or what becomes bytes when asked (Zenoh's buffers: no copy until then)."""

    def __bytes__(self) -> bytes: ...
    def __len__(self) -> int: ...


class SkippedPayload(NamedTuple):
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
    skipped_payloads: tuple[SkippedPayload, ...] = ()
    overrun: bool = False
