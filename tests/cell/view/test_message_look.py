"""A message of any topic as text and hexadecimal: bounded, and with the reason if it is not decoded."""

import pytest

from app.cell.view.messages import MOST_BYTES, MOST_LINES, message_look
from app.ros.messages import load_interfaces

INTERFACES = load_interfaces("jazzy")
STRING = "std_msgs/msg/String"


def test_a_message_is_decoded_and_hexadecimal() -> None:
    data = INTERFACES.encode("std_msgs/msg/Float64", {"data": 5.61})
    look = message_look(INTERFACES, ["std_msgs/msg/Float64"], [], data)
    assert (look.lines, look.reason, look.size, look.cut_lines) == (("data: 5.61",), "", 12, 0)
    assert look.hex_lines == (f"0000  {data.hex(' '):<47}  ....q=...p.@",)


def test_what_is_cut_is_counted() -> None:
    text = INTERFACES.encode(STRING, {"data": "x" * 5000})
    look = message_look(INTERFACES, [STRING], [], text)
    assert look.lines == (f"data: {'x' * 24}... 4976 more",)
    assert look.cut_bytes == len(text) - MOST_BYTES
    assert len(look.hex_lines) == MOST_BYTES / 16
    joints = "sensor_msgs/msg/JointState"
    many = INTERFACES.encode(joints, {"position": [0.5] * 500})
    assert "- '... 476 more'" in message_look(INTERFACES, [joints], [], many).lines
    points = "geometry_msgs/msg/Polygon"
    polygon = INTERFACES.encode(points, {"points": [{"x": 1.0}] * 400})
    assert "- '... 376 more'" in message_look(INTERFACES, [points], [], polygon).lines
    status = {"values": [{"key": "a", "value": "b"}] * 24}
    array = "diagnostic_msgs/msg/DiagnosticArray"
    long = message_look(INTERFACES, [array], [], INTERFACES.encode(array, {"status": [status] * 24}))
    assert len(long.lines) == MOST_LINES
    assert long.cut_lines > 24 * 24


@pytest.mark.parametrize(
    ("types", "hashes", "data", "code"),
    [
        ([], [], b"\0\1\0\0", "look_no_type"),
        ([STRING, "std_msgs/msg/Bool"], [], b"\0\1\0\0", "look_types"),
        (["vendor_msgs/msg/Odd"], [], b"\0\1\0\0", "look_unknown"),
        ([STRING], ["RIHS01_" + "0" * 64], b"\0\1\0\0", "look_differs"),
        ([STRING], [], b"\0\1\0\0\xff\xff", "look_undecodable"),
        ([STRING], [], b"\0" * 1_000_001, "look_large"),
    ],
)
def test_what_is_not_decoded_is_hexadecimal_with_the_reason(
    types: list[str], hashes: list[str], data: bytes, code: str
) -> None:
    look = message_look(INTERFACES, types, hashes, data)
    assert look.lines == ()
    assert getattr(look.reason, "code", "") == code
    assert look.hex_lines[0].startswith("0000  00 ")


def test_codes_of_terminals_and_hidden_characters_are_shown() -> None:
    data = INTERFACES.encode(STRING, {"data": "\x1b[31mred\u202e"})
    (line,) = message_look(INTERFACES, [STRING], [], data).lines
    assert "\x1b" not in line
    assert "\u202e" not in line
