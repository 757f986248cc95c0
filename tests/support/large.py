"""Large messages as CDR, built from bytes because encoding them takes long."""

import struct
from collections.abc import Callable, Mapping
from typing import Final, NamedTuple

from app.ros.cdr.reader import MAX_TEXT

LITTLE: Final = b"\0\1\0\0"
TEN_MB: Final = 10_000_000
HEADER: Final = struct.pack("<iII1s3x", 1, 2, 1, b"\0")  # std_msgs/msg/Header without a frame
POSE: Final = struct.pack("<7d", 5, 0, 0, 0, 0, 0, 1)
STATUS: Final = struct.pack("<B3xI1s3xI1s3xI1s3xI", 2, 1, b"\0", 1, b"\0", 1, b"\0", 0)
POINT: Final = struct.pack("<IIIIiI", 0, 0, 0, 0, 0, 0)


class Large(NamedTuple):
    """An encoded message, with the path and the value of a field to read."""

    type: str
    path: str
    value: object
    data: bytes


def poses(size: int) -> Large:
    count = size // len(POSE)
    body = HEADER + struct.pack("<I4x", count) + POSE * count
    return Large("geometry_msgs/msg/PoseArray", f"poses[{count - 1}].position.x", 5.0, LITTLE + body)


def path(size: int) -> Large:
    """Poses with a frame id each."""
    element = HEADER + POSE
    count = size // len(element)
    body = HEADER + struct.pack("<I", count) + HEADER + bytes(4) + POSE + element * (count - 1)
    return Large("nav_msgs/msg/Path", f"poses[{count - 1}].pose.position.x", 5.0, LITTLE + body)


def diagnostics(size: int, name: bytes = b"") -> Large:
    """The last status has the name."""
    count = size // len(STATUS)
    last = struct.pack(f"<B3xI{len(name) + 1}s", 1, len(name) + 1, name)
    last += bytes(-len(last) % 4) + STATUS[12:]
    body = HEADER + struct.pack("<I", count) + STATUS * (count - 1) + last
    where = f"status[name={name.decode()}]" if name else f"status[{count - 1}]"
    return Large("diagnostic_msgs/msg/DiagnosticArray", f"{where}.level", 1, LITTLE + body)


def strings(size: int) -> Large:
    count = size // 8
    body = HEADER + struct.pack("<I", count) + struct.pack("<I1s3x", 1, b"\0") * count
    body += struct.pack("<I", 1)
    body += bytes(-len(body) % 8) + struct.pack("<dII", 0.5, 0, 0)
    return Large("sensor_msgs/msg/JointState", "position[0]", 0.5, LITTLE + body)


def names(size: int) -> Large:
    """As many positions as names."""
    count = size // 16
    body = HEADER + struct.pack("<I", count) + struct.pack("<I1s3x", 1, b"\0") * (count - 1)
    body += struct.pack("<I2s2x", 2, b"j\0") + struct.pack("<I", count)
    body += bytes(-len(body) % 8) + bytes(8 * (count - 1)) + struct.pack("<dII", 0.5, 0, 0)
    return Large("sensor_msgs/msg/JointState", "position[name=j]", 0.5, LITTLE + body)


def nested(size: int) -> Large:
    """Lists in a list."""
    count = size // len(POINT)
    body = HEADER + struct.pack("<II", 0, count) + POINT * count
    field = f"points[{count - 1}].time_from_start.sec"
    return Large("trajectory_msgs/msg/JointTrajectory", field, 0, LITTLE + body)


def numbers(size: int) -> Large:
    body = struct.pack("<III", 0, 0, size) + bytes(size - 1) + b"\7"
    return Large("std_msgs/msg/UInt8MultiArray", f"data[{size - 1}]", 7, LITTLE + body)


def text(size: int) -> Large:
    """A text of letters with three bytes each; of a long text only the beginning is read."""
    count, most = size // 3, MAX_TEXT // 3
    body = struct.pack("<I", 3 * count + 1) + "漢".encode() * count + b"\0"
    value = "漢" * count if count <= most else "漢" * most + "…"
    return Large("std_msgs/msg/String", "data", value, LITTLE + body)


def garbage(size: int) -> Large:
    """Invalid data that claims as many elements as would fit."""
    body = HEADER + struct.pack("<I", size // 5) + b"\1\0\0\0" * (size // 4)
    return Large("diagnostic_msgs/msg/DiagnosticArray", "status[0].level", None, LITTLE + body)


KINDS: Final[Mapping[str, Callable[[int], Large]]] = {
    "poses": poses,
    "a path": path,
    "diagnostics": diagnostics,
    "diagnostics by name": lambda size: diagnostics(size, b"drive"),
    "strings": strings,
    "joints by name": names,
    "nested lists": nested,
    "bytes": numbers,
    "a text": text,
}
