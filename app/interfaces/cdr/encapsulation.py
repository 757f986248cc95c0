"""The encapsulation header before a message's fields, and the padding after them."""

from collections.abc import Mapping
from typing import Final

from app.interfaces.cdr.formats import HEADER_BYTES
from app.interfaces.cdr.reader import ByteOrder

LITTLE_ENDIAN_HEADER: Final = b"\0\1\0\0"
ORDERS: Final[Mapping[bytes, ByteOrder]] = {
    b"\0\0": ">",
    b"\0\1": "<",
}  # the last two bytes are options
ALIGNMENT: Final = 4  # bytes: a message may be padded to a multiple of it (RTPS 2.5, 9.4.2.12)


def split_header(data: bytes) -> "tuple[memoryview[int], ByteOrder]":
    """(bytes of the fields, byte order) of a message; ValueError if the header is not plain CDR."""
    order = ORDERS.get(data[:2]) if len(data) >= HEADER_BYTES else None
    if order is None:
        raise ValueError("it does not begin as plain CDR does")
    return memoryview(data)[HEADER_BYTES:], order


def check_end(body: "memoryview[int]", end: int) -> None:
    """ValueError unless the message ends at `end`, or after padding."""
    if len(body) != end and len(body) != end + -end % ALIGNMENT:
        raise ValueError(f"it ends at {HEADER_BYTES + end}")
