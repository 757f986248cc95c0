"""Pictures of `sensor_msgs` messages as files that a browser shows: pure.

A compressed one passes through untouched, and its first bytes say what it is. A raw one becomes a JPEG
file: 640 x 480 pixels have 900 kB as they are, and 165 kB in 4 ms.
"""

import io
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from app.errors import DecodeError
from app.i18n import TextLike, say
from app.interfaces import Interfaces

LARGEST: Final = 16_384  # pixels of a side
QUALITY: Final = 85
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
    """Of a raw encoding: bytes of a pixel, and Pillow's name of their order. An alpha channel is left
    out: nothing lies behind a camera's picture."""

    size: int
    order: str


# A mosaic of colours is shown as what it is: grey, each pixel behind its own filter.
ENCODINGS: Final = {
    "rgb8": Layout(3, "RGB"),
    "bgr8": Layout(3, "BGR"),
    "rgba8": Layout(4, "RGBX"),
    "bgra8": Layout(4, "BGRX"),
    "8UC3": Layout(3, "BGR"),
    "8UC4": Layout(4, "BGRX"),
    **dict.fromkeys(
        ("mono8", "8UC1", "bayer_rggb8", "bayer_bggr8", "bayer_gbrg8", "bayer_grbg8"), Layout(1, "L")
    ),
}


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
    """A raw picture as a JPEG file."""
    width, height, step = message.width, message.height, message.step
    layout = ENCODINGS.get(message.encoding)
    if layout is None:
        raise NoPicture(say("camera_encoding", encoding=str(message.encoding)[:40]))
    row = width * layout.size
    fits = 0 < width <= LARGEST and 0 < height <= LARGEST and row <= step
    if not fits or len(message.data) < step * (height - 1) + row:
        raise NoPicture(say("camera_broken", wanted=RAW))
    return Picture("image/jpeg", _packed(bytes(message.data), width, height, step, layout.order))


def _packed(data: bytes, width: int, height: int, step: int, order: str) -> bytes:
    """Rows of `step` bytes, the last of which may be shorter."""
    from PIL import Image  # takes 60 ms to load, and few panels show raw pictures

    whole = data.ljust(step * height, b"\0")
    mode = "L" if order == "L" else "RGB"
    file = io.BytesIO()
    Image.frombuffer(mode, (width, height), whole, "raw", order, step, 1).save(
        file, "JPEG", quality=QUALITY
    )
    return file.getvalue()
