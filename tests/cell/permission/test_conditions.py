"""The state of a condition without an interlock: its value, what the value must be, and the verdict."""

import math
from collections.abc import Callable, Mapping

import pytest

from app.cell.permission import conditions
from app.cell.permission.conditions import ConditionState, condition_state, refusal
from app.cell.permission.interlocks import interlock_verdict, link_verdict
from app.cell.permission.verdict import Verdict, locked
from app.cell.robot.state import RobotState, Sample
from app.panel.condition import Condition, Interlock
from app.panel.constants import resolve_condition
from app.panel.model import Panel
from app.panel.numbers import to_float32
from app.system.texts import TextLike, render
from tests.support.builders import (
    BOOL,
    BRIDGE,
    ENABLED,
    INTERFACES,
    NOTHING,
    NOW,
    TEXT,
    Table,
    endpoint,
    permits,
    robot_there,
    says,
    small_panel,
)
from tests.support.samples import BATTERY

FLOAT = "std_msgs/msg/Float64"
BATTERY_TYPE = "sensor_msgs/msg/BatteryState"
SCALED = {"type": BATTERY_TYPE, "field": "percentage", "scale": 100, "unit": "%"}


def air(**keys: object) -> Condition:
    """An air pressure of 5 bar or more."""
    pressure = {"label": "Air pressure", "topic": ENABLED, "type": FLOAT, "min": 5, "unit": "bar"}
    return Condition.model_validate(pressure | keys)


def air_interlock(sentence: object) -> Interlock:
    keys = {"id": "air", "topic": ENABLED, "type": FLOAT, "min": 5, "unit": "bar", "locked": sentence}
    return Interlock.model_validate(keys)


def panel_on(type_name: str, comparison: Table = NOTHING) -> Panel:
    """A panel that subscribes to the topic with this type."""
    return small_panel({"type": type_name, **comparison})


def state_of(condition: Condition, robot: RobotState, now: float = NOW) -> ConditionState:
    return condition_state(condition, robot, now, link_verdict(robot, now))


def texts(state: ConditionState) -> tuple[str, str, bool]:
    def english(text: TextLike) -> str:
        return render(text)

    return english(state.value), english(state.need), state.verdict.permitted


@pytest.fixture
def robot() -> RobotState:
    """Its air pressure is 6 bar."""
    cell = robot_there(panel_on(FLOAT, {"min": 5.0}))
    says(cell, ENABLED, 6.0, FLOAT)
    return cell


@pytest.mark.parametrize(
    ("value", "shown", "met"),
    [
        (6.0, "6 bar", True),
        (5.0, "5 bar", True),
        (3.2, "3.2 bar", False),
        (4.99999999, "4.99999999 bar", False),
        (math.nan, "not a number (NaN)", False),
    ],
)
def test_a_state_has_the_value_and_its_need_whether_met_or_not(
    robot: RobotState, value: float, shown: str, met: bool
) -> None:
    says(robot, ENABLED, value, FLOAT)
    assert texts(state_of(air(), robot)) == (shown, "5 bar or more", met)


def test_reason_of_an_unmet_condition_names_the_condition(robot: RobotState) -> None:
    says(robot, ENABLED, 3.2, FLOAT)
    reason = state_of(air(), robot).verdict.reason
    assert render(reason or "") == "Air pressure is 3.2 bar: it must be 5 bar or more."


@pytest.mark.parametrize(("label", "name"), [(None, ENABLED), ("Operation", "Operation")])
def test_without_a_label_a_condition_is_named_by_its_topic(label: str | None, name: str) -> None:
    robot = robot_there(small_panel())
    permits(robot, False)
    verdict = state_of(Condition(topic=ENABLED, label=label), robot).verdict
    assert verdict == locked("interlock_not_permitted", name=name)


@pytest.mark.parametrize(("value", "shown"), [(True, "true"), (False, "false")])
def test_without_comparisons_the_value_must_be_true(value: bool, shown: str) -> None:
    robot = robot_there(small_panel())
    permits(robot, value)
    assert texts(state_of(Condition(topic=ENABLED), robot)) == (shown, "true", value)


