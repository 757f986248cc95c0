"""Conditions, those of interlocks too: checked when the panel file is loaded, met or not met."""

import math
from pathlib import Path
from typing import Any, Final

import pytest

from app.cell.permission.conditions import permits
from app.cell.permission.interlocks import interlock_verdict
from app.cell.robot.sample_handlers import SampleHandlers
from app.cell.robot.state import RobotState, Sample, SkippedPayload
from app.cell.session.ingest import Ingest
from app.panel import load_panel
from app.panel.checks.conditions import condition_faults
from app.panel.condition import Condition, Interlock
from app.ros.zenoh.inbox import Changes
from app.system.errors import PanelError
from tests.support.builders import BRIDGE, ENABLED, INTERFACES, NOW, Table, robot_there
from tests.support.samples import BATTERY
from tests.support.words import coded

FILE: Final = """
title = "Cell"
[[interlock]]
id = "air"
label = "Air pressure"
topic = "/operation_enabled"
type = "{type}"
{conditions}
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Empty"
message = {{}}
interlock = "air"
"""
LEVEL: Final[Table] = {"name": "", "message": "", "hardware_id": "", "values": []}


def file_of(folder: Path, type_name: str, conditions: str) -> Path:
    whole = type_name if "/" in type_name else f"std_msgs/msg/{type_name}"
    path = folder / "cell.toml"
    path.write_text(FILE.format(type=whole, conditions=conditions))
    return path


def robot_of(path: Path) -> tuple[RobotState, Interlock]:
    panel = load_panel(path)
    return robot_there(panel), panel.interlocks[0]


def said(robot: RobotState, interlock: Interlock, fields: Table) -> tuple[Any, ...] | None:
    """The code of the reason after the robot said this, and what it is about; None where it permits."""
    payload = INTERFACES.encode(interlock.type, fields)
    robot.update(robot.key(ENABLED), Sample(payload, 1, NOW, NOW, BRIDGE))
    verdict = interlock_verdict(interlock, robot, NOW)
    assert verdict.permitted is (verdict.reason is None)
    return coded(verdict.reason, "name", "value", "wanted") if verdict.reason else None


def unmet(value: str, wanted: str) -> tuple[str, ...]:
    """The reason with which this value does not permit."""
    return "interlock_condition_unmet", "Air pressure", value, wanted


@pytest.mark.parametrize(
    ("type_name", "conditions", "good", "bad", "value", "wanted"),
    [
        ("Float64", "min = 5\nunit = 'bar'", 5.0, 3.2, "3.2 bar", "5 bar or more"),
        ("Float64", "max = 0.5", 0.5, 0.75, "0.75", "0.5 or less"),
        ("Float64", "min = 1\nmax = 2", 1.5, 2.5, "2.5", "1 to 2"),
        ("Float64", "min = 5", 6.0, 4.99999999, "4.99999999", "5 or more"),
        ("Float64", "min = 5", math.inf, -math.inf, "−Infinity", "5 or more"),
        ("Float64", "min = 5", 5.0, math.nan, "not a number (NaN)", "5 or more"),
        ("Float64", "not_equals = 0", 1.0, math.nan, "not a number (NaN)", "not 0"),
        ("Float64", "not_equals = 0", math.inf, 0.0, "0", "not 0"),
        ("Float64", "max = 9\nnot_equals = 0", 9.0, 0.0, "0", "9 or less and not 0"),
        ("Float64", "one_of = [1, 2.5, 4]", 2.5, math.nan, "not a number (NaN)", "1, 2.5 or 4"),
        ("Float64", "equals = inf", math.inf, 1e308, "1e+308", "Infinity"),
        ("Float32", "equals = 0.1", 0.1, 0.2, "0.2", "0.1"),
        ("Float32", "max = 0.1", 0.1, 0.10000001, "0.100000009", "0.1 or less"),
        ("Float32", "min = 0.3", 0.3, 0.1, "0.1", "0.3 or more"),
        ("UInt8", "equals = 3", 3, 4, "4", "3"),
        ("UInt8", "one_of = [1]", 1, 0, "0", "1"),
        ("UInt8", "one_of = [1, 2]", 2, 3, "3", "1 or 2"),
        ("Int64", "max = 9007199254740993", 9007199254740993, 9007199254740994,
         "9007199254740994", "9007199254740993 or less"),
        ("Bool", "equals = false", False, True, "true", "false"),
        ("Bool", "not_equals = true", False, True, "true", "not true"),
        ("String", "equals = 'auto'", "auto", "manual", '"manual"', '"auto"'),
        ("String", "not_equals = ''", "x", "", '""', 'not ""'),
        ("String", "one_of = ['a', 'b', 'c']", "c", "x" * 99,
         f'"{"x" * 39}…"', '"a", "b" or "c"'),
    ],
)  # fmt: skip
def test_unmet_condition_names_the_present_and_the_required_value(
    tmp_path: Path, type_name: str, conditions: str, good: Any, bad: Any, value: str, wanted: str
) -> None:
    robot, interlock = robot_of(file_of(tmp_path, type_name, conditions))
    assert said(robot, interlock, {"data": good}) is None
    assert said(robot, interlock, {"data": bad}) == unmet(value, wanted)


