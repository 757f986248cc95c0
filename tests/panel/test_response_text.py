"""Numbers of a response in the text about it: with a format, a factor, or in four digits."""

import math
import re
from typing import Any

import pytest

from app.cell.commands.services import with_fields
from app.panel.checks.panel import find_faults
from app.panel.response_text import ResponseField, parsed
from app.ros.messages import Interfaces
from app.system.errors import FieldError
from app.system.texts import render
from tests.support.builders import INTERFACES, panel_of

FIBONACCI = {
    "id": "count", "kind": "action", "label": "Count", "action": "/count",
    "type": "example_interfaces/action/Fibonacci", "goal": {"order": 3},
}  # fmt: skip
POINT = "geometry_msgs/msg/Point"


def shown(template: str, value: float, language: str = "en") -> str:
    payload = INTERFACES.encode(POINT, {"x": value})
    return render(with_fields(template, INTERFACES.field_reader(POINT, ["x"]).read(payload)), language)


@pytest.mark.parametrize(
    ("template", "value", "text"),
    [
        ("{x} m", 0.30324747149999704, "0.3032 m"),
        ("{x}", 12345.678, "12,346"),
        ("{x}", -0.5, "-0.5"),
        ("{x}", 5.0, "5"),
        ("{x}", 1e-7, "1e-07"),
        ("{x}", math.inf, "Infinity"),
        ("{x:.3f} m", 0.30324747149999704, "0.303 m"),
        ("{x:+.1f}", 2, "+2.0"),
        ("{x*1000:.0f} mm", 0.3032, "303 mm"),
        ("{x*-0.5}", 3, "-1.5"),
        ("{x:.1%}", 0.123, "12.3%"),
    ],
)
def test_numbers_are_written_as_the_text_says(template: str, value: float, text: str) -> None:
    assert shown(template, value).replace("−", "-").replace(",", "") == text.replace(",", "")


def test_a_format_keeps_the_signs_of_the_language() -> None:
    assert shown("{x:.3f} m", 0.3032, "de") == "0,303 m"


def test_signs_within_quotes_belong_to_the_path() -> None:
    path = "status[name='a*b:c'].level"
    assert parsed(path) == ResponseField(path)
    assert parsed(f"{path}:d") == ResponseField(path, 1.0, "d")


@pytest.mark.parametrize("wrong", ["", ":", "x:", "x:z", "x*:.1f", "x*..:.1f", "x:.3f:.3f"])
def test_what_is_no_field_is_named(wrong: str) -> None:
    with pytest.raises(FieldError, match=re.escape("write {field}, {field:.1f} or")):
        parsed(wrong)


@pytest.mark.parametrize(
    ("result", "words"),
    [
        ("{sequence:.1f}", "a format and a factor are for numbers"),
        ("{sequence[0]*2:d}", "a scaled number"),
        ("{sequence!r}", "is not a field"),
        ("{sequence[0]:.1f", "a brace has no partner; write {field}"),
        ("{sequence[0]:1}", "write {field}"),
    ],
)
def test_a_format_that_does_not_fit_is_a_fault(result: str, words: str) -> None:
    faults = [fault.message for fault in faults_of({**FIBONACCI, "result": result}, INTERFACES)]
    assert bool(faults) is bool(words)
    assert not faults or words in faults[0]


def faults_of(widget: dict[str, Any], interfaces: Interfaces) -> list[Any]:
    return list(find_faults(panel_of(widget), interfaces))
