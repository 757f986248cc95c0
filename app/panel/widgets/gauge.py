"""A moving analog indicator: a number on its scale, with its normal range, limits and set-point."""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema, WrapValidator

from app.errors import Fault
from app.i18n import TextLike, number
from app.interfaces import Interfaces
from app.interfaces.validation import format_value
from app.panel.base import Span
from app.panel.constants import NUMBERS
from app.panel.number_format import FORMAT, Factor
from app.panel.values import number_text
from app.panel.widgets.displays import format_fault
from app.panel.widgets.families import CheckContext, Display, TopicField, TopicSource
from app.panel.widgets.numbers import Number, Unit
from app.panel.widgets.topic_fields import OrNumber, number_field_faults, number_or_table

APART: Final = 12.0  # percent of the scale between two figures


class SetpointField(TopicField):
    """A set-point that the robot reports, in the unit of the message."""


if TYPE_CHECKING:
    Setpoint = float | SetpointField
else:
    Setpoint = Annotated[SetpointField, WrapValidator(number_or_table), OrNumber()]


def _check_normal(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise ValueError(f"must be two numbers, like [4.5, 6.5], not {format_value(value)}")
    return tuple(value)


TWO: Final = {"type": "array", "items": {"type": "number"}, "minItems": 2, "maxItems": 2}
Band = Annotated[tuple[Number, Number], BeforeValidator(_check_normal), WithJsonSchema(TWO)]


class Gauge(Display):
    """Shows a number between `min` and `max`. The limits are those of ISA-18.2: a value beyond `low` or
    `high` is abnormal, one beyond `low_low` or `high_high` is critical. All are in the shown unit."""

    kind: Literal["gauge"]
    min: Number
    max: Number
    normal: Band | None = None
    low_low: Number | None = None
    low: Number | None = None
    high: Number | None = None
    high_high: Number | None = None
    setpoint: Setpoint | None = None
    format: Annotated[str, Field(pattern=FORMAT)] | None = None
    unit: Unit = ""
    scale: Factor = 1.0
    offset: Factor = 0.0
    orientation: Literal["vertical", "horizontal"] = "vertical"
    span: Span = 4

    @property
    def band(self) -> tuple[float, float] | None:
        """The ends of the normal range, in percent of the scale."""
        return self.normal and (self.percent(self.normal[0]), self.percent(self.normal[1]))

    def percent(self, value: float) -> float:
        """Where a number is on the scale; one beyond it is at its end."""
        part = (value - self.min) / (self.max - self.min)
        return round(100 * min(max(part, 0.0), 1.0), 1)

    @property
    def limits(self) -> dict[str, float]:
        """The limits that there are, from the lowest to the highest."""
        names = ("low_low", "low", "high", "high_high")
        return {name: at for name in names if (at := getattr(self, name)) is not None}

    @property
    def figures(self) -> list[tuple[float, TextLike]]:
        """(place in percent of the scale, number) of its ends and limits; of two near each other the
        first counts."""
        shown: dict[float, float] = {}
        for value in (self.min, self.max, *self.limits.values()):
            if all(abs(self.percent(value) - at) >= APART for at in shown):
                shown[self.percent(value)] = value
        return [(at, number(number_text(value))) for at, value in shown.items()]

    def sources(self) -> Iterator[TopicSource]:
        yield from super().sources()
        if isinstance(self.setpoint, SetpointField):
            yield self.setpoint.source("setpoint")

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        if isinstance(self.setpoint, SetpointField):
            at = f"{place}.setpoint"
            yield from number_field_faults(at, self.setpoint, "a set-point", checking.interfaces)

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        if field_type not in NUMBERS:
            yield Fault(f"{place}.field", f'"{self.field}" is {field_type}: a gauge is for numbers')
            return
        yield from format_fault(place, self, field_type)
        yield from _order_faults(place, self)


def _order_faults(place: str, gauge: Gauge) -> Iterator[Fault]:
    """The first fault in the order of the scale's ends, limits and normal range."""
    if gauge.max <= gauge.min:
        low, high = number_text(gauge.min), number_text(gauge.max)
        yield Fault(f"{place}.max", f"{high} must be more than min ({low})")
        return
    for key, value in gauge.limits.items():
        if not gauge.min <= value <= gauge.max:
            yield Fault(f"{place}.{key}", f"{number_text(value)} is {_off_scale(gauge)}")
            return
    inside = list(gauge.limits.items())
    if gauge.normal is not None:
        below = [limit for limit in inside if limit[0].startswith("low")]
        inside = [*below, *(("normal", end) for end in gauge.normal), *inside[len(below) :]]
        if not gauge.min <= gauge.normal[0] < gauge.normal[1] <= gauge.max:
            ends = " to ".join(map(number_text, gauge.normal))
            yield Fault(f"{place}.normal", f"{ends} is no range that is {_on_scale(gauge)}")
            return
    for (key, value), (above, next_value) in pairwise(inside):
        if value > next_value or (value == next_value and "normal" not in (key, above)):
            message = f"{number_text(next_value)} must be more than {key} ({number_text(value)})"
            yield Fault(f"{place}.{above}", message)
            return
    if isinstance(gauge.setpoint, float) and not gauge.min <= gauge.setpoint <= gauge.max:
        yield Fault(f"{place}.setpoint", f"{number_text(gauge.setpoint)} is {_off_scale(gauge)}")


def _on_scale(gauge: Gauge) -> str:
    return f"on the scale from {number_text(gauge.min)} to {number_text(gauge.max)}"


def _off_scale(gauge: Gauge) -> str:
    return f"not {_on_scale(gauge)}"
