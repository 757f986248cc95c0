"""Units of what is entered and of what is sent: known pairs, and notes about those that differ."""

import math
from typing import Any

import pytest

from app.panel.checks.notes import unit_notes
from app.panel.numbers import conversion, units_like
from app.panel.widgets.numbers import Numeric
from tests.support.builders import FREE, INTERFACES, panel_of

WAY = {"id": "way", "kind": "number", "label": "Way", "min": 0, "max": 40, "unit": "mm"}
TWIST = {"type": "geometry_msgs/msg/Twist", "message": {"linear": {"x": "{way}"}}}
POSE = {"type": "geometry_msgs/msg/Pose", "message": {"position": {"x": "-{way}"}}}


@pytest.mark.parametrize(
    ("unit", "other", "value", "sent"),
    [
        ("mm", "m", 40, 0.04),
        ("m", "mm", 0.3, 300),
        ("°", "rad", 180, math.pi),
        ("rad", "°", math.pi, 180),
        ("%", "1", 15, 0.15),
        ("rpm", "rad/s", 60, 2 * math.pi),
        ("°C", "K", 21.5, 294.65),
        ("K", "°C", 273.15, 0),
        ("bar", "Pa", 6.2, 620_000),
        ("km/h", "m/s", 3.6, 1),
        ("rpm", "1/min", 33, 33),
    ],
)
def test_pairs_convert_as_physics_does(unit: str, other: str, value: float, sent: float) -> None:
    known = conversion(unit, other)
    assert known is not None
    assert float(known.apply(value)) == pytest.approx(sent, rel=1e-15, abs=1e-12)
    assert other in units_like(unit)


def test_pairs_of_different_quantities_are_not_known() -> None:
    assert conversion("mm", "rad") is None
    assert conversion("", "m") is None
    assert units_like("apples") == []


def notes(entry: dict[str, Any], sent: dict[str, Any]) -> list[str]:
    return [note.message for note in unit_notes(panel_of(entry, {**FREE, **sent}), INTERFACES)]


def test_a_number_in_another_unit_than_its_field_is_noted() -> None:
    assert notes(WAY, POSE) == [
        'input "way" gives mm, and position.x is in m: write send_unit = "m" at the input, or scale '
        "and offset"
    ]
    assert "linear.x is in m/s" in notes({**WAY, "unit": "mm/s"}, TWIST)[0]


@pytest.mark.parametrize(
    "more", [{"send_unit": "m"}, {"scale": 0.001}, {"unit": "m"}, {"unit": "apples"}]
)
def test_a_number_that_fits_its_field_is_not_noted(more: dict[str, Any]) -> None:
    assert notes({**WAY, **more}, POSE) == []


def test_the_preview_says_what_leaves() -> None:
    entry = next(w for w in panel_of({**WAY, "send_unit": "m"}).widgets() if isinstance(w, Numeric))
    assert entry.comment == "0 to 40 mm; sent as 0 to 0.04 m"
