"""Pictures of `sensor_msgs` messages as files that a browser shows: pure.

A compressed one passes through untouched; its head says what it is, and how large. A raw one, and one
with 16 bits, becomes a JPEG file: 640 x 480 pixels have 900 kB as they are, and 165 kB in 4 ms.
"""

import io
import math
from array import array
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from app.ros.messages import Interfaces
from app.system.errors import DecodeError
from app.system.texts import TextLike, say

if TYPE_CHECKING:
    from PIL.Image import Image  # takes 60 ms to load, and few panels show pictures

QUALITY: Final = 85
RAW: Final = "sensor_msgs/msg/Image"
COMPRESSED: Final = "sensor_msgs/msg/CompressedImage"
FORMATS: Final = {"JPEG": "image/jpeg", "PNG": "image/png", "WEBP": "image/webp"}
PNG: Final = b"\x89PNG\r\n\x1a\n"
DEPTH_HEAD: Final = 12  # bytes before the PNG file of image_transport's compressedDepth
GREYS: Final = 256
OUTLIERS: Final = 0.01  # of the pixels, at each end: darker or brighter than the rest


class Picture(NamedTuple):
    """A file, and its media type."""

    media_type: str
    data: bytes


@dataclass(frozen=True, slots=True)
class NoPicture(Exception):
    """Why a message has none that can be shown."""

    reason: TextLike


class Raw(NamedTuple):
    """The rows of a raw picture, `step` bytes each; the last one may be shorter."""

    data: bytes
    width: int
    height: int
    step: int
    is_bigendian: bool

    def rows(self, size: int) -> bytes:
        """The rows of pixels of `size` bytes, without what stands between them."""
        row = self.width * size
        if self.step == row:
            return self.data[: row * self.height]
        return b"".join(self.data[i * self.step :][:row] for i in range(self.height))


def _eight_bit(order: str, raw: Raw) -> "Image":
    """Pixels of bytes in this order, as Pillow names it. An alpha channel is left out: nothing lies
    behind a camera's picture."""
    from PIL import Image

    mode = "L" if order == "L" else "RGB"
    whole = raw.data.ljust(raw.step * raw.height, b"\0")
    return Image.frombuffer(mode, (raw.width, raw.height), whole, "raw", order, raw.step, 1)


def _sixteen_bit(raw: Raw) -> "Image":
    """Grey pixels of 16 bits: brightness, or a depth in millimetres."""
    from PIL import Image

    rows = raw.rows(2)
    if raw.is_bigendian:
        swapped = array("H", rows)
        swapped.byteswap()
        rows = swapped.tobytes()
    return _scaled(Image.frombuffer("I;16", (raw.width, raw.height), rows, "raw", "I;16", 0, 1))


