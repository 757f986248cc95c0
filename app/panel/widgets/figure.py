"""The one number of a group that is read from afar, with its target and how far it is."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Annotated, Final, Literal

from pydantic import Field, WrapValidator

from app.errors import Fault
from app.i18n.values import each_language
from app.interfaces import Interfaces
from app.panel.base import Label
from app.panel.checks.types import field_faults
from app.panel.constants import NUMBERS
from app.panel.number_format import FORMAT, Factor
from app.panel.values import number_text
from app.panel.widgets.displays import format_fault
from app.panel.widgets.families import CheckContext, Display, TopicField, TopicSource
from app.panel.widgets.numbers import Unit
from app.panel.widgets.topic_fields import OrNumber, number_field_faults, number_or_table

VALUE: Final = "{value}"
MAX_LINES: Final = 2


class TargetField(TopicField):
    """A target that the robot reports, in the unit of the message."""


if TYPE_CHECKING:
    Target = float | TargetField
else:
    Target = Annotated[TargetField, WrapValidator(number_or_table), OrNumber()]


class FigureLine(TopicField):
    """A further value beside the number: `text` says it, with `{value}` in it."""

    text: Label
    format: Annotated[str, Field(pattern=FORMAT)] | None = None
    scale: Factor = 1.0
    offset: Factor = 0.0


class Figure(Display):
    """Shows a number large, and of `target` how far it is: a bar of `segments` parts, 0 for none."""

    kind: Literal["figure"]
    target: Target | None = None
    segments: Annotated[int, Field(ge=0, le=24)] = 1
    format: Annotated[str, Field(pattern=FORMAT)] | None = None
    unit: Unit = ""
    scale: Factor = 1.0
    offset: Factor = 0.0
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
            yield from number_field_faults(f"{place}.target", self.target, "a target", interfaces)
        elif self.target is not None and self.target <= 0:
            yield Fault(f"{place}.target", f"{number_text(self.target)} must be more than 0")
        for number, line in enumerate(self.lines):
            yield from _line_faults(f"{place}.line[{number}]", line, interfaces)

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        if field_type not in NUMBERS:
            yield Fault(f"{place}.field", f'"{self.field}" is {field_type}: a figure is a number')
            return
        yield from format_fault(place, self, field_type)


def _line_faults(place: str, line: FigureLine, interfaces: Interfaces) -> Iterator[Fault]:
    lacking = [text for text in each_language(line.text).values() if text.count(VALUE) != 1]
    if lacking:
        message = f'"{lacking[0]}" must have {VALUE} once, like "{VALUE} min left"'
        yield Fault(f"{place}.text", message)
    faults = list(field_faults(place, line.type, line.field, interfaces))
    yield from faults
    if faults:
        return
    kind = interfaces.type_at(line.type, line.field)
    if kind.is_nested or kind.container != "one":
        yield Fault(f"{place}.field", f'"{line.field}" is {kind}: a line shows one value of it')
    elif line.format and str(kind) not in NUMBERS:
        yield Fault(f"{place}.format", f'is for numbers; "{line.field}" is {kind}')
    else:
        yield from format_fault(place, line, str(kind))
