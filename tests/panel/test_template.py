"""Message templates: values of inputs put in once, with their type, and braces checked."""

import time
from typing import Any

import pytest

from app.panel.template import add_now, fill, fill_to_send, placeholder_ids, placeholders, value_at
from app.system.errors import FieldError
from tests.support.builders import INTERFACES, TEXT


@pytest.mark.parametrize(
    ("template", "made"),
    [
        ("{a}", "one"),
        ("{n}", 7),
        ("{on}", True),
        ("n = {n}", "n = 7"),
        ("on = {on}", "on = true"),
        ("{a}{a}", "oneone"),
        ("", ""),
        ("plain", "plain"),
        ("{{a}}", "{a}"),
        ("{{{a}}}", "{one}"),
        ("{{", "{"),
        (5, 5),
        (False, False),
        ({"x": {"y": "{n}"}}, {"x": {"y": 7}}),
        ({"x": ["{a}", 2, "{n}!"]}, {"x": ["one", 2, "7!"]}),
        ({}, {}),
    ],
)
def test_inputs_are_put_where_their_ids_stand(template: Any, made: Any) -> None:
    assert fill(template, {"a": "one", "n": 7, "on": True}) == made


@pytest.mark.parametrize("value", ["{b}", "{{", "}", "{0.__class__}", "{a!r}"])
def test_braces_in_a_value_are_only_text(value: str) -> None:
    assert fill("<{a}>", {"a": value, "b": "secret"}) == f"<{value}>"
    assert fill("{a}", {"a": value, "b": "secret"}) == value


def test_negative_input_is_a_number_in_a_number_and_text_in_a_text() -> None:
    assert (
        INTERFACES.decode(TEXT, INTERFACES.encode(TEXT, fill({"data": "-{n}"}, {"n": 7}))).data == "-7"
    )
    for type_name, value in (("std_msgs/msg/Float64", 0.5), ("std_msgs/msg/Int8", 7)):
        payload = INTERFACES.encode(type_name, fill({"data": "-{n}"}, {"n": value}))
        assert INTERFACES.decode(type_name, payload).data == -value
    for other in (True, "a"):
        with pytest.raises(FieldError, match="must be a number"):
            INTERFACES.encode("std_msgs/msg/Float64", fill({"data": "-{n}"}, {"n": other}))


def test_keys_are_not_templates() -> None:
    assert fill({"{a}": 1}, {"a": "x"}) == {"{a}": 1}
    assert list(placeholders({"{a}": 1})) == []


def test_the_template_itself_stays_as_it_is() -> None:
    template = {"x": ["{a}"]}
    fill(template, {"a": "one"})
    assert template == {"x": ["{a}"]}


def test_each_placeholder_is_named_with_its_place() -> None:
    template = {"x": {"y": "{a} and {b}"}, "z": [1, "{a}", {"w": "{{no}}{c}"}]}
    assert list(placeholders(template)) == [("x.y", "a"), ("x.y", "b"), ("z[1]", "a"), ("z[2].w", "c")]


@pytest.mark.parametrize(
    "text",
    [
        "{",
        "}",
        "{a",
        "a}",
        "{}",
        "{0}",
        "{a.b.c}",
        "{a.}",
        "{.b}",
        "{a[0]}",
        "{a!r}",
        "{a:>5}",
        "{ a }",
        "{a-b}",
        "{a{b}}",
    ],
)
def test_invalid_placeholder_is_refused_with_its_place(text: str) -> None:
    with pytest.raises(FieldError, match="brace") as caught:
        list(placeholders({"x": ["", text]}))
    assert caught.value.field == "x[1]"


def test_a_list_can_not_stand_in_a_text() -> None:
    with pytest.raises(FieldError, match="write the input's id alone") as caught:
        fill({"x": "a {a}"}, {"a": [1]})
    assert caught.value.field == "x"


@pytest.mark.parametrize(
    ("where", "value"),
    [("x", "{a}"), ("x.y", "{a}"), ("z[1].w", "{b}"), ("z[7]", [1, {"w": "{b}"}]), ("", None)],
)
def test_value_at_a_field_of_a_template_is_found(where: str, value: Any) -> None:
    template = {"x": "{a}", "z": [1, {"w": "{b}"}]}
    assert value_at(template, where) == (template if value is None else value)


def test_now_is_the_time_of_filling_in() -> None:
    before = time.time_ns()
    values = add_now({"a": 1})
    stamp = fill([{"stamp": "{now}"}], values)[0]["stamp"]
    assert set(stamp) == {"sec", "nanosec"}
    assert before <= stamp["sec"] * 10**9 + stamp["nanosec"] <= time.time_ns()
    assert stamp["nanosec"] < 10**9
    assert values["a"] == 1


def test_now_is_by_the_clock_that_is_given_and_read_only_where_it_is_used() -> None:
    def clock() -> int:
        return 300_250_000_000

    def no_clock() -> int:
        raise AssertionError("not read")

    template = {"header": {"stamp": "{now}"}, "x": ["{a}"]}
    stamped = {"header": {"stamp": {"sec": 300, "nanosec": 250_000_000}}, "x": [1]}
    assert fill_to_send(template, {"a": 1}, clock) == stamped
    assert fill_to_send({"x": "{a}"}, {"a": 1}, no_clock) == {"x": 1}


def test_now_is_no_input() -> None:
    assert placeholder_ids([{"x": "{now}"}, "{a}", ["{b} {a}"]]) == ["a", "b"]
