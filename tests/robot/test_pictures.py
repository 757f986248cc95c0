"""Pictures of messages as files that a browser shows."""

import struct
from typing import Any

import pytest

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


def pixels(bitmap: bytes) -> list[list[tuple[int, ...]]]:
    """Rows from the top of (blue, green, red…) or of the grey that the palette has."""
    (at,) = struct.unpack_from("<I", bitmap, 10)
    width, height, _, bits = struct.unpack_from("<iiHH", bitmap, 18)
    size, rows = bits // 8, -height
    stride = (width * size + 3) // 4 * 4
    assert len(bitmap) == at + stride * rows
    assert struct.unpack_from("<I", bitmap, 2) == (len(bitmap),)
    return [
        [
            tuple(bitmap[at + y * stride + x * size : at + y * stride + (x + 1) * size])
            for x in range(width)
        ]
        for y in range(rows)
    ]


@pytest.mark.parametrize(
    ("data", "media_type"), [(JPEG, "image/jpeg"), (PNG, "image/png"), (WEBP, "image/webp")]
)
def test_a_compressed_picture_passes_untouched_by_its_first_bytes(data: bytes, media_type: str) -> None:
    assert of(COMPRESSED, format="whatever it says", data=data) == (media_type, data)


@pytest.mark.parametrize("data", [b"", b"<svg xmlns='x'/>", b"GIF89a", b"RIFF1234WAVE", b"\xff\xd8"])
def test_another_file_is_no_picture(data: bytes) -> None:
    with pytest.raises(NoPicture) as error:
        of(COMPRESSED, format="jpeg", data=data)
    assert error.value.reason.code == "camera_format"  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("encoding", "data", "first", "last"),
    [
        ("bgr8", bytes(range(18)), (0, 1, 2), (15, 16, 17)),
        ("rgb8", bytes(range(18)), (2, 1, 0), (17, 16, 15)),
        ("bgra8", bytes(range(24)), (0, 1, 2, 3), (20, 21, 22, 23)),
        ("rgba8", bytes(range(24)), (2, 1, 0, 3), (22, 21, 20, 23)),
        ("mono8", bytes(range(6)), (0,), (5,)),
        ("bayer_rggb8", bytes(range(6)), (0,), (5,)),
    ],
)
def test_a_raw_picture_is_a_bitmap(
    encoding: str, data: bytes, first: tuple[int, ...], last: tuple[int, ...]
) -> None:
    """Three by two pixels: rows that are filled up, and both ends of red and blue."""
    found = raw(encoding, 3, 2, data)
    assert found.media_type == "image/bmp"
    rows = pixels(found.data)
    assert (rows[0][0], rows[1][2]) == (first, last)


def test_rows_with_more_bytes_than_pixels_are_cut() -> None:
    rows = pixels(raw("mono8", 2, 2, b"\x01\x02\xff\xff\x03\x04", step=4).data)
    assert rows == [[(1,), (2,)], [(3,), (4,)]]


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
    assert error.value.reason.code == code  # type: ignore[union-attr]


def test_bytes_that_are_no_message_are_no_picture() -> None:
    with pytest.raises(NoPicture) as error:
        picture(INTERFACES, COMPRESSED, b"\x00\x01\x00\x00nonsense")
    assert error.value.reason.code == "camera_broken"  # type: ignore[union-attr]
