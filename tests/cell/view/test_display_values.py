"""Readouts in formats and by constants, lamps with states, and what is not known of them."""

import math
from pathlib import Path
from typing import Any

import pytest

from app.cell.robot.state import RobotState, Sample
from app.cell.view.view import build_view
from app.panel import load_panel
from app.system.clock import format_time
from app.system.texts import render
from tests.support.builders import (
    BRIDGE,
    DIALECT,
    HEARD,
    INTERFACES,
    NOW,
    TRAITS,
    panel_of,
    robot_there,
)
from tests.support.samples import BATTERY
from tests.support.words import english

AT = f"received {format_time(NOW)}"
STATES = [
    {"value": 0, "text": "Idle", "shape": "circle"},
    {"value": 1, "text": "Runs", "shape": "triangle", "colour": "white"},
    {"value": 2, "text": "Fault", "shape": "cross", "colour": "red"},
]
LAMP = {**HEARD, "kind": "indicator", "states": STATES}


def shown(
    widget: Any, type_name: str, fields: Any, *, now: float = NOW, cut: bool = False, **more: Any
) -> dict[str, Any]:
    """The view of a widget after a message came."""
    panel = panel_of({**widget, "type": type_name, **more})
    robot = robot_there(panel)
    if fields is not None:
        robot.update("heard", Sample(INTERFACES.encode(type_name, fields), 1, NOW, NOW, BRIDGE))
    if cut:
        robot.mark_peer_lost(BRIDGE, 2)
    return build_view(panel, robot, now).view["widgets"]["heard"]


@pytest.mark.parametrize(
    ("kind", "data", "more", "text"),
    [
        ("Float64", 1.25, {"format": ".1f"}, "1.2"),
        ("Float64", 1234.5, {"format": "+,.2f"}, "+1,234.50"),
        ("Float64", 0.256, {"format": ".0%"}, "26%"),
        ("Float64", 1.25, {"unit": "m/s"}, "1.25 m/s"),
        ("Float64", -0.0, {}, "0.0"),
        ("Float64", -0.04, {"format": ".1f"}, "0.0"),
        ("Float64", -0.04, {"format": "+.1f"}, "+0.0"),
        ("Float64", -1234.5, {"format": ",.0f"}, "−1,234"),
        ("Float64", 0.5, {"scale": 100, "unit": "%", "format": ".0f"}, "50 %"),
        ("Float64", 300.0, {"offset": -273.15, "format": ".1f", "unit": "°C"}, "26.9 °C"),
        ("Int64", 2**63 - 1, {}, "9223372036854775807"),
        ("Int64", 2**53 + 1, {"unit": "ticks"}, "9007199254740993 ticks"),
        ("UInt64", 2**64 - 1, {"format": "d"}, "18446744073709551615"),
        ("UInt64", 2**64 - 1, {"format": ",d"}, "18,446,744,073,709,551,615"),
        ("Int32", 5, {"format": ".1f"}, "5.0"),
        ("Float64", math.nan, {"format": ".1f", "unit": "V"}, "NaN V"),
        ("Float64", math.inf, {"format": ".1f"}, "Infinity"),
        ("Float32", -math.inf, {"scale": 2}, "−Infinity"),
        ("Bool", True, {}, "true"),
        ("Float64", 1e308, {"format": ".1f"}, "1e+308"),
        ("Float64", -1.2345678e300, {"format": "+,.2f", "unit": "m"}, "−1.23457e+300 m"),
        ("Float64", 1e308, {"format": ".0%"}, "1e+308"),
        ("Float64", 0.5, {"format": ".99f"}, "0.5"),
        ("Float64", 1e30, {"format": ".0f"}, "1000000000000000019884624838656"),
        ("String", "a\u202eb\x1bc", {}, "a\\u202eb\\u001bc"),
        ("String", "\x1b" * 1000, {}, "\\u001b" * 33 + "\\…"),
    ],
)
def test_a_readout_writes_a_number(kind: str, data: Any, more: Any, text: str) -> None:
    view = shown(HEARD, f"std_msgs/msg/{kind}", {"data": data}, **more)
    not_finite = isinstance(data, float) and not math.isfinite(data)
    assert (render(view["text"]), view["state"]) == (text, "unreadable" if not_finite else "live")


