"""What is around a message's fields: the encapsulation header before them, padding behind them."""

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
    """The fields of a message, and their byte order; ValueError where it does not begin as one."""
    order = ORDERS.get(data[:2]) if len(data) >= HEADER_BYTES else None
    if order is None:
        raise ValueError("it does not begin as plain CDR does")
    return memoryview(data)[HEADER_BYTES:], order


def check_end(body: "memoryview[int]", end: int) -> None:
    """ValueError where a message whose fields end here is longer or shorter."""
    if len(body) != end and len(body) != end + -end % ALIGNMENT:
        raise ValueError(f"it ends at {HEADER_BYTES + end}")
