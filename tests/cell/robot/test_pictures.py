"""Pictures of messages as files that a browser shows."""

import contextlib
import io
import struct
import tracemalloc
from itertools import pairwise
from typing import Any, Final

import pytest
from PIL import Image

from app.cell.robot.pictures import NoPicture, Picture, picture
from app.ros.messages import load_interfaces
from app.system.texts import Text

INTERFACES = load_interfaces("jazzy", ())
COMPRESSED = "sensor_msgs/msg/CompressedImage"
RAW = "sensor_msgs/msg/Image"
MOST = 4096


def file(form: str, size: tuple[int, int] = (4, 3), mode: str = "RGB") -> bytes:
    """A picture file of one colour."""
    packed = io.BytesIO()
    Image.new(mode, size).save(packed, form)
    return packed.getvalue()


JPEG, PNG, WEBP = (file(form) for form in ("JPEG", "PNG", "WEBP"))


def picture_of(type_name: str, **fields: Any) -> Picture:
    return picture(INTERFACES, type_name, INTERFACES.encode(type_name, fields), MOST)


def raw(encoding: str, width: int, height: int, data: bytes, step: int | None = None) -> Picture:
    size = {"width": width, "height": height, "encoding": encoding}
    pixel = {"r": 3, "b": 3}.get(encoding[0], 1) + ("a8" in encoding) if "bayer" not in encoding else 1
    return picture_of(RAW, **size, step=width * pixel if step is None else step, data=data)


def shown(image: Picture) -> Image.Image:
    """The picture as a browser decodes it."""
    assert image.media_type == "image/jpeg"
    return Image.open(io.BytesIO(image.data))


def code_of(error: NoPicture) -> str:
    assert isinstance(error.reason, Text)
    return error.reason.code


@pytest.mark.parametrize(
    ("data", "media_type"), [(JPEG, "image/jpeg"), (PNG, "image/png"), (WEBP, "image/webp")]
)
def test_a_compressed_picture_passes_untouched_by_its_first_bytes(data: bytes, media_type: str) -> None:
    assert picture_of(COMPRESSED, format="whatever it says", data=data) == (media_type, data)


@pytest.mark.parametrize("data", [b"", b"<svg xmlns='x'/>", b"GIF89a", b"RIFF1234WAVE", b"\xff\xd8"])
def test_another_file_is_no_picture(data: bytes) -> None:
    with pytest.raises(NoPicture) as error:
        picture_of(COMPRESSED, format="jpeg", data=data)
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
    image = shown(raw(encoding, 17, 9, data[:-3], step=step))
    assert image.size == (17, 9)
    for at in ((0, 0), (16, 0), (0, 8), (16, 8)):
        shown_pixel = image.convert("RGB").getpixel(at)
        assert isinstance(shown_pixel, tuple)
        assert all(
            abs(actual - other) <= 8 for actual, other in zip(shown_pixel, colour, strict=True)
        ), shown_pixel


@pytest.mark.parametrize(
    ("encoding", "width", "height", "data", "code"),
    [
        ("yuv422_yuy2", 1, 1, bytes(2), "camera_incomplete"),
        ("mono8", MOST + 1, 1, bytes(MOST + 1), "camera_pixels"),
        ("32FC1", 1, 1, bytes(4), "camera_encoding"),
        ("rgb8", 0, 1, b"", "camera_incomplete"),
        ("rgb8", 2, 2, bytes(11), "camera_incomplete"),
        ("mono8", 1, 100_000, bytes(100_000), "camera_pixels"),
    ],
)
def test_fault_of_a_raw_picture_is_named(
    encoding: str, width: int, height: int, data: bytes, code: str
) -> None:
    with pytest.raises(NoPicture) as error:
        raw(encoding, width, height, data)
    assert code_of(error.value) == code


def test_bytes_that_are_no_message_are_no_picture() -> None:
    with pytest.raises(NoPicture) as error:
        picture(INTERFACES, COMPRESSED, b"\x00\x01\x00\x00nonsense", MOST)
    assert code_of(error.value) == "camera_incomplete"


@pytest.mark.parametrize("step", [2, 2**31, 2**32 - 1])
@pytest.mark.parametrize("height", [1, 2, 2**32 - 1])
def test_a_claimed_size_takes_no_memory(step: int, height: int) -> None:
    """Two pixels in a message of a few bytes."""
    tracemalloc.start()
    with contextlib.suppress(NoPicture):
        image = raw("mono8", 2, height, bytes(2), step=step)
        assert shown(image).size == (2, height) == (2, 1)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1_000_000


def with_size(form: str, size: tuple[int, int]) -> bytes:
    """A small JPEG or WebP file whose head claims a size."""
    width, height = size
    if form == "JPEG":
        begin, claimed = b"\xff\xc0", height.to_bytes(2, "big") + width.to_bytes(2, "big")
    else:
        begin, claimed = b"\x9d\x01\x2a", width.to_bytes(2, "little") + height.to_bytes(2, "little")
    made = file(form)
    at = made.index(begin) + (5 if form == "JPEG" else 3)
    return made[:at] + claimed + made[at + 4 :]