@pytest.mark.parametrize(("status", "text"), [(0, "FIX"), (-1, "NO_FIX"), (2, "GBAS_FIX"), (77, "77")])
@pytest.mark.parametrize("prefix", ["STATUS_", "STATUS"])
def test_a_readout_shows_a_constant_by_its_name_without_the_prefix(
    status: int, text: str, prefix: str
) -> None:
    more: Any = {"constants": prefix, "field": "status"}
    fields = {"status": status, "service": 1}
    assert shown(HEARD, "sensor_msgs/msg/NavSatStatus", fields, **more)["text"] == text


def test_constants_are_those_of_the_message_around_the_field() -> None:
    level = {"level": 2, "name": "", "message": "", "hardware_id": "", "values": []}
    fields = {"header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}, "status": [level]}
    for prefix in ("E", ""):
        more: Any = {"constants": prefix, "field": "status[0].level"}
        view = shown(HEARD, "diagnostic_msgs/msg/DiagnosticArray", fields, **more)
        assert view["text"] == "ERROR"


JOINTS = "sensor_msgs/msg/JointState"


@pytest.mark.parametrize(
    ("positions", "state", "text", "note"),
    [
        ([1.0, 2.0, 3.5], "live", "3.50 rad", AT),
        ([1.0], "missing", "—", f"no position[2] in the message {AT}"),
        ([], "missing", "—", f"no position[2] in the message {AT}"),
    ],
)
def test_an_element_that_is_not_there_is_not_guessed(
    positions: list[float], state: str, text: str, note: str
) -> None:
    fields = {
        "header": {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""},
        "name": [],
        "position": positions,
        "velocity": [],
        "effort": [],
    }
    more: Any = {"field": "position[2]", "format": ".2f", "unit": "rad"}
    assert english(shown(HEARD, JOINTS, fields, **more)) == {"state": state, "text": text, "note": note}


@pytest.mark.parametrize(
    ("value", "text", "shape", "colour"),
    [
        (0, "Idle", "circle", "grey"),
        (1, "Runs", "triangle", "white"),
        (2, "Fault", "cross", "red"),
        (3, "Unknown: 3", "unknown", "none"),
    ],
)
def test_a_lamp_shows_the_state_of_its_value(value: int, text: str, shape: str, colour: str) -> None:
    assert english(shown(LAMP, "std_msgs/msg/UInt8", {"data": value})) == {
        "state": "live",
        "text": text,
        "shape": shape,
        "colour": colour,
        "note": AT,
    }


LAMP_FILE = """
title = "Cell"

[[page]]
id = "one"
title = "One"

[[page.widget]]
id = "supply"
kind = "indicator"
label = "Supply"
topic = "/heard"
type = "sensor_msgs/msg/BatteryState"
field = "power_supply_status"
states = [
  { value = "POWER_SUPPLY_STATUS_DISCHARGING", text = "Discharging", shape = "circle" },
  { value = 1, text = "Charging", shape = "triangle" },
]
"""


@pytest.mark.parametrize(("status", "text"), [(2, "Discharging"), (1, "Charging"), (4, "Unknown: 4")])
def test_a_lamp_of_a_file_shows_the_state_of_a_constant(tmp_path: Path, status: int, text: str) -> None:
    path = tmp_path / "panel.toml"
    path.write_text(LAMP_FILE)
    panel = load_panel(path)
    assert panel.displays == tuple(panel.widgets())
    robot = robot_there(panel)
    battery = INTERFACES.encode(
        "sensor_msgs/msg/BatteryState", {**BATTERY, "power_supply_status": status}
    )
    robot.update("heard", Sample(battery, 1, NOW, NOW, BRIDGE))
    assert english(build_view(panel, robot, NOW).view["widgets"]["supply"]["text"]) == text


def test_a_lamp_of_a_bool_or_a_text() -> None:
    flag = [{"value": True, "text": "Open", "shape": "circle"}]
    assert shown({**LAMP, "states": flag}, "std_msgs/msg/Bool", {"data": True})["text"] == "Open"
    view = shown({**LAMP, "states": flag}, "std_msgs/msg/Bool", {"data": False})
    assert english((view["text"], view["shape"])) == ("Unknown: false", "unknown")
    text = [{"value": "auto", "text": "Automatic", "shape": "bar"}]
    assert shown({**LAMP, "states": text}, "std_msgs/msg/String", {"data": "auto"})["shape"] == "bar"


@pytest.mark.parametrize(
    ("more", "state", "text", "shape", "note"),
    [
        ({"fields": None}, "waiting", "No value yet", "waiting", "waiting for data"),
        (
            {"now": NOW + 6, "max_age_s": 5.0},
            "old",
            "Unknown",
            "old",
            "was Fault: 6 s old",
        ),
        (
            {"cut": True},
            "old",
            "Unknown",
            "old",
            f"was Fault: from before the connection was lost, {AT}",
        ),
    ],
)
def test_unknown_lamp_has_no_colour_and_its_own_shape(
    more: dict[str, Any], state: str, text: str, shape: str, note: str
) -> None:
    fields = more.pop("fields", {"data": 2})
    view = shown(LAMP, "std_msgs/msg/UInt8", fields, **more)
    look = {"state": state, "text": text, "shape": shape, "colour": "none", "note": note}
    assert english(view) == look


def test_a_lamp_shows_an_unknown_text_by_its_escapes() -> None:
    states = [{"value": "auto", "text": "Automatic", "shape": "bar"}]
    view = shown({**LAMP, "states": states}, "std_msgs/msg/String", {"data": "m\u202ean"})
    assert english(view["text"]) == "Unknown: m\\u202ean"


def test_a_lamp_that_can_not_be_read_says_so() -> None:
    panel = panel_of({**LAMP, "type": "std_msgs/msg/UInt8"})
    robot = robot_there(panel)
    robot.update("heard", Sample(b"broken", 1, NOW, NOW, BRIDGE))
    view = build_view(panel, robot, NOW).view["widgets"]["heard"]
    assert english((view["state"], view["text"], view["shape"])) == (
        "unreadable",
        "Unreadable",
        "unreadable",
    )


def test_time_changes_a_lamp() -> None:
    panel = panel_of({**LAMP, "type": "std_msgs/msg/UInt8", "max_age_s": 5.0})
    robot = RobotState(panel, INTERFACES, DIALECT, TRAITS)
    robot.update(
        "heard", Sample(INTERFACES.encode("std_msgs/msg/UInt8", {"data": 0}), 1, NOW, NOW, None)
    )
    assert build_view(panel, robot, NOW).until == NOW + 5


@pytest.mark.parametrize(
    ("value", "state", "code"),
    [
        (0.5, "live", "readout_time"),
        (math.nan, "unreadable", "gauge_no_number"),
        (math.inf, "unreadable", "number_infinite"),
        (-math.inf, "unreadable", "number_infinite"),
    ],
)
def test_what_is_no_finite_number_is_not_live(value: float, state: str, code: str) -> None:
    view = shown(HEARD, "std_msgs/msg/Float64", {"data": value})
    assert (view["state"], view["note"].code) == (state, code)


@pytest.mark.parametrize(
    ("charge", "scale", "state", "text"),
    [
        (0.87, 100.0, "live", "87 %"),
        (1.0, 100.0, "live", "100 %"),
        (87.0, 100.0, "unreadable", "NaN %"),
        (87.0, 1.0, "live", "87 %"),
    ],
)
def test_charge_of_a_robot_that_publishes_0_to_100_is_not_shown_as_8700_percent(
    charge: float, scale: float, state: str, text: str
) -> None:
    battery = {**HEARD, "field": "percentage", "scale": scale, "unit": "%", "format": ".0f"}
    view = shown(battery, "sensor_msgs/msg/BatteryState", {"percentage": charge})
    assert (view["state"], english(view["text"])) == (state, text)
