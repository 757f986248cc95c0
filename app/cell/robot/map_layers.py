"""What is drawn over a map: shapes of a robot's messages, read from their bytes. Pure.

A shape has as many points as a screen can show, however many its message has. A message is judged by
its size before it is read.
"""

import math
from array import array
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

from app.cell.robot.maps import Arrival, NoMap
from app.cell.robot.transforms import Transform
from app.ros.cdr.stamped import PATH_TYPE, read_path
from app.ros.messages import Interfaces
from app.system.errors import DecodeError
from app.system.texts import TextLike, number, say

SCAN_TYPE: Final = "sensor_msgs/msg/LaserScan"
POLYGON_TYPE: Final = "geometry_msgs/msg/PolygonStamped"
POSE_TYPE: Final = "geometry_msgs/msg/PoseWithCovarianceStamped"
MAX_PATH_POINTS: Final = 500
MAX_BEAMS: Final = 360
MAX_CORNERS: Final = 500
MAX_M: Final = 1e6  # from the frame's origin: more is no place
DEVIATIONS: Final = 2.448  # of a normal distribution in the plane: 95 % are within


class Ellipse(NamedTuple):
    """Half axes in metres, and the turn of the first in radians."""

    long: float
    short: float
    turn: float


@dataclass(frozen=True, slots=True, eq=False)
class Shape:
    """`points` as x, y, x, y … in metres in `frame`; `stamp` is the robot's time in seconds, 0 without
    one. Of a pose `ellipse` has where the robot is with 95 % of probability."""

    frame: str
    stamp: float
    points: "array[float]"
    ellipse: Ellipse | None = None


@dataclass(slots=True)
class LayerState(Arrival):
    """The newest shape of a topic. `placed` is what it was in the map's frame the last time, with the
    transform by which it was placed."""

    shape: Shape | None = None
    placed: "tuple[Shape, str, Transform, list[int]] | None" = None


def read_shape(interfaces: Interfaces, type_name: str, payload: bytes) -> Shape:
    """The shape of a message of one of `READERS`; NoMap says what is wrong with it."""
    most, read = READERS[type_name]
    if len(payload) > most:
        raise NoMap(say("map_layer_large", bytes=len(payload), most=most))
    try:
        shape = read(interfaces, payload)
    except DecodeError:
        raise NoMap(say("map_layer_incomplete", type=type_name)) from None
    if not shape.frame:
        raise NoMap(say("map_layer_no_frame"))
    if not all(-MAX_M < value < MAX_M for value in shape.points):
        raise NoMap(say("map_layer_not_finite"))
    return shape


def _path(_: Interfaces, payload: bytes) -> Shape:
    path = read_path(payload, MAX_PATH_POINTS)
    return Shape(_frame(path.frame), path.stamp, path.points)


def _scan(interfaces: Interfaces, payload: bytes) -> Shape:
    """Of beams side by side the nearest, so that nothing near gets lost."""
    message = interfaces.decode(SCAN_TYPE, payload)
    start, step = message.angle_min, message.angle_increment
    least, most = message.range_min, message.range_max
    if not (math.isfinite(start) and math.isfinite(step) and step):
        raise NoMap(say("map_layer_scan_angles", start=_number(start), step=_number(step)))
    if math.isnan(least) or math.isnan(most):
        raise NoMap(say("map_layer_not_finite"))
    most = min(most, MAX_M / 2)
    beside = max(1, math.ceil(len(message.ranges) / MAX_BEAMS))
    points = array("d")
    for first in range(0, len(message.ranges), beside):
        near = math.inf
        for beam, distance in enumerate(message.ranges[first : first + beside], start=first):
            if least <= distance <= most and distance < near:
                near, angle = distance, start + beam * step
        if near < math.inf:
            points.append(near * math.cos(angle))
            points.append(near * math.sin(angle))
    return Shape(_frame(message.header.frame_id), _seconds(message.header.stamp), points)


def _polygon(interfaces: Interfaces, payload: bytes) -> Shape:
    message = interfaces.decode(POLYGON_TYPE, payload)
    corners = message.polygon.points
    if len(corners) > MAX_CORNERS:
        raise NoMap(say("map_layer_corners", count=len(corners), most=MAX_CORNERS))
    points = array("d", [value for corner in corners for value in (corner.x, corner.y)])
    return Shape(_frame(message.header.frame_id), _seconds(message.header.stamp), points)


def _covariance(interfaces: Interfaces, payload: bytes) -> Shape:
    """A pose whose place is known with a covariance: x with x, x with y, y with y, in square metres."""
    message = interfaces.decode(POSE_TYPE, payload)
    covariance = message.pose.covariance
    xx, xy, yy = covariance[0], (covariance[1] + covariance[6]) / 2, covariance[7]
    mean, half = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    largest, smallest = mean + half, mean - half
    if not (0 <= largest < MAX_M and smallest >= -1e-9):
        raise NoMap(say("map_layer_covariance_bad"))
    long, short = (DEVIATIONS * math.sqrt(max(part, 0.0)) for part in (largest, smallest))
    ellipse = Ellipse(long, short, math.atan2(2 * xy, xx - yy) / 2)
    place = message.pose.pose.position
    points = array("d", (place.x, place.y))
    return Shape(_frame(message.header.frame_id), _seconds(message.header.stamp), points, ellipse)


# Type of a topic → the most bytes of a message, and what reads it.
Read = Callable[[Interfaces, bytes], Shape]
READERS: Final[Mapping[str, tuple[int, Read]]] = {
    PATH_TYPE: (4_000_000, _path),  # 50,000 poses
    SCAN_TYPE: (400_000, _scan),  # 50,000 beams with their intensities
    POLYGON_TYPE: (20_000, _polygon),
    POSE_TYPE: (2_000, _covariance),
}


def placed(shape: Shape, transform: Transform) -> list[int]:
    """A shape's points in another frame, as x, y, x, y … in centimetres: `transform` is that of its own
    frame there."""
    x, y, z, w = transform.turned
    to_x, to_y, _ = transform.place
    # The upper left of the rotation's matrix: all points are in the plane of their frame.
    xx, xy = 1 - 2 * (y * y + z * z), 2 * (x * y - w * z)
    yx, yy = 2 * (x * y + w * z), 1 - 2 * (x * x + z * z)
    points = shape.points
    flat = []
    for at in range(0, len(points), 2):
        across, up = points[at], points[at + 1]
        flat.append(round(100 * (xx * across + xy * up + to_x)))
        flat.append(round(100 * (yx * across + yy * up + to_y)))
    return flat


def _frame(name: str) -> str:
    """Old nodes write a slash before it."""
    return name.lstrip("/")[:200]


def _seconds(stamp: Any) -> float:
    return float(stamp.sec + stamp.nanosec / 1e9)


def _number(value: float) -> TextLike:
    return number(f"{value:g}")
