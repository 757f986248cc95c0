"""Pictures of messages as files that a browser shows."""

import io
from typing import Any, Final

import pytest
from PIL import Image

from app.i18n import Text
from app.interfaces import load_interfaces
from app.robot.pictures import NoPicture, Picture, picture

INTERFACES = load_interfaces("jazzy", ())
COMPRESSED = "sensor_msgs/msg/CompressedImage"
RAW = "sensor_msgs/msg/Image"
JPEG = b"\xff\xd8\xff\xe0" + bytes(40)
WEBP = b"RIFF\x10\x00\x00\x00WEBPVP8 " + bytes(8)
PNG = b"\x89PNG\r\n\x1a\n" + bytes(30)


def of(type_name: str, **fields: Any) -> Picture:
    return picture(INTERFACES, type_name, INTERFACES.encode(type_name, fields))


def raw(encoding: str, width: int, height: int, data: bytes, step: int | None = None) -> Picture:
    size = {"width": width, "height": height, "encoding": encoding}
    pixel = {"r": 3, "b": 3}.get(encoding[0], 1) + ("a8" in encoding) if "bayer" not in encoding else 1
    return of(RAW, **size, step=width * pixel if step is None else step, data=data)


def shown(found: Picture) -> Image.Image:
    """The picture as a browser decodes it."""
    assert found.media_type == "image/jpeg"
    return Image.open(io.BytesIO(found.data))


def code_of(error: NoPicture) -> str:
    assert isinstance(error.reason, Text)
    return error.reason.code


@pytest.mark.parametrize(
    ("data", "media_type"), [(JPEG, "image/jpeg"), (PNG, "image/png"), (WEBP, "image/webp")]
)
def test_a_compressed_picture_passes_untouched_by_its_first_bytes(data: bytes, media_type: str) -> None:
    assert of(COMPRESSED, format="whatever it says", data=data) == (media_type, data)


@pytest.mark.parametrize("data", [b"", b"<svg xmlns='x'/>", b"GIF89a", b"RIFF1234WAVE", b"\xff\xd8"])
def test_another_file_is_no_picture(data: bytes) -> None:
    with pytest.raises(NoPicture) as error:
        of(COMPRESSED, format="jpeg", data=data)
    assert code_of(error.value) == "camera_format"


ORANGE: Final = (250, 130, 10)
GREY: Final = (90, 90, 90)


@pytest.mark.parametrize(
    ("encoding", "pixel", "colour"),
    [
        ("rgb8", bytes(ORANGE), ORANGE),
        ("bgr8", bytes(ORANGE[::-1]), ORANGE),
        ("8UC3", bytes(ORANGE[::-1]), ORANGE),
        ("rgba8", bytes((*ORANGE, 0)), ORANGE),
        ("bgra8", bytes((*ORANGE[::-1], 0)), ORANGE),
        ("8UC4", bytes((*ORANGE[::-1], 0)), ORANGE),
        ("mono8", b"\x5a", GREY),
        ("bayer_rggb8", b"\x5a", GREY),
    ],
)
def test_a_raw_picture_has_its_colours(encoding: str, pixel: bytes, colour: tuple[int, ...]) -> None:
    """Rows are longer than their pixels, and the last one ends with its last pixel."""
    step = len(pixel) * 17 + 3
    data = (pixel * 17).ljust(step, b"\xff") * 9
    found = shown(raw(encoding, 17, 9, data[:-3], step=step))
    assert found.size == (17, 9)
    for at in ((0, 0), (16, 0), (0, 8), (16, 8)):
        shown_pixel = found.convert("RGB").getpixel(at)
        assert isinstance(shown_pixel, tuple)
        assert all(abs(one - other) <= 8 for one, other in zip(shown_pixel, colour, strict=True)), (
            shown_pixel
        )


@pytest.mark.parametrize(
    ("encoding", "width", "height", "data", "code"),
    [
        ("mono16", 1, 1, b"\0\0", "camera_encoding"),
        ("32FC1", 1, 1, bytes(4), "camera_encoding"),
        ("rgb8", 0, 1, b"", "camera_broken"),
        ("rgb8", 2, 2, bytes(11), "camera_broken"),
        ("mono8", 100_000, 1, bytes(100_000), "camera_broken"),
    ],
)
def test_what_is_wrong_with_a_raw_picture_is_said(
    encoding: str, width: int, height: int, data: bytes, code: str
) -> None:
    with pytest.raises(NoPicture) as error:
        raw(encoding, width, height, data)
    assert code_of(error.value) == code


def test_bytes_that_are_no_message_are_no_picture() -> None:
    with pytest.raises(NoPicture) as error:
        picture(INTERFACES, COMPRESSED, b"\x00\x01\x00\x00nonsense")
    assert code_of(error.value) == "camera_broken"
