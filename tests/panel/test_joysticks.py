"""Joysticks in a panel file: a Twist needs no message, each fault is named with its place."""

from pathlib import Path
from typing import Any, Final

import pytest

from app.panel.widgets.hold import Joystick
from app.system.errors import PanelError
from tests.panel.test_holds import fault, loaded
from tests.panel.test_panel import without

STICK: Final[dict[str, Any]] = {
    "id": "stick",
    "kind": "joystick",
    "label": "Drive",
    "topic": "/cmd_vel",
    "type": "geometry_msgs/msg/Twist",
    "interlock": "operation",
}
POINT: Final[dict[str, Any]] = {"type": "geometry_msgs/msg/Point", "message": {"x": "{x}", "y": "{y}"}}


@pytest.mark.parametrize("type_name", ["Twist", "TwistStamped"])
def test_a_twist_needs_no_message(tmp_path: Path, type_name: str) -> None:
    panel = loaded(tmp_path, STICK | {"type": f"geometry_msgs/msg/{type_name}"})
    (stick,) = panel.widgets()
    assert isinstance(stick, Joystick)
    twist = stick.moving(*stick.axes_at(1.0, 0.5))
    assert twist.get("twist", twist) == {"linear": {"x": 0.5}, "angular": {"z": -1.0}}
    stop = stick.stopping()
    assert stop.get("twist", stop) == {"linear": {"x": 0.0}, "angular": {"z": 0.0}}


def test_joystick_with_its_own_message_stops_with_zeros_or_its_release(tmp_path: Path) -> None:
    (stick,) = loaded(tmp_path, STICK | POINT).widgets()
    assert isinstance(stick, Joystick)
    assert stick.stopping() == {"x": 0.0, "y": 0.0}
    (stick,) = loaded(tmp_path, STICK | POINT | {"release": {"x": 7}}).widgets()
    assert isinstance(stick, Joystick)
    assert stick.stopping() == {"x": 7}


@pytest.mark.parametrize(
    ("changes", "place", "said"),
    [
        ({"x_axis": {"max": 0.0}}, "x_axis.max", "the axis would do nothing"),
        ({"type": "geometry_msgs/msg/Point"}, "message", 'names its axes, as in { x = "{x}" }'),
        (POINT | {"message": {"x": "{w}"}}, "message.x", 'no input "w"'),
        ({"type": "std_msgs/msg/Bool", "message": {"data": "{x}"}}, "message.data", "must be"),
        ({"y_axis": {"max": 300.0}, "type": "std_msgs/msg/Int8", "message": {"data": "{y}"}},
         "message.data", "must be"),
        ({"deadline_field": "linear.x", "message": {"linear": {"x": "{y}"}}},
         "message.linear.x", "filled in by the panel server"),
        ({"dead_zone": 1.0}, "dead_zone", ""),
        ({"shape": "star"}, "shape", ""),
    ],
)  # fmt: skip
def test_a_fault_names_its_place(
    tmp_path: Path, changes: dict[str, Any], place: str, said: str
) -> None:
    where, message = fault(tmp_path, STICK | changes)
    assert where == place
    assert said in message


def test_an_input_may_not_have_an_axis_name(tmp_path: Path) -> None:
    x = {"id": "x", "kind": "number", "label": "X", "min": 0, "max": 1}
    with pytest.raises(PanelError) as raised:
        loaded(tmp_path, x, STICK)
    assert "is the axis" in str(raised.value)


def test_joystick_needs_an_interlock(tmp_path: Path) -> None:
    assert fault(tmp_path, without(STICK, "interlock"))[0] == "interlock"


def test_a_gamepads_stick_moves_one_joystick_of_a_page(tmp_path: Path) -> None:
    left, right = STICK | {"gamepad": "left"}, STICK | {"id": "turret", "topic": "/turret"}
    assert len(list(loaded(tmp_path, left, right | {"gamepad": "right"}).widgets())) == 2
    with pytest.raises(PanelError) as raised:
        loaded(tmp_path, left, right | {"gamepad": "left"})
    assert '"stick" has it already: the left stick moves one joystick of a page' in str(raised.value)
