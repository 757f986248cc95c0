"""What is written along with a type that a form got: its whole name, and what its widget needs."""

from typing import Any, Final

import pytest

from app.ros.messages import load_interfaces
from app.tools.editor.document import Delete, Edit, SetValue
from app.tools.editor.filling import filled

INTERFACES: Final = load_interfaces("jazzy", ())
AT: Final = ("page", 0, "widget", 0)
BOOL: Final = "std_msgs/msg/Bool"
ON_OFF: Final = [
    {"value": True, "text": "On", "shape": "circle"},
    {"value": False, "text": "Off", "shape": "cross", "colour": "white"},
]


def made(widget: dict[str, Any], *edits: Edit) -> dict[str, Any]:
    """The keys that the edits of a step set in a widget, with what is filled in."""
    tables = {"page": [{"widget": [widget]}]}
    every = filled(edits, tables, INTERFACES)
    assert all(isinstance(edit, SetValue) and edit.path[:-1] == AT for edit in every)
    return {str(edit.path[-1]): edit.value for edit in every if isinstance(edit, SetValue)}


def typed(key: str, value: Any) -> SetValue:
    return SetValue((*AT, key), value)


@pytest.mark.parametrize(
    ("kind", "short", "whole"),
    [
        ("indicator", "Bool", BOOL),
        ("indicator", "std_msgs/Bool", BOOL),
        ("indicator", "example_interfaces/Bool", "example_interfaces/msg/Bool"),
        ("readout", "Float64", "std_msgs/msg/Float64"),
        ("readout", "BatteryState", "sensor_msgs/msg/BatteryState"),
        ("call", "SetBool", "std_srvs/srv/SetBool"),
        ("readout", "GoalStatus", "GoalStatus"),  # two packages have it
        ("readout", "SetBool", "SetBool"),  # not a message
        ("readout", "", ""),
    ],
)
def test_short_name_of_a_type_is_made_whole(kind: str, short: str, whole: str) -> None:
    assert made({"kind": kind}, typed("type", short))["type"] == whole


def test_lamp_of_a_bool_gets_its_states_whichever_is_typed_last() -> None:
    lamp = {"kind": "indicator", "label": "Door"}
    assert made({**lamp, "topic": "/door_closed"}, typed("type", "Bool"))["states"] == ON_OFF
    assert made({**lamp, "type": BOOL}, typed("topic", "/door_closed"))["states"] == ON_OFF
    both = made(lamp, typed("topic", "/door_closed"), typed("type", BOOL))
    assert both == {"topic": "/door_closed", "type": BOOL, "states": ON_OFF}
    assert "states" not in made(lamp, typed("type", BOOL))
    states = made({**lamp, "topic": "/fault"}, typed("type", BOOL))["states"]
    assert [state.get("colour") for state in states] == ["red", "white"]


def test_button_gets_what_it_sends() -> None:
    button = {"kind": "publish", "label": "Start", "topic": "/start"}
    assert made(button, typed("type", "Bool"))["message"] == {"data": True}
    call = {"kind": "call", "label": "Light", "service": "/light"}
    assert made(call, typed("type", "SetBool"))["request"] == {"data": True}


@pytest.mark.parametrize(
    "widget",
    [
        {"kind": "indicator", "topic": "/door", "states": []},
        {"kind": "publish", "topic": "/door", "message": {"data": False}},
        {"kind": "readout", "topic": "/door"},
        {"kind": "indicator", "topic": "/door", "field": "other"},
    ],
)
def test_nothing_else_is_written(widget: dict[str, Any]) -> None:
    assert made(widget, typed("type", BOOL)) == {"type": BOOL}


def test_other_edits_stay_as_they_are() -> None:
    tables = {"page": [{"widget": [{"kind": "indicator", "topic": "/door", "type": BOOL}]}]}
    edits: list[Edit] = [Delete((*AT, "type")), typed("label", "Door")]
    assert filled(edits, tables, INTERFACES) == edits
    assert filled([typed("type", "Bool")], tables, None) == [typed("type", "Bool")]