def test_constants_stand_for_their_values_and_are_shown_by_their_names(tmp_path: Path) -> None:
    conditions = (
        'field = "power_supply_status"\n'
        'one_of = ["POWER_SUPPLY_STATUS_CHARGING", "POWER_SUPPLY_STATUS_FULL"]'
    )
    robot, interlock = robot_of(file_of(tmp_path, "sensor_msgs/msg/BatteryState", conditions))
    assert said(robot, interlock, {**BATTERY, "power_supply_status": 4}) is None
    reason = said(robot, interlock, {**BATTERY, "power_supply_status": 2})
    assert reason == unmet("DISCHARGING", "CHARGING or FULL")
    reason = said(robot, interlock, {**BATTERY, "power_supply_status": 77})
    assert reason == unmet("77", "CHARGING or FULL")


@pytest.mark.parametrize(
    ("condition", "reason"),
    [
        ('equals = "OK"', unmet("ERROR", "OK")),
        ('max = "WARN"', unmet("ERROR", "WARN or less")),
        ("max = 1", unmet("2", "1 or less")),
    ],
)
def test_level_is_shown_by_its_constants_name(
    tmp_path: Path, condition: str, reason: tuple[str, ...]
) -> None:
    conditions = f'field = "level"\n{condition}'
    robot, interlock = robot_of(file_of(tmp_path, "diagnostic_msgs/msg/DiagnosticStatus", conditions))
    assert said(robot, interlock, {**LEVEL, "level": 0}) is None
    assert said(robot, interlock, {**LEVEL, "level": 2}) == reason


@pytest.mark.parametrize(
    ("type_name", "conditions", "place", "fault"),
    [
        ("Float64", "", "field", '"data" is float64: an interlock needs a bool, or conditions'),
        ("UInt8", "equals = 256", "equals", "256 is out of range: uint8 goes from 0 to 255"),
        ("UInt8", "min = -1", "min", "-1 is out of range: uint8 goes from 0 to 255"),
        ("UInt8", "max = 2.5", "max", "must be a whole number (uint8), not 2.5"),
        ("UInt8", "equals = true", "equals", "must be a whole number (uint8), not true"),
        ("UInt8", "equals = 'ON'", "equals", 'the name of a constant of std_msgs/msg/UInt8, not "ON"'),
        ("Float32", "min = 1e300", "min", "1e+300 is out of range: float32 goes to 3.40282e+38"),
        ("Float64", "min = 3\nmax = 2", "max", "2 is less than min (3): no value permits"),
        ("UInt8", "min = 3\nmax = 3\nnot_equals = 3", "not_equals", "3 is all that the limits leave"),
        ("UInt8", "max = 0\nnot_equals = 0", "not_equals", "0 is all that the limits leave"),
        ("Float64", "equals = nan", "equals", "NaN is no value that could permit"),
        ("Float64", "one_of = [1, 1.0]", "one_of[1]", "1.0 is there already"),
        ("Float64", "one_of = 3", "one_of", "must be a list of values, not 3"),
        ("Float64", "one_of = [1, [2]]", "one_of[1]", "must be a number, true or false, or text, not"),
        ("Float64", "equals = 1\nmin = 0", "min", "has no meaning beside equals, which says all"),
        ("Bool", "min = 1", "min", 'is for numbers; "data" is bool'),
        ("Bool", "equals = 1", "equals", "must be true or false, not 1"),
        ("String", "equals = 1", "equals", "must be text (string), not 1"),
        ("String", "max = 'z'", "max", 'is for numbers; "data" is string'),
        ("diagnostic_msgs/msg/DiagnosticStatus", 'field = "level"\nequals = "WARM"', "equals",
         "did you mean WARN? it has OK, WARN, ERROR, STALE"),
    ],
)  # fmt: skip
def test_a_condition_that_can_not_hold_is_a_fault(
    tmp_path: Path, type_name: str, conditions: str, place: str, fault: str
) -> None:
    with pytest.raises(PanelError) as caught:
        load_panel(file_of(tmp_path, type_name, conditions))
    reported = {entry.place: entry.message for entry in caught.value.faults}
    assert fault in reported.pop(f"interlock[0].{place}")
    assert reported == {}


