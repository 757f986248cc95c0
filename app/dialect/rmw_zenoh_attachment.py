"""The attachments of rmw_zenoh's messages, requests and responses. Pure.

A node ends when it receives one that is malformed, so all that leave are made here.
"""

import struct
from hashlib import blake2b
from typing import Final, NamedTuple

GID_BYTES: Final = 16
_FORM: Final = struct.Struct(f"<qqB{GID_BYTES}s")  # the byte is the length of what follows
HEADER_BYTES: Final = 4  # of a message: how the rest is encoded
ENCODINGS: Final = (b"\x00\x01", b"\x00\x00")  # its first bytes: CDR, little or big endian


class Attachment(NamedTuple):
    """`number` counts from 1 what `gid`, a publisher or client, has sent; `at_ns` is when it was sent,
    in nanoseconds since the epoch."""

    number: int
    at_ns: int
    gid: bytes


def attachment(number: int, at_ns: int, gid: bytes) -> bytes:
    """33 bytes. ValueError for what a node would not take: numbers below 1, a negative time, a gid of
    another length."""
    if number < 1 or at_ns < 0 or len(gid) != GID_BYTES:
        raise ValueError(f"no attachment has number {number}, time {at_ns} and {len(gid)} bytes of gid")
    return _FORM.pack(number, at_ns, GID_BYTES, gid)


def parse_attachment(data: bytes) -> Attachment | None:
    """The parts; None for what is malformed."""
    if len(data) != _FORM.size:
        return None
    number, at_ns, length, gid = _FORM.unpack(data)
    return Attachment(number, at_ns, gid) if length == GID_BYTES and number >= 0 <= at_ns else None


def gid_of(zid: str, expression: str) -> bytes:
    """The gid of a session's publisher or client on a key expression: no other one has it."""
    return blake2b(f"{zid}/{expression}".encode(), digest_size=GID_BYTES).digest()


def is_whole(payload: bytes) -> bool:
    """Whether a payload begins as CDR does and has something behind its header: a node that reads
    less ends."""
    return len(payload) > HEADER_BYTES and payload[:2] in ENCODINGS
