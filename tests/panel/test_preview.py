"""Messages as text, for who wants to see what a press sends."""

import math
from typing import Any

import pytest

from app.panel.file.preview import complete_value, message_lines
from app.ros.messages import Type
from tests.support.builders import INTERFACES

COVARIANT = "geometry_msgs/msg/PoseWithCovariance"


@pytest.mark.parametrize(
    ("fields", "lines"),
    [
        ({}, []),
        ({"a": True, "b": 1, "c": 0.5}, ["a: true", "b: 1", "c: 0.5"]),
        ({"a": math.nan, "b": -math.inf, "c": math.inf}, ["a: .nan", "b: -.inf", "c: .inf"]),
        ({"a": "", "b": 'a "b"\n漢'}, ['a: ""', 'b: "a \\"b\\"\\n漢"']),
        ({"a": {}, "b": {"c": {"d": 1}}}, ["a: {}", "b:", "  c:", "    d: 1"]),
        ({"a": [], "b": [1, 2], "c": ["x", "{n}"]}, ["a: []", "b: [1, 2]", 'c: ["x", "{n}"]  # N']),
        ({"a": [0.0] * 36}, ["a: [0.0, 0.0, …]  # 36 of them"]),
        ({"a": [{"b": 1, "c": {"d": "{n}"}}, {}, "{m}"]},
         ["a:", "- b: 1", "  c:", '    d: "{n}"  # N', "- {}", '- "{m}"']),
        ({"a": "{n} to {m} and {n}"}, ['a: "{n} to {m} and {n}"  # N; M']),
        ({"a": {"b": 5}, "b": 6}, ["a:", "  b: 5  # inside", "b: 6"]),
        ({"a": "{"}, ['a: "{"']),
    ],
)  # fmt: skip
def test_message_is_written_as_ros_prints_messages(fields: dict[str, Any], lines: list[str]) -> None:
    assert list(message_lines(fields, {"n": "N", "m": "M", ".a.b": "inside"})) == lines


def test_message_gets_the_defaults_of_omitted_fields() -> None:
    made = complete_value({"pose": {"position": {"x": 1, "y": "{n}"}}}, Type(COVARIANT), INTERFACES)
    assert made == {
        "pose": {
            "position": {"x": 1.0, "y": "{n}", "z": 0.0},
            "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        },
        "covariance": [0.0] * 36,
    }
    assert isinstance(made["pose"]["position"]["x"], float)


def test_an_input_may_stand_for_a_whole_table_or_list() -> None:
    made = complete_value({"points": ["{p}", {"x": 1}]}, Type("geometry_msgs/msg/Polygon"), INTERFACES)
    assert made == {"points": ["{p}", {"x": 1.0, "y": 0.0, "z": 0.0}]}
    assert complete_value({"pose": "{p}"}, Type(COVARIANT), INTERFACES)["pose"] == "{p}"
