"""Messages as `ros2 topic echo` writes them."""

import json
from collections.abc import Mapping
from typing import Any

import pytest

from app.cell.view.messages import Shape, csv_line, yaml_text
from app.ros.messages import load_interfaces
from app.tools.robot.topic_reader import value_in

INTERFACES = load_interfaces("jazzy")
STATE = "sensor_msgs/msg/JointState"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"


def read(type_name: str, fields: Mapping[str, Any], path: str = "") -> Any:
    return value_in(INTERFACES.encode(type_name, fields), INTERFACES, type_name, path)


JOINTS = {"header": {"frame_id": "a b"}, "name": ["j1", "j2"], "position": [0.5, -1.0]}


def test_a_message_is_yaml() -> None:
    assert yaml_text(read(STATE, JOINTS), Shape()) == (
        "header:\n  stamp:\n    sec: 0\n    nanosec: 0\n  frame_id: a b\n"
        "name:\n- j1\n- j2\nposition:\n- 0.5\n- -1.0\nvelocity: []\neffort: []"
    )


def test_messages_in_a_list_are_below_their_dash() -> None:
    status = [{"name": "drive: 1", "level": 2, "values": [{"key": "temp", "value": "40"}]}]
    assert yaml_text(read(DIAGNOSTICS, {"status": status}, "status"), Shape()) == (
        "- level: 2\n  name: \"drive: 1\"\n  message: ''\n  hardware_id: ''\n"
        '  values:\n  - key: temp\n    value: "40"'
    )


def test_an_empty_message_is_a_pair_of_braces() -> None:
    assert yaml_text(read("std_msgs/msg/Empty", {}), Shape()) == "{}"


@pytest.mark.parametrize(
    ("text", "written"),
    [
        ("plain", "plain"),
        ("", "''"),
        ("true", '"true"'),
        ("12", '"12"'),
        ("a: b", '"a: b"'),
        ("- x", '"- x"'),
        (".5", '".5"'),
        ("...", '"..."'),
        ("two\nlines", '"two\\nlines"'),
        ("\x1b[31mred", '"\\u001b[31mred"'),  # nothing of a robot's moves the terminal's cursor
        ("a\u202eb", '"a\\u202eb"'),
    ],
)
def test_texts_are_quoted_where_yaml_would_misread_them(text: str, written: str) -> None:
    assert yaml_text(read("std_msgs/msg/String", {"data": text}), Shape()) == f"data: {written}"


@pytest.mark.parametrize(
    ("value", "written"),
    [
        (float("nan"), ".nan"),
        (float("-inf"), "-.inf"),
        (0.1, "0.1"),
        (1e-05, "1.0e-05"),
        (-1e300, "-1.0e+300"),
        (1.5e-7, "1.5e-07"),
    ],
)
def test_numbers_are_those_of_yaml(value: float, written: str) -> None:
    assert yaml_text(read("std_msgs/msg/Float64", {"data": value}), Shape()) == f"data: {written}"


def test_long_lists_and_texts_are_cut() -> None:
    image = read("sensor_msgs/msg/Image", {"data": bytes(200), "encoding": "x" * 200})
    cut = yaml_text(image, Shape(most=2)).splitlines()
    assert cut[-4:] == ["data:", "- 0", "- 0", "- '...'"]
    assert "encoding: xx..." in cut
    assert len(yaml_text(image, Shape(most=None)).splitlines()) > 200
    left_out = yaml_text(image, Shape(lists=False, texts=False)).splitlines()
    assert left_out[-1] == "data: '<200 elements>'"
    assert 'encoding: "<200 characters>"' in left_out


def test_csv_has_all_values_in_order() -> None:
    assert csv_line(read(STATE, JOINTS), Shape()) == "0,0,a b,j1,j2,0.5,-1.0,,"
    assert csv_line(read(STATE, {}), Shape()) == "0,0,,,,,"
    assert csv_line(read(STATE, JOINTS), Shape(lists=False)) == "0,0,a b,<2 elements>,<2 elements>,,"
    assert csv_line(read("std_msgs/msg/Bool", {"data": True}), Shape()) == "True"
    text = read("std_msgs/msg/String", {"data": 'a,"b"\n'})
    assert csv_line(text, Shape()) == '"a,""b""\n"'


@pytest.mark.parametrize(
    ("path", "value"),
    [
        ("position[1]", -1.0),
        ("position[7]", None),
        ("position[name=j2]", -1.0),
        ("header.frame_id", "a b"),
        ("name", ["j1", "j2"]),
    ],
)
def test_a_field_of_a_message(path: str, value: Any) -> None:
    read_value = read(STATE, JOINTS, path)
    assert (list(read_value) if path == "name" else read_value) == value


def test_a_message_of_many_elements_is_read_whole() -> None:
    status = [{"name": "x" * 20} for _ in range(5000)]
    whole = read(DIAGNOSTICS, {"status": status})
    assert len(whole.status) == 5000
    assert json.loads(f'"{whole.status[-1].name}"') == "x" * 20