@pytest.mark.parametrize("form", ["JPEG", "PNG", "WEBP"])
@pytest.mark.parametrize("size", [(MOST + 1, 1), (1, MOST + 1), (16_383, 16_383)])
def test_a_file_with_more_pixels_than_a_browser_should_draw_is_not_shown(
    form: str, size: tuple[int, int]
) -> None:
    """Only the head is read: the file of 16383 x 16383 pixels would need a gigabyte."""
    head = file(form, size, "1") if form == "PNG" else with_size(form, size)
    tracemalloc.start()
    with pytest.raises(NoPicture) as error:
        picture_of(COMPRESSED, format="any", data=head)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert code_of(error.value) == "camera_pixels"
    assert peak < 5_000_000


@pytest.mark.parametrize("data", [JPEG, PNG, WEBP])
def test_a_damaged_head_is_no_picture(data: bytes) -> None:
    for length in range(12, 30):
        with contextlib.suppress(NoPicture):
            picture_of(COMPRESSED, format="any", data=data[:length])
    for at in range(len(data)):
        damaged = data[:at] + bytes([data[at] ^ 0xFF]) + data[at + 1 :]
        with contextlib.suppress(NoPicture):
            assert picture_of(COMPRESSED, format="any", data=damaged).data == damaged


DEPTHS = [0] * 20 + [800 + number for number in range(400)] + [65_535] * 2  # millimetres


@pytest.mark.parametrize("encoding", ["mono16", "16UC1", "bayer_rggb16"])
@pytest.mark.parametrize("big", [False, True])
def test_sixteen_bits_are_scaled_for_the_eye(encoding: str, big: bool) -> None:
    """A depth camera's picture has 1 % of all 16 bits: as it is, it would be black."""
    data = struct.pack(f"{'>' if big else '<'}{len(DEPTHS)}H", *DEPTHS)
    size = {"width": len(DEPTHS), "height": 1, "step": len(data)}
    image = picture_of(RAW, **size, encoding=encoding, is_bigendian=int(big), data=data)
    assert_scaled(shown(image))


@pytest.mark.parametrize(("depth", "grey"), [(1000, 127), (65535, 127), (0, 0)])
def test_sixteen_bits_that_are_all_alike_are_grey_and_not_black(depth: int, grey: int) -> None:
    data = struct.pack("<64H", *[depth] * 64)
    size = {"width": 8, "height": 8, "step": 16}
    image = shown(picture_of(RAW, **size, encoding="16UC1", is_bigendian=0, data=data)).convert("L")
    low, high = image.getextrema()
    assert isinstance(low, int)
    assert isinstance(high, int)
    assert abs(low - grey) <= 1
    assert abs(high - grey) <= 1


def test_a_compressed_depth_is_scaled_for_the_eye() -> None:
    depths = Image.frombytes("I;16", (len(DEPTHS), 1), struct.pack(f"<{len(DEPTHS)}H", *DEPTHS))
    packed = io.BytesIO()
    depths.save(packed, "PNG")
    for head in (bytes(12), b""):
        image = picture_of(
            COMPRESSED, format="16UC1; compressedDepth png", data=head + packed.getvalue()
        )
        assert_scaled(shown(image))
    with pytest.raises(NoPicture) as error:
        picture_of(
            COMPRESSED, format="16UC1; compressedDepth png", data=bytes(12) + packed.getvalue()[:-30]
        )
    assert code_of(error.value) == "camera_incomplete"


def assert_scaled(image: Image.Image) -> None:
    greys = list(image.convert("L").tobytes())[20:-2]
    assert greys[0] < 40
    assert greys[-1] > 215
    assert all(after > before - 8 for before, after in pairwise(greys))


@pytest.mark.parametrize(
    ("encoding", "order"),
    [("yuv422_yuy2", "yuyv"), ("yuyv", "yuyv"), ("yuv422", "uyvy"), ("uyvy", "uyvy")],
)
def test_yuv_pictures_have_their_colours(encoding: str, order: str) -> None:
    y, u, v = Image.new("RGB", (1, 1), ORANGE).convert("YCbCr").tobytes()
    pair = bytes({"y": y, "u": u, "v": v}[letter] for letter in order)
    size = {"width": 16, "height": 9, "step": 37}
    data = (pair * 8).ljust(37, b"\xff") * 9
    image = shown(picture_of(RAW, **size, encoding=encoding, data=data[:-5])).convert("RGB")
    for at in ((0, 0), (15, 0), (0, 8), (15, 8)):
        pixel = image.getpixel(at)
        assert isinstance(pixel, tuple)
        assert all(abs(a - b) <= 8 for a, b in zip(pixel, ORANGE, strict=True)), pixel
