"""Pictures of `sensor_msgs` messages as files that a browser shows: pure.

A compressed one passes through untouched, and its first bytes say what it is. A raw one becomes a
bitmap (BMP): a browser shows it, and making one copies bytes and no more. PNG takes the tenfold time
to pack them.
"""

import struct
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from app.errors import DecodeError
from app.i18n import TextLike, say
from app.interfaces import Interfaces

LARGEST: Final = 16_384  # pixels of a side
RAW: Final = "sensor_msgs/msg/Image"


class Picture(NamedTuple):
    """A file, and its media type."""

    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class NoPicture(Exception):
    """Why a message has none that can be shown."""

    reason: TextLike


class Layout(NamedTuple):
    """Of a raw encoding: bytes of a pixel, and whether red and blue change places in a bitmap."""

    bytes: int
    swapped: bool


# A mosaic of colours is shown as what it is: grey, each pixel behind its own filter.
ENCODINGS: Final = {
    "bgr8": Layout(3, False),
    "rgb8": Layout(3, True),
    "bgra8": Layout(4, False),
    "rgba8": Layout(4, True),
    "8UC3": Layout(3, False),
    "8UC4": Layout(4, False),
    **dict.fromkeys(
        ("mono8", "8UC1", "bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"),
        Layout(1, False),
    ),
}
GREYS: Final = b"".join(bytes((grey, grey, grey, 0)) for grey in range(256))


def picture(interfaces: Interfaces, type_name: str, payload: bytes) -> Picture:
    """The picture of a message; `NoPicture` says what is wrong with it."""
    try:
        message = interfaces.decode(type_name, payload)
    except DecodeError:
        raise NoPicture(say("camera_broken", wanted=type_name)) from None
    return raw(message) if type_name == RAW else compressed(bytes(message.data))


def compressed(data: bytes) -> Picture:
    """A JPEG, PNG or WebP file as it is, by its first bytes."""
    if data.startswith(b"\xff\xd8\xff"):
        return Picture("image/jpeg", data)
    if data.startswith(b"\x89PNG\r\n\x1a\n"):
        return Picture("image/png", data)
    if data.startswith(b"RIFF") and data[8:12] == b"WEBP":
        return Picture("image/webp", data)
    raise NoPicture(say("camera_format"))


def raw(message: Any) -> Picture:
    """A raw picture as a bitmap."""
    width, height, step = message.width, message.height, message.step
    layout = ENCODINGS.get(message.encoding)
    if layout is None:
        raise NoPicture(say("camera_encoding", encoding=str(message.encoding)[:40]))
    row = width * layout.bytes
    if not (0 < width <= LARGEST and 0 < height <= LARGEST and row <= step):
        raise NoPicture(say("camera_broken", wanted=RAW))
    if len(message.data) < step * (height - 1) + row:
        raise NoPicture(say("camera_broken", wanted=RAW))
    return Picture("image/bmp", _bitmap(bytes(message.data), width, height, step, layout))


def _bitmap(data: bytes, width: int, height: int, step: int, layout: Layout) -> bytes:
    """Rows from the top, each filled up to four bytes."""
    row = width * layout.bytes
    padding = bytes(-row % 4)
    if step == row and not padding:
        pixels = bytearray(data[: row * height])
    else:
        rows = (data[y * step : y * step + row] + padding for y in range(height))
        pixels = bytearray(b"".join(rows))
    if layout.swapped:
        _swap(pixels, row + len(padding), len(padding), layout.bytes)
    palette = GREYS if layout.bytes == 1 else b""
    at = 54 + len(palette)
    bits = 8 * layout.bytes
    about = struct.pack("<IiiHHIIiiII", 40, width, -height, 1, bits, 0, 0, 2835, 2835, 0, 0)
    return struct.pack("<2sIHHI", b"BM", at + len(pixels), 0, 0, at) + about + palette + pixels


def _swap(pixels: bytearray, row: int, padding: int, size: int) -> None:
    """Red and blue change places; the padding keeps pixels of one row from those of the next."""
    if not padding:
        pixels[0::size], pixels[2::size] = pixels[2::size], pixels[0::size]
        return
    for at in range(0, len(pixels), row):
        end = at + row - padding
        first, third = pixels[at:end:size], pixels[at + 2 : end : size]
        pixels[at:end:size], pixels[at + 2 : end : size] = third, first
