"""Layers of a map: shapes of messages, whatever their bytes are."""

import math
import struct
from typing import Any, Final

import pytest

from app.cell.robot.map_layers import (
    MAX_BEAMS,
    MAX_CORNERS,
    MAX_PATH_POINTS,
    POLYGON_TYPE,
    POSE_TYPE,
    READERS,
    SCAN_TYPE,
    Shape,
    placed,
    read_shape,
)
from app.cell.robot.maps import NoMap
from app.cell.robot.transforms import Quaternion, Transform
from app.panel.widgets.map_layers import GRID_TYPE, LAYERS
from app.ros.cdr.stamped import PATH_TYPE, read_path
from app.system.errors import DecodeError
from app.system.texts import Text
from tests.support.builders import INTERFACES

HEADER: Final = {"frame_id": "odom", "stamp": {"sec": 7, "nanosec": 500_000_000}}
COUNT: Final = struct.Struct("<I")


def shape(type_name: str, fields: Any) -> Shape:
    return read_shape(INTERFACES, type_name, INTERFACES.encode(type_name, {"header": HEADER, **fields}))


def refused(type_name: str, payload: bytes) -> str:
    """The code of the reason."""
    with pytest.raises(NoMap) as error:
        read_shape(INTERFACES, type_name, payload)
    assert isinstance(error.value.reason, Text)
    return error.value.reason.code


def path_of(*places: tuple[float, float], frame: str = "odom") -> dict[str, Any]:
    poses = [{"header": {"frame_id": frame}, "pose": {"position": {"x": x, "y": y}}} for x, y in places]
    return {"poses": poses}


def scan_of(*ranges: float, **keys: Any) -> dict[str, Any]:
    limits = {"range_min": 0.1, "range_max": 10.0, "angle_increment": math.pi / 2}
    return {"ranges": list(ranges), **limits, **keys}


def test_each_kind_of_layer_has_a_reader() -> None:
    assert {row.type for row in LAYERS.values()} - {GRID_TYPE} == {*READERS}


def test_a_path_has_its_places() -> None:
    path = shape(PATH_TYPE, path_of((1.0, 2.0), (3.0, 4.0)))
    assert (path.frame, path.stamp, [*path.points]) == ("odom", 7.5, [1.0, 2.0, 3.0, 4.0])
    assert [*shape(PATH_TYPE, path_of()).points] == []


def test_a_path_is_read_in_both_byte_orders_and_with_frames_of_any_length() -> None:
    for name in ("", "m", "map", "a_longer_name"):
        data = INTERFACES.encode(PATH_TYPE, {"header": HEADER, **path_of((1.0, 2.0), frame=name)})
        assert [*read_path(data, 10).points] == [1.0, 2.0]
    parts = (7, 0, 5, b"odom\0", 1, 0, 0, 4, b"map\0", *range(7))
    swapped = b"\0\0\0\0" + struct.pack(">iII5s3xIiII4s7d", *parts)
    assert (read_path(swapped, 10).frame, [*read_path(swapped, 10).points]) == ("odom", [0.0, 1.0])


def test_a_long_path_is_thinned_and_keeps_its_ends() -> None:
    path = shape(PATH_TYPE, path_of(*((float(at), 0.0) for at in range(5_003))))
    assert len(path.points) // 2 <= MAX_PATH_POINTS + 1
    assert (path.points[0], path.points[-2]) == (0.0, 5_002.0)


def test_a_path_of_a_million_poses_is_not_read() -> None:
    data = INTERFACES.encode(PATH_TYPE, {"header": HEADER, **path_of(*[(0.0, 0.0)] * 10)})
    assert refused(PATH_TYPE, data + bytes(72_000_000)) == "map_layer_large"


@pytest.mark.parametrize("claimed", [2, 1_000_000, 2**32 - 1])
def test_a_path_that_claims_more_poses_than_it_has_is_refused(claimed: int) -> None:
    data = bytearray(INTERFACES.encode(PATH_TYPE, {"header": HEADER, **path_of((1.0, 2.0))}))
    at = data.index(b"odom\0") + 8
    assert COUNT.unpack_from(data, at) == (1,)
    COUNT.pack_into(data, at, claimed)
    assert refused(PATH_TYPE, bytes(data)) == "map_layer_incomplete"
    with pytest.raises(DecodeError):
        read_path(bytes(data), 10)


@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf, 1e300, 2e6])
def test_a_place_that_is_none_is_named(value: float) -> None:
    encoded = INTERFACES.encode(PATH_TYPE, {"header": HEADER, **path_of((0.0, 0.0), (value, 0.0))})
    assert refused(PATH_TYPE, encoded) == "map_layer_not_finite"
    polygon = {"polygon": {"points": [{"x": 0.0, "y": value if abs(value) < 1e38 else math.inf}]}}
    encoded = INTERFACES.encode(POLYGON_TYPE, {"header": HEADER, **polygon})
    assert refused(POLYGON_TYPE, encoded) == "map_layer_not_finite"