@pytest.mark.parametrize(
    ("keys", "wanted", "met"),
    [
        ({"equals": 6.0}, "6 bar", True),
        ({"not_equals": 6.0}, "not 6 bar", False),
        ({"not_equals": 5.0}, "not 5 bar", True),
        ({"max": 5.5}, "5.5 bar or less", False),
        ({"max": 6.0}, "6 bar or less", True),
        ({"min": 5, "max": 8}, "5 to 8 bar", True),
        ({"min": 5, "not_equals": 6}, "5 bar or more and not 6 bar", False),
        ({"one_of": [1, 6, 7]}, "1 bar, 6 bar or 7 bar", True),
    ],
)
def test_reason_of_each_comparison_names_the_required_value(
    robot: RobotState, keys: Table, wanted: str, met: bool
) -> None:
    assert texts(state_of(air(**{"min": None, **keys}), robot)) == ("6 bar", wanted, met)


def test_no_number_does_not_count_as_another_number(robot: RobotState) -> None:
    says(robot, ENABLED, math.nan, FLOAT)
    assert not state_of(air(min=None, not_equals=6.0), robot).verdict.permitted


def test_constants_are_shown_by_their_names() -> None:
    path = {"field": "power_supply_status", "equals": 1}
    robot = robot_there(panel_on(BATTERY_TYPE, path))
    table = {"topic": ENABLED, "type": BATTERY_TYPE, **path, "equals": "POWER_SUPPLY_STATUS_FULL"}
    full = resolve_condition(Condition.model_validate(table), INTERFACES)
    payload = INTERFACES.encode(BATTERY_TYPE, {**BATTERY, "power_supply_status": 2})
    robot.update(robot.key(ENABLED), Sample(payload, 1, NOW, NOW, BRIDGE))
    assert texts(state_of(full, robot)) == ("DISCHARGING", "FULL", False)


def test_a_field_that_is_missing_in_the_message_locks() -> None:
    floats, path = "std_msgs/msg/Float32MultiArray", {"field": "data[1]", "min": 5.0}
    robot = robot_there(panel_on(floats, path))
    says(robot, ENABLED, [6.0], floats)
    state = state_of(Condition.model_validate({"topic": ENABLED, "type": floats, **path}), robot)
    missing = locked("interlock_field_missing", field="data[1]", topic=ENABLED)
    assert (state.value, state.verdict) == ("", missing)


def test_a_value_that_never_arrived_is_unknown() -> None:
    state = state_of(air(), robot_there(panel_on(FLOAT, {"min": 5.0})))
    assert texts(state) == ("", "5 bar or more", False)
    assert state.verdict == locked("interlock_waiting", topic="Air pressure", wanted=FLOAT)


def test_a_stale_value_is_shown_but_does_not_count(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, FLOAT)
    fresh = state_of(air(max_age_s=2), robot, NOW + 1.9)
    assert fresh.verdict == Verdict(True, until=NOW + 2)
    state = state_of(air(max_age_s=2), robot, NOW + 2)
    assert texts(state) == ("6 bar", "5 bar or more", False)
    assert state.verdict == locked("interlock_stale", topic="Air pressure", limit="2")


def test_a_value_before_a_cut_is_unknown(robot: RobotState) -> None:
    robot.mark_peer_lost(BRIDGE, 2)
    state = state_of(air(), robot)
    assert (state.value, state.verdict) == (
        "",
        locked("interlock_connection_lost", topic="Air pressure", wanted=FLOAT),
    )


def test_without_a_link_no_condition_is_met(robot: RobotState) -> None:
    robot.link_up = False
    assert state_of(air(), robot).verdict == locked("link_unreachable")


@pytest.mark.parametrize(
    ("value", "comparisons", "is_met", "shown"),
    [
        (0.29, {"min": 29}, True, ""),
        (0.2899, {"min": 29, "format": ".0f"}, False, "28.99 %"),  # "29 %" would look like the limit
        (0.123, {"min": 29, "format": ".0f"}, False, "12 %"),
        (0.29, {"equals": 29}, True, ""),
        (0.3, {"max": 29.5}, False, "30 %"),
        (0.3, {"scale": -100, "min": -29}, False, "−30 %"),
        (0.3, {"scale": 1, "offset": -0.5, "unit": "", "max": -0.1}, True, ""),
    ],
)
def test_comparisons_are_of_the_value_that_is_shown(
    value: float, comparisons: Table, is_met: bool, shown: str
) -> None:
    table = {"topic": ENABLED, **SCALED, **comparisons}
    condition = resolve_condition(Condition.model_validate(table), INTERFACES)
    received = to_float32(value)
    assert conditions.permits(condition, received) is is_met
    if not is_met:
        assert f"{ENABLED} is {shown}: it must be" in render(conditions.unmet(condition, received))


