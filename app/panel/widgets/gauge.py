"""One number: a gauge with its scale, and a figure with its target."""

from collections.abc import Iterator
from itertools import pairwise
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema, WrapValidator

from app.panel.base import FiniteNumber, Label, Span
from app.panel.checks.types import number_faults, value_faults
from app.panel.numbers import NUMBERS
from app.panel.shared_keys import NumberFormat, NumberKeys, ScaleKeys, number_key_faults, scale_faults
from app.panel.values import number_text
from app.panel.widgets.displays import OrNumber, number_or_table
from app.panel.widgets.families import CheckContext, Display, TopicField, TopicSource
from app.panel.widgets.numbers import Number
from app.ros.messages import Interfaces
from app.ros.messages.validation import format_value
from app.system.errors import Fault
from app.system.texts import TextLike
from app.system.texts import number as text_number
from app.system.texts.text import each_language

# A moving analog indicator: a number on its scale, with its normal range, limits and set-point.

APART: Final = 12.0  # percent of the scale between two figures


class NumberBeside(TopicField):
    """A number that the robot reports. Without `scale` and `offset` it has those of the number that it
    stands beside."""

    scale: FiniteNumber | None = None
    offset: FiniteNumber | None = None

    def faults(self, place: str, who: str, interfaces: Interfaces) -> Iterator[Fault]:
        """Faults of the table at `place`, which is `who` ("a target")."""
        yield from number_faults(place, self.type, self.field, who, interfaces)
        yield from scale_faults(place, self.scale)


class SetpointField(NumberBeside):
    """A set-point that the robot reports."""


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


class Gauge(NumberKeys, Display):
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
        return [(at, text_number(number_text(value))) for at, value in shown.items()]

    def sources(self) -> Iterator[TopicSource]:
        yield from super().sources()
        if isinstance(self.setpoint, SetpointField):
            yield self.setpoint.source("setpoint")

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        if isinstance(self.setpoint, SetpointField):
            yield from self.setpoint.faults(f"{place}.setpoint", "a set-point", checking.interfaces)

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        if field_type not in NUMBERS:
            yield Fault(f"{place}.field", f'"{self.field}" is {field_type}: a gauge is for numbers')
            return
        yield from number_key_faults(place, self, self.field, field_type)
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


# The one number of a group that is read from afar, with its target and how far it is.

VALUE: Final = "{value}"
MAX_LINES: Final = 2


class TargetField(NumberBeside):
    """A target that the robot reports."""


if TYPE_CHECKING:
    Target = float | TargetField
else:
    Target = Annotated[TargetField, WrapValidator(number_or_table), OrNumber()]


class FigureLine(ScaleKeys, TopicField):
    """A further value beside the number: `text` says it, with `{value}` in it."""

    text: Label
    format: NumberFormat | None = None


class Figure(NumberKeys, Display):
    """Shows a number large, and of `target` how far it is: a bar of `segments` parts, 0 for none."""

    kind: Literal["figure"]
    target: Target | None = None
    segments: Annotated[int, Field(ge=0, le=24)] = 1
    lines: Annotated[tuple[FigureLine, ...], Field(strict=False, max_length=MAX_LINES)] = Field(
        (), alias="line"
    )

    @property
    def has_bar(self) -> bool:
        return self.target is not None and self.segments > 0

    @property
    def gaps(self) -> list[float]:
        """Where the segments end, in percent of the bar, but for the last one."""
        return [round(100 * end / self.segments, 2) for end in range(1, self.segments)]

    def sources(self) -> Iterator[TopicSource]:
        yield from super().sources()
        if isinstance(self.target, TargetField):
            yield self.target.source("target")
        for number, line in enumerate(self.lines):
            yield line.source(f"line[{number}]")

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        interfaces = checking.interfaces
        if isinstance(self.target, TargetField):
            yield from self.target.faults(f"{place}.target", "a target", interfaces)
        elif self.target is not None and self.target <= 0:
            yield Fault(f"{place}.target", f"{number_text(self.target)} must be more than 0")
        for number, line in enumerate(self.lines):
            yield from _line_faults(f"{place}.line[{number}]", line, interfaces)

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        if field_type not in NUMBERS:
            yield Fault(f"{place}.field", f'"{self.field}" is {field_type}: a figure is a number')
            return
        yield from number_key_faults(place, self, self.field, field_type)


def _line_faults(place: str, line: FigureLine, interfaces: Interfaces) -> Iterator[Fault]:
    lacking = [text for text in each_language(line.text).values() if text.count(VALUE) != 1]
    if lacking:
        message = f'"{lacking[0]}" must have {VALUE} once, like "{VALUE} min left"'
        yield Fault(f"{place}.text", message)
    faults = list(value_faults(place, line.type, line.field, "a line", interfaces))
    yield from faults
    if not faults:
        kind = interfaces.field_type(line.type, line.field)
        yield from number_key_faults(place, line, line.field, kind)
