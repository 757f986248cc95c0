"""What an operator entered: typed from forms, checked with a sentence that names label and limits."""

import math
from collections.abc import Mapping
from typing import Any

import pytest
from hypothesis import given as varied
from hypothesis import strategies as st

from app.panel import Input
from app.panel.numbers import Range
from app.system.errors import InputError
from app.system.texts import ENGLISH
from tests.support.builders import panel_of
from tests.support.words import coded, english

pytestmark = pytest.mark.promise("numbers")

SPEED: Mapping[str, Any] = {
    "id": "speed", "kind": "number", "label": "Speed", "min": -0.5, "max": 1.5, "step": 0.1,
    "unit": "m/s",
}  # fmt: skip
FREE: Mapping[str, Any] = {
    "id": "free", "kind": "slider", "label": "Free", "min": -1.0, "max": 1, "unit": "rad",
}  # fmt: skip
COUNT: Mapping[str, Any] = {"id": "count", "kind": "slider", "label": "Count", "min": 1, "max": 99}
MODE: Mapping[str, Any] = {
    "id": "mode", "kind": "select", "label": "Mode", "options": [
        {"value": 0, "label": "Zero"},
        {"value": True, "label": "True"},
        {"value": 1.5, "label": "Float"},
        {"value": "slow", "label": "Slow"},
        {"value": {"x": 1}, "label": "Table"},
        {"value": 2**63 - 1, "label": "Large"},
    ],
}  # fmt: skip
LIGHT: Mapping[str, Any] = {"id": "light", "kind": "toggle", "label": "Light", "on": "Shines"}


def input_of(table: Mapping[str, Any]) -> Input:
    (widget,) = panel_of(table).widgets()
    assert isinstance(widget, Input)
    return widget


def exactly(value: Any, wanted: Any) -> bool:
    return value == wanted and type(value) is type(wanted)


@pytest.mark.parametrize(
    ("table", "entered", "value"),
    [
        (SPEED, 0, 0.0),
        (SPEED, -0.5, -0.5),
        (SPEED, 1.5, 1.5),
        (SPEED, 0.3, 0.3),
        (SPEED, 1.1, 1.1),
        (FREE, 0.123456789, 0.123456789),
        (FREE, -1, -1.0),
        (FREE, 1e-300, 1e-300),
        (COUNT, 1, 1),
        (COUNT, 99.0, 99),
        (MODE, 0, 0),
        (MODE, 0.0, 0),
        (MODE, "0", 0),
        (MODE, True, True),
        (MODE, "true", True),
        (MODE, "1.5", 1.5),
        (MODE, "slow", "slow"),
        (MODE, {"x": 1}, {"x": 1}),
        (MODE, '{"x": 1}', {"x": 1}),
        (MODE, "9223372036854775807", 2**63 - 1),
        (LIGHT, True, True),
        (LIGHT, False, False),
    ],
)
def test_a_value_is_taken_with_the_type_of_its_input(
    table: Mapping[str, Any], entered: Any, value: Any
) -> None:
    assert exactly(input_of(table).check_value(entered), value)


# What a refusal says of each input.
TAKES: Mapping[str, Mapping[str, Any]] = {
    "Speed": {"limits": "−0.5 to 1.5 m/s, in steps of 0.1"},
    "Free": {"limits": "−1 to 1 rad"},
    "Count": {"limits": "1 to 99, in steps of 1"},
    "Mode": {"options": ("Zero", "True", "Float", "Slow", "Table", "Large")},
    "Light": {"on": "Shines", "off": "Off"},
}


@pytest.mark.parametrize(
    ("table", "entered", "code", "shown"),
    [
        (SPEED, 1.6, "input_outside_limits", "1.6"),
        (SPEED, -0.6, "input_outside_limits", "−0.6"),
        (SPEED, 0.25, "input_outside_limits", "0.25"),
        (SPEED, math.nan, "input_outside_limits", "nan"),
        (SPEED, math.inf, "input_outside_limits", "inf"),
        (SPEED, -math.inf, "input_outside_limits", "−inf"),
        (SPEED, 10**400, "input_outside_limits", f"1{'0' * 17}...{'0' * 19}"),
        (SPEED, 1e308, "input_outside_limits", "1e+308"),
        (SPEED, "", "input_number_empty", None),
        (SPEED, None, "input_number_empty", None),
        (SPEED, "fast", "input_not_a_number", '"fast"'),
        (SPEED, "1", "input_not_a_number", '"1"'),
        (SPEED, True, "input_not_a_number", "true"),
        (SPEED, [1], "input_not_a_number", "[1]"),
        (FREE, 1.0001, "input_outside_limits", "1.0001"),
        (FREE, math.nan, "input_outside_limits", "nan"),
        (FREE, "", "input_number_empty", None),
        (COUNT, 1.5, "input_outside_limits", "1.5"),
        (COUNT, 100, "input_outside_limits", "100"),
        (MODE, 1, "input_not_an_option", "1"),
        (MODE, False, "input_not_an_option", "false"),
        (MODE, None, "input_not_an_option", "null"),
        (MODE, ["x"], "input_not_an_option", '["x"]'),
        (LIGHT, 1, "input_not_a_boolean", "1"),
        (LIGHT, "true", "input_not_a_boolean", '"true"'),
        (LIGHT, None, "input_not_a_boolean", "null"),
    ],
)
def test_invalid_input_is_refused_with_label_and_limits(
    table: Mapping[str, Any], entered: Any, code: str, shown: str | None
) -> None:
    with pytest.raises(InputError) as caught:
        input_of(table).check_value(entered)
    assert coded(caught.value.text, "label", "given") == (code, table["label"], shown)
    about = TAKES[table["label"]]
    assert coded(caught.value.text, *about)[1:] == tuple(about.values())
    assert len(str(caught.value)) < 200