def test_a_topic_of_another_type_does_not_meet_a_condition(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, TEXT)
    verdict = state_of(air(), robot).verdict
    assert verdict == locked("topic_wrong_type", topic=ENABLED, found=TEXT, wanted=FLOAT)


@pytest.mark.parametrize("value", [True, False])
@pytest.mark.parametrize("age", [0.0, 1.5, 2.5])
def test_an_interlock_has_the_verdict_of_its_condition(value: bool, age: float) -> None:
    panel = small_panel({"label": "Operation", "max_age_s": 2.0})
    robot = robot_there(panel)
    endpoint(robot, "MP", ENABLED, BOOL)
    permits(robot, value)
    condition = Condition(topic=ENABLED, label="Operation", max_age_s=2.0)
    verdict = interlock_verdict(panel.interlocks[0], robot, NOW + age)
    assert state_of(condition, robot, NOW + age).verdict == verdict


@pytest.mark.parametrize(
    ("sentence", "english", "german"),
    [
        ("Air is low.", "Air is low.", "Air is low."),
        ("Air is at {value}.", "Air is at 4.5 bar.", "Air is at 4,5 bar."),
        ({"en": "Air: {value}", "de": "Ventil öffnen."}, "Air: 4.5 bar", "Ventil öffnen."),
    ],
)
def test_a_panels_own_sentence_is_the_reason(
    sentence: str | Mapping[str, str], english: str, german: str
) -> None:
    verdict = refusal(air_interlock(sentence), 4.5)
    assert verdict.code == "interlock_condition_unmet"
    assert verdict.reason is not None
    assert (render(verdict.reason), render(verdict.reason, "de")) == (english, german)


def test_a_bools_own_sentence_keeps_its_code() -> None:
    verdict = refusal(Interlock(id="guard", topic="/guard", locked="Close the guard door."), False)
    assert verdict == Verdict(False, "interlock_not_permitted", "Close the guard door.")


def test_a_panels_own_sentence_is_only_for_a_value_that_is_known() -> None:
    state = state_of(
        Interlock(id="guard", topic=ENABLED, locked="Close the guard door."), robot_there(small_panel())
    )
    assert state.verdict.code == "interlock_waiting"


def reported_long_ago(robot: RobotState) -> None:
    endpoint(robot, "MP", ENABLED, FLOAT)
    says(robot, ENABLED, 6.0, FLOAT, at=NOW - 3)


# What can be wrong with a topic: keys of the interlock, what happens to the robot, the lock's code.
LOCKS: Mapping[str, tuple[Table, Callable[[RobotState], object], str]] = {
    "nothing came": (NOTHING, lambda robot: None, "interlock_waiting"),
    "nobody publishes": ({"require_publisher": True}, lambda robot: None, "interlock_no_publisher"),
    "not a double": (NOTHING, lambda robot: says(robot, ENABLED, "5"), "interlock_unreadable"),
    "old": (
        {"max_age_s": 2},
        reported_long_ago,
        "interlock_stale",
    ),
    "NaN": (NOTHING, lambda robot: says(robot, ENABLED, math.nan, FLOAT), "interlock_condition_unmet"),
    "low": (NOTHING, lambda robot: says(robot, ENABLED, 4.0, FLOAT), "interlock_condition_unmet"),
}


@pytest.mark.parametrize("name", LOCKS)
def test_a_lock_calls_the_value_by_its_label(name: str) -> None:
    keys, happens, code = LOCKS[name]
    labelled = Interlock.model_validate(air().model_dump(exclude_unset=True) | {"id": "air", **keys})
    robot = robot_there(panel_on(FLOAT, {"min": 5.0}))
    happens(robot)
    verdict = interlock_verdict(labelled, robot, NOW)
    assert verdict.code == code
    for language in ("en", "de", "ja"):
        sentence = render(verdict.reason or "", language)
        assert "Air pressure" in sentence
        assert ENABLED not in sentence