def test_a_message_without_a_frame_is_named() -> None:
    assert refused(PATH_TYPE, INTERFACES.encode(PATH_TYPE, path_of((0.0, 0.0)))) == "map_layer_no_frame"


def test_a_scan_has_the_beams_within_its_range() -> None:
    scan = shape(SCAN_TYPE, scan_of(1.0, math.nan, 2.0, math.inf, 0.05, 11.0, -1.0))
    assert [*scan.points] == pytest.approx([1.0, 0.0, -2.0, 0.0], abs=1e-6)


def test_of_many_beams_the_nearest_counts() -> None:
    ranges = [9.0] * 3_600
    ranges[1_234] = 1.0
    scan = shape(SCAN_TYPE, scan_of(*ranges, angle_increment=math.tau / 3_600))
    assert len(scan.points) // 2 <= MAX_BEAMS
    places = zip(scan.points[::2], scan.points[1::2], strict=True)
    assert min(math.hypot(x, y) for x, y in places) == pytest.approx(1.0)


@pytest.mark.parametrize(
    "angles",
    [
        {"angle_increment": 0.0},
        {"angle_increment": math.nan},
        {"angle_increment": math.inf},
        {"angle_min": math.nan},
    ],
)
def test_a_scan_without_angles_is_named(angles: dict[str, float]) -> None:
    data = INTERFACES.encode(SCAN_TYPE, {"header": HEADER, **scan_of(1.0, **angles)})
    assert refused(SCAN_TYPE, data) == "map_layer_scan_angles"


def test_a_scan_that_claims_a_thousand_million_points_is_refused() -> None:
    data = bytearray(INTERFACES.encode(SCAN_TYPE, {"header": HEADER, **scan_of(1.0, 2.0)}))
    at = data.index(struct.pack("<I2f", 2, 1.0, 2.0))
    COUNT.pack_into(data, at, 1_000_000_000)
    assert refused(SCAN_TYPE, bytes(data[:100])) == "map_layer_incomplete"
    assert refused(SCAN_TYPE, bytes(data)) == "map_layer_incomplete"


def test_a_footprint_has_its_corners_but_not_a_hundred_thousand() -> None:
    corner = {"x": 0.5, "y": -0.25}
    footprint = shape(POLYGON_TYPE, {"polygon": {"points": [corner] * 4}})
    assert [*footprint.points] == [0.5, -0.25] * 4
    many = {"header": HEADER, "polygon": {"points": [corner] * (MAX_CORNERS + 1)}}
    assert refused(POLYGON_TYPE, INTERFACES.encode(POLYGON_TYPE, many)) == "map_layer_corners"
    many["polygon"] = {"points": [corner] * 100_000}
    assert refused(POLYGON_TYPE, INTERFACES.encode(POLYGON_TYPE, many)) == "map_layer_large"


def covariance_of(xx: float, xy: float, yy: float) -> dict[str, Any]:
    covariance = [0.0] * 36
    covariance[0], covariance[1], covariance[6], covariance[7] = xx, xy, xy, yy
    return {"pose": {"covariance": covariance}}


def test_a_covariance_is_an_ellipse() -> None:
    upright = shape(POSE_TYPE, covariance_of(0.01, 0.0, 0.04)).ellipse
    assert upright == pytest.approx((0.4896, 0.2448, math.pi / 2), abs=1e-3)
    turned = shape(POSE_TYPE, covariance_of(0.02, 0.01, 0.02)).ellipse
    assert turned is not None
    assert turned.turn == pytest.approx(math.pi / 4)


@pytest.mark.parametrize(
    ("xx", "xy", "yy"),
    [(math.nan, 0.0, 0.0), (-1.0, 0.0, 1.0), (math.inf, 0.0, 1.0), (0.0, 1.0, 0.0), (1e300, 0.0, 1.0)],
)
def test_a_covariance_that_is_none_is_named(xx: float, xy: float, yy: float) -> None:
    data = INTERFACES.encode(POSE_TYPE, {"header": HEADER, **covariance_of(xx, xy, yy)})
    assert refused(POSE_TYPE, data) == "map_layer_covariance_bad"


@pytest.mark.parametrize("type_name", READERS)
@pytest.mark.parametrize("payload", [b"", b"\0\1\0\0", b"\0\1\0\0" + b"\xff" * 100, b"\xff" * 1_000])
def test_bytes_that_are_no_message_are_named(type_name: str, payload: bytes) -> None:
    assert refused(type_name, payload) == "map_layer_incomplete"


def test_points_are_placed_by_the_whole_rotation_in_centimetres() -> None:
    scan = shape(SCAN_TYPE, scan_of(1.0, 2.0))  # ahead, and to the left
    half = math.sqrt(0.5)
    left = Transform((10.0, 0.0, 0.5), Quaternion(0.0, 0.0, half, half))
    assert placed(scan, left) == [1000, 100, 800, 0]
    upside_down = Transform((0.0, 0.0, 0.5), Quaternion(1.0, 0.0, 0.0, 0.0))
    assert placed(scan, upside_down) == [100, 0, 0, -200]