@pytest.mark.parametrize(
    ("table", "text", "value"),
    [
        (SPEED, "0.5", 0.5),
        (SPEED, "-.5", "-.5"),
        (SPEED, " 1 ", 1),
        (SPEED, "1e-1", "1e-1"),
        (COUNT, "5", 5),
        (COUNT, "5.0", 5),
        (COUNT, "5.5", "5.5"),
        (COUNT, "1,000", 1000),
        (SPEED, "", ""),
        (SPEED, "nan", "nan"),
        (SPEED, "inf", "inf"),
        (SPEED, "1_0", "1_0"),
        (SPEED, "٣", "٣"),
        (SPEED, "1e999", "1e999"),
        (LIGHT, "true", True),
        (LIGHT, "false", False),
        (LIGHT, "on", "on"),
        (MODE, "0", "0"),
    ],
)
def test_form_text_is_converted_to_the_type_of_its_input(
    table: Mapping[str, Any], text: str, value: Any
) -> None:
    assert exactly(input_of(table).parse_text(text, ENGLISH), value)


def test_limits_read_as_an_operator_says_them() -> None:
    for table, text in ((COUNT, "1 to 99, in steps of 1"), (FREE, "−1 to 1 rad")):
        widget: Any = input_of(table)
        assert english(widget.limits_text) == text


@pytest.mark.parametrize(
    ("more", "step", "whole"),
    [
        ({"min": 0, "max": 10}, "1", True),
        ({"min": 0.0, "max": 10}, "any", False),
        ({"min": 0, "max": 10.0}, "any", False),
        ({"min": -1.0, "max": 1.0}, "any", False),
        ({"min": 0, "max": 1.5}, "any", False),
        ({"min": 0, "max": 10, "step": 0.5}, "0.5", False),
        ({"min": 0.0, "max": 10.0, "step": 1}, "1", True),
        ({"min": 0.5, "max": 10.5, "step": 1}, "1", False),
    ],
)
def test_limits_that_are_written_as_whole_numbers_have_whole_steps(
    more: Mapping[str, Any], step: str, whole: bool
) -> None:
    widget: Any = input_of({"id": "n", "kind": "number", "label": "N", **more})
    assert (widget.html_attributes["step"], widget.is_whole) == (step, whole)


def test_value_within_a_billionth_of_a_step_is_accepted_unchanged() -> None:
    speed, count = input_of(SPEED), input_of(COUNT)
    for entered in (0.1 + 0.2, 0.1 * 3 + 0.4, 1.1 - 0.2, 0.3 + 1e-10, 0.3 - 1e-10, -0.1 - 0.2):
        assert speed.check_value(entered) == entered
    for entered in (0.3 + 2e-10, 0.3 - 2e-10, 0.25, 1.5 + 1e-12, -0.5 - 1e-12):  # limits are exact
        with pytest.raises(InputError):
            speed.check_value(entered)
    for entered in (0.1 * 3 * 10, 2.9999999999999996, 3.0000000005):
        assert exactly(count.check_value(entered), 3)
    for entered in (3.00000001, 2.5):
        with pytest.raises(InputError):
            count.check_value(entered)


def test_whole_numbers_are_compared_exactly() -> None:
    large = input_of(
        {"id": "n", "kind": "number", "label": "N", "min": 0, "max": 10**13, "step": 10**10}
    )
    assert large.check_value(2 * 10**10) == 2 * 10**10
    with pytest.raises(InputError):
        large.check_value(2 * 10**10 + 1)


@varied(st.integers(-10_000, 10_000), st.sampled_from([0.1, 0.01, 0.25, 0.3, 1e-3, 2.5, 7.0]))
def test_every_sum_of_steps_is_taken(steps: int, step: float) -> None:
    low, high = round(-20_000 * step, 6), round(20_000 * step, 6)
    table = {"id": "n", "kind": "number", "label": "N", "min": low, "max": high, "step": step}
    added = step * steps
    assert input_of(table).check_value(added) == added
    assert Range(low, high, step).contains(added)


def test_every_value_on_a_step_is_taken() -> None:
    speed = input_of(SPEED)
    for number in range(-5, 16):
        assert speed.check_value(float(f"{number / 10:.1f}")) == number / 10
