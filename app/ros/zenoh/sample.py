"""Received messages, undecoded."""

from typing import NamedTuple, Protocol


class Buffer(Protocol):
    """Bytes, or a Zenoh buffer, which is copied only by `bytes()`."""

    def __bytes__(self) -> bytes: ...
    def __len__(self) -> int: ...


class SkippedPayload(NamedTuple):
    """The payload of a skipped sample, with its times as in `Sample`."""

    payload: Buffer
    at: float
    wall: float


class Sample(NamedTuple):
    """One received message: `at` in monotonic seconds, `wall` in seconds since the epoch.

    `source` is the zid of the peer that sent it (from its timestamp), None if unknown. `seq` orders
    samples and losses of peers as this session received them. `sent` is the timestamp of the sender's
    clock, in seconds since the epoch, None without one and where it was not read. `skipped` is the
    number of messages just before it that were not read; for lossless topics `skipped_payloads` are
    their payloads, and `overrun` is true if there were even more. `cached`: it is from a cache,
    published at an unknown time. `sender` is set for a sample that no peer has stamped: the zid in its
    timestamp, "" without one.
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
    cached: bool = False
    sender: str | None = None
