"""Holds in a panel file: a good one is taken, each fault is named with its place."""

from pathlib import Path
from typing import Any, Final

import pytest

from app.panel import Hold, Panel, load_panel
from app.panel.template import set_field
from app.system.errors import FieldError, PanelError
from tests.panel.test_panel import toml, without
from tests.support.builders import INTERLOCK, Table

TWIST: Final = "geometry_msgs/msg/Twist"
REGION: Final = "sensor_msgs/msg/RegionOfInterest"
ZERO: Final[Table] = {"x": 0, "y": 0, "z": 0}
SPEED: Final[Table] = {"id": "speed", "kind": "number", "label": "Speed", "min": 0, "max": 1}
JOG: Final[Table] = {
    "id": "jog",
    "kind": "hold",
    "label": "Jog",
    "topic": "/cmd_vel",
    "type": TWIST,
    "message": {"linear": {**ZERO, "x": "{speed}"}, "angular": ZERO},
    "release": {"linear": ZERO, "angular": ZERO},
    "interlock": "operation",
}
FLAGS: Final[Table] = {
    **JOG,
    "type": REGION,
    "message": {"x_offset": 1, "y_offset": 0, "do_rectify": True},
    "release": {"x_offset": 0, "y_offset": 0, "do_rectify": False},
    "deadline_field": "height",
    "counter_field": "width",
}


def loaded(folder: Path, *widgets: Table) -> Panel:
    page = {"id": "one", "title": "One", "widget": list(widgets)}
    tables = {"title": "Cell", "interlock": [INTERLOCK], "page": [page]}
    path = folder / "cell.toml"
    path.write_text("".join(f"{name} = {toml(value)}\n" for name, value in tables.items()))
    return load_panel(path)


def fault(folder: Path, hold: Table) -> tuple[str, str]:
    """The one fault, its place within the hold."""
    with pytest.raises(PanelError) as raised:
        loaded(folder, SPEED, hold)
    (only,) = raised.value.faults
    return only.place.removeprefix("page[0].widget[1]."), only.message


def test_a_hold_has_a_rate_and_its_topic_is_published(tmp_path: Path) -> None:
    panel = loaded(tmp_path, SPEED, JOG)
    hold = list(panel.widgets())[1]
    assert isinstance(hold, Hold)
    assert (hold.rate_hz, hold.period_s, hold.deadline_ms) == (20.0, 0.05, 150)
    assert panel.publications() == {"/cmd_vel": TWIST}
    assert panel.qos("/cmd_vel") == hold.qos


def test_omitted_fields_of_a_hold_are_zero(tmp_path: Path) -> None:
    assert loaded(tmp_path, SPEED, {**JOG, "message": {"linear": {"x": "{speed}"}}, "release": {}})
    assert loaded(tmp_path, {**FLAGS, "message": {"x_offset": 1}, "release": {}})


def test_the_kiosk_fills_in_deadline_and_count(tmp_path: Path) -> None:
    assert loaded(tmp_path, SPEED, FLAGS)


@pytest.mark.parametrize(
    ("hold", "place", "message"),
    [
        (without(JOG, "interlock"), "interlock", "is missing: a hold needs the interlock whose loss"),
        (without(JOG, "release"), "release", "is missing: a hold needs the message that is published"),
        (without(JOG, "message"), "message", "is missing"),
        ({**JOG, "interlock": "cell"}, "interlock", 'no interlock "cell"; there is operation'),
        ({**JOG, "rate_hz": 0.5}, "rate_hz", "must be 1 or more, not 0.5"),
        ({**JOG, "rate_hz": 101}, "rate_hz", "must be 100 or less, not 101"),
        ({**JOG, "rate": 10}, "rate", 'did you mean "rate_hz"?'),
        ({**JOG, "topic": "/rosout"}, "topic", "/rosout is where the panel server's own log goes"),
        ({**JOG, "type": "geometry_msgs/msg/Twits"}, "type", "did you mean geometry_msgs/msg/Twist"),
        ({**JOG, "release": {"lineal": ZERO}}, "release.lineal", "unknown field"),
        ({**JOG, "message": {"linear": {"y": "1"}}}, "message.linear.y", "must be a number (float64)"),
        (
            {**JOG, "release": {"linear": ZERO, "angular": "{spin}"}},
            "release.angular",
            'no input "spin"',
        ),
        ({**JOG, "deadline_field": "linear.w"}, "deadline_field", 'there is no "w"'),
        ({**JOG, "counter_field": "linear.x"}, "counter_field", "is float64: it must be uint8"),
        ({**FLAGS, "deadline_field": "do_rectify"}, "deadline_field", "is bool: it must be uint16"),
        (
            {**FLAGS, "counter_field": "height"},
            "counter_field",
            '"height" is the deadline_field already',
        ),
        (
            {**FLAGS, "message": {**FLAGS["message"], "width": 3}},
            "message.width",
            "is filled in by the panel server: it is the counter_field",
        ),
    ],
)
def test_a_fault_is_named_with_its_place(
    tmp_path: Path, hold: dict[str, Any], place: str, message: str
) -> None:
    reported = fault(tmp_path, hold)
    assert reported[0] == place
    assert message in reported[1]


def test_a_topic_has_one_type_for_buttons_and_holds(tmp_path: Path) -> None:
    press = {**without(without(JOG, "release"), "interlock"), "id": "push", "kind": "publish"}
    text = {**press, "type": "std_msgs/msg/String", "message": {"data": "x"}}
    with pytest.raises(PanelError, match=r"/cmd_vel is std_msgs/msg/String here but geometry_msgs"):
        loaded(tmp_path, SPEED, JOG, text)


@pytest.mark.parametrize(
    ("fields", "path", "whole"),
    [
        ({}, "a", {"a": 7}),
        ({"a": {"b": 1}}, "a.c", {"a": {"b": 1, "c": 7}}),
        ({"a": [1, 2]}, "a[1]", {"a": [1, 7]}),
        ({"a": [{"b": 1}]}, "a[0].b", {"a": [{"b": 7}]}),
    ],
)
def test_a_value_is_placed_in_a_copy(fields: Table, path: str, whole: Table) -> None:
    before = repr(fields)
    assert set_field(fields, path, 7) == whole
    assert repr(fields) == before


def test_a_place_beyond_the_end_of_a_list_is_none() -> None:
    with pytest.raises(FieldError, match=r"a\[2\]: there is no \[2\]: the message has 2 elements"):
        set_field({"a": [1, 2]}, "a[2]", 7)