def _scaled(image: "Image") -> "Image":
    """A picture with 16 bits in the greys that the eye can tell apart: from the darkest to the
    brightest, without the outermost hundredth of the pixels and those of 0, which have no depth."""
    numbers = image.convert("I")
    low, high = _range(numbers)
    if high <= low:  # all pixels are alike
        from PIL import Image

        return Image.new("L", image.size, GREYS // 2 if high else 0)
    factor = (GREYS - 1) / (high - low)
    return numbers.point(lambda value: value * factor - low * factor).convert("L")


def _range(numbers: "Image") -> tuple[int, int]:
    """The darkest and the brightest number of the picture, without outliers."""
    low, high = numbers.getextrema()
    assert isinstance(low, int)
    assert isinstance(high, int)
    for _ in range(2):  # 256 bins may be too wide while there are outliers
        counts = numbers.histogram(None, (low, high))
        if low == 0:
            counts[0] = 0
        least = sum(counts) * OUTLIERS
        width = (high - low) / GREYS
        dark, bright = _first(counts, least), _first(counts[::-1], least)
        low, high = math.floor(low + width * dark), math.ceil(high - width * bright)
    return low, high


def _first(counts: list[int], least: float) -> int:
    """The first bin at which more than `least` pixels have been counted."""
    counted = 0
    for number, count in enumerate(counts):
        counted += count
        if counted > least:
            return number
    return 0


def _yuv(y: int, u: int, v: int, raw: Raw) -> "Image":
    """Two pixels in four bytes, with their brightness from `y` on and one colour."""
    from PIL import Image

    if raw.width % 2:
        raise NoPicture(say("camera_incomplete", wanted=RAW))
    rows = raw.rows(2)
    whole, half = (raw.width, raw.height), (raw.width // 2, raw.height)
    colours = [
        Image.frombuffer("L", half, rows[at::4], "raw", "L", 0, 1).resize(whole) for at in (u, v)
    ]
    brightness = Image.frombuffer("L", whole, rows[y::2], "raw", "L", 0, 1)
    return Image.merge("YCbCr", (brightness, *colours))


class Encoding(NamedTuple):
    """A raw encoding: bytes of a pixel, and the function that makes a picture of its rows."""

    size: int
    draw: Callable[[Raw], "Image"]


MOSAICS: Final = ("rggb", "bggr", "gbrg", "grbg")
# A mosaic of colours is shown as what it is: grey, each pixel behind its own filter.
ENCODINGS: Final = {
    "rgb8": Encoding(3, partial(_eight_bit, "RGB")),
    "rgba8": Encoding(4, partial(_eight_bit, "RGBX")),
    **dict.fromkeys(("bgr8", "8UC3"), Encoding(3, partial(_eight_bit, "BGR"))),
    **dict.fromkeys(("bgra8", "8UC4"), Encoding(4, partial(_eight_bit, "BGRX"))),
    **dict.fromkeys(
        ("mono8", "8UC1", *(f"bayer_{mosaic}8" for mosaic in MOSAICS)),
        Encoding(1, partial(_eight_bit, "L")),
    ),
    **dict.fromkeys(
        ("mono16", "16UC1", *(f"bayer_{mosaic}16" for mosaic in MOSAICS)), Encoding(2, _sixteen_bit)
    ),
    **dict.fromkeys(("yuv422_yuy2", "yuyv"), Encoding(2, partial(_yuv, 0, 1, 3))),
    **dict.fromkeys(("yuv422", "uyvy"), Encoding(2, partial(_yuv, 1, 0, 2))),
}


def picture(interfaces: Interfaces, type_name: str, payload: bytes, most: int) -> Picture:
    """The picture of a message with at most `most` pixels a side; `NoPicture` says what is wrong."""
    try:
        message = interfaces.decode(type_name, payload)
    except DecodeError:
        raise NoPicture(say("camera_incomplete", wanted=type_name)) from None
    if type_name == RAW:
        return raw(message, most)
    return compressed(bytes(message.data), most)


def compressed(data: bytes, most: int) -> Picture:
    """A JPEG, PNG or WebP file as it is, if its head says that it is not too large for a browser."""
    file = data[DEPTH_HEAD:] if data[DEPTH_HEAD:].startswith(PNG) else data
    image = _opened(file)
    _check_size(*image.size, most)
    if image.mode.startswith("I"):  # a browser would show its eight upper bits: a depth is all black
        return _decoded(image)
    return Picture(FORMATS.get(image.format or "", "image/jpeg"), file)  # an MPO file is a JPEG file


def _opened(file: bytes) -> "Image":
    """A file whose head is read."""
    from PIL import Image, UnidentifiedImageError

    Image.MAX_IMAGE_PIXELS = None  # `_check_size` limits them
    try:
        return Image.open(io.BytesIO(file), formats=tuple(FORMATS))
    except UnidentifiedImageError:
        raise NoPicture(say("camera_format")) from None
    except Exception:  # a damaged head
        raise NoPicture(say("camera_incomplete", wanted=COMPRESSED)) from None


def _decoded(image: "Image") -> Picture:
    try:
        image.load()
    except Exception:  # a damaged file
        raise NoPicture(say("camera_incomplete", wanted=COMPRESSED)) from None
    return _packed(_scaled(image))


def raw(message: Any, most: int) -> Picture:
    """A raw picture as a JPEG file."""
    width, height, step = message.width, message.height, message.step
    encoding = ENCODINGS.get(message.encoding)
    if encoding is None:
        raise NoPicture(say("camera_encoding", encoding=str(message.encoding)[:40]))
    row = width * encoding.size
    # Nothing is made by a size that the message only claims: `step` says little about a single row.
    step = row if height == 1 and step >= row else step
    if not (width > 0 and height > 0 and row <= step) or len(message.data) < step * (height - 1) + row:
        raise NoPicture(say("camera_incomplete", wanted=RAW))
    _check_size(width, height, most)
    data = bytes(message.data[: step * height])
    return _packed(encoding.draw(Raw(data, width, height, step, bool(message.is_bigendian))))


def _check_size(width: int, height: int, most: int) -> None:
    if max(width, height) > most:
        raise NoPicture(say("camera_pixels", width=width, height=height, most=most))


def _packed(image: "Image") -> Picture:
    file = io.BytesIO()
    image.save(file, "JPEG", quality=QUALITY)
    return Picture("image/jpeg", file.getvalue())