@pytest.mark.parametrize("value", [None, "true", 1, 1.0, [True], b"\1"])
def test_without_comparisons_only_true_meets_a_condition(value: Any) -> None:
    assert permits(Condition(topic="/a"), True)
    assert not permits(Condition(topic="/a"), value)


def test_a_missing_value_meets_no_condition() -> None:
    for comparisons in ({"not_equals": 0}, {"min": 0}, {"one_of": [0]}):
        assert not permits(Condition.model_validate({"topic": "/a", **comparisons}), None)


@pytest.mark.parametrize(
    ("keys", "place", "fault"),
    [
        ({}, "field", '"data" is float64: a condition needs a bool, or conditions'),
        ({"min": 3, "max": 2}, "max", "2 is less than min (3): no value permits"),
        ({"equals": "ON"}, "equals", 'the name of a constant of std_msgs/msg/Float64, not "ON"'),
        ({"field": "dat", "min": 1}, "field", "dat"),
        ({"max": 1, "qos": {"reliability": "best_effort"}}, "max_age_s", "is missing"),
    ],
)
def test_a_condition_without_an_interlock_is_checked_at_its_place(
    keys: Table, place: str, fault: str
) -> None:
    condition = Condition.model_validate({"topic": "/a", "type": "std_msgs/msg/Float64", **keys})
    faults = list(condition_faults("alarm[2]", condition, INTERFACES))
    assert [reported.place for reported in faults] == [f"alarm[2].{place}"]
    assert fault in faults[0].message


def test_a_value_that_only_changes_the_reason_waits_for_the_next_frame(tmp_path: Path) -> None:
    """A pressure that trembles below its limit must cost no more than a readout."""
    path = file_of(tmp_path, "Float64", "min = 5")
    panel = load_panel(path)
    robot = robot_there(panel)
    intake = Ingest(panel, robot, SampleHandlers())
    shows: list[float] = []

    def take(value: float, *between: float) -> tuple[bool, bool]:
        def encoded(number: float) -> bytes:
            return INTERFACES.encode("std_msgs/msg/Float64", {"data": number})

        passed = tuple(SkippedPayload(encoded(number), NOW, NOW) for number in between)
        sample = Sample(encoded(value), 1, NOW, NOW, BRIDGE, skipped_payloads=passed)
        *between_two, last = intake.steps(Changes({robot.key(ENABLED): sample}, {}, True))
        shows.extend(value for _ in between_two)
        return last.urgent, last.other

    assert take(3.0) == (False, True)  # it was waited for: locked then as now
    assert take(3.1) == (False, True)
    assert take(3.1) == (False, False)
    assert take(6.0) == (True, False)
    assert take(6.1) == (False, False)
    assert shows == []
    assert take(6.2, 4.0) == (True, False)
    assert shows == [6.2]


@pytest.mark.parametrize(
    ("type_name", "conditions", "place", "words"),
    [
        (
            "Float64",
            'scale = 100\nequals = "FULL"',
            "interlock[0].equals",
            'as it is shown, not "FULL"',
        ),
        ("Float64", "scale = 100\nmin = 20\nmax = 15", "interlock[0].max", "15 is less than min (20)"),
        ("Float64", "scale = -1\nmin = 20\nmax = 15", "interlock[0].max", "15 is less than min (20)"),
        (
            "Int8",
            "scale = 0.1\nequals = 0.25",
            "interlock[0].equals",
            "is 2.5 in the message, which must",
        ),
        (
            "Int8",
            'scale = 0.1\nmin = 0.25\nformat = "d"',
            "interlock[0].format",
            "is for whole numbers",
        ),
        ("Header", 'field = "age(stamp)"\nmax = 5', "interlock[0].max_age_s", "its message arrived"),
    ],
)
def test_a_scale_that_does_not_fit_is_a_fault(
    tmp_path: Path, type_name: str, conditions: str, place: str, words: str
) -> None:
    with pytest.raises(PanelError) as error:
        load_panel(file_of(tmp_path, type_name, conditions))
    (fault,) = error.value.faults
    assert fault.place == place
    assert words in fault.message


@pytest.mark.parametrize(("scale", "limit", "met"), [(0.1, "min = 0.25", [3]), (-1, "max = -3", [3])])
def test_limits_between_two_values_of_a_field(
    tmp_path: Path, scale: float, limit: str, met: list[int]
) -> None:
    conditions = f'field = "data"\nscale = {scale}\n{limit}'
    _, interlock = robot_of(file_of(tmp_path, "Int8", conditions))
    assert [value for value in (1, 2, 3) if permits(interlock, value)] == met
