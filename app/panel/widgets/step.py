"""Two keys that publish a value one step above or below the one that the robot reports."""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from app.errors import Fault
from app.i18n import ENGLISH, Text
from app.i18n.typed_numbers import read_number
from app.panel.base import Seconds, Span
from app.panel.number_format import FORMAT
from app.panel.number_range import to_float32
from app.panel.template import placeholder_ids
from app.panel.values import number_text
from app.panel.widgets.families import CheckContext, EntryWidget, TopicField, TopicSource
from app.panel.widgets.numbers import Number, NumberInput, SteppedWidget, Unit
from app.panel.widgets.publish import Confirm, PublishPress
from app.panel.widgets.topic_fields import number_field_faults

VALUE: Final = re.compile(r"(?<!\{)\{value\}(?!\})")
NEAR: Final = 1e-6  # relative: a float32 field holds the nearest float32


class ReportedValue(TopicField):
    """The value that the robot reports, to which a step is added."""


class Step(PublishPress, SteppedWidget, EntryWidget):
    """Publishes `message` with `{value}` one step above or below the reported `value`.

    It is an input too: a press has the new value under the widget's id. The next press waits until that
    one is reported.
    """

    kind: Literal["step"]
    message: dict[str, Any]
    value: ReportedValue
    min: Number
    max: Number
    step: Annotated[Number, Field(gt=0)]
    unit: Unit = ""
    format: Annotated[str, Field(pattern=FORMAT)] | None = None
    within_s: Seconds = 2.0
    span: Span = 6

    @property
    def template(self) -> dict[str, Any]:
        template: dict[str, Any] = _renamed(self.message, f"{{{self.id}}}")
        return template

    @property
    def confirm(self) -> Confirm:
        source = self.value
        return Confirm(
            topic=source.topic,
            type=source.type,
            field=source.field,
            equals=f"{{{self.id}}}",
            within_s=self.within_s,
        )

    @property
    def one_shot(self) -> bool:
        return True

    @property
    def is_whole(self) -> bool:
        """Whether whole numbers stay whole."""
        return self.step.is_integer() and self.min.is_integer()

    @property
    def limits_text(self) -> Text:
        """The limits as text."""
        return self._as_number().limits_text

    def sources(self) -> Iterator[TopicSource]:
        yield self.value.source("value")

    def target(self, base: float, steps: int) -> float | None:
        """The value that many steps from a reported one, within the limits; None where it is at the
        limit already, or beyond one."""
        if not self.min <= base <= self.max:
            return None
        wanted = min(max(_rounded(base + steps * self.step, base), self.min), self.max)
        if abs(wanted - base) <= NEAR * max(abs(wanted), abs(base)):
            return None
        return int(wanted) if self.is_whole and float(wanted).is_integer() else wanted

    def parse_text(self, text: str, language: str) -> Any:
        """The value of a key, as the page has it: nobody types it."""
        number = read_number(text, ENGLISH)
        return text if number is None else number

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.max <= self.min:
            low, high = number_text(self.min), number_text(self.max)
            yield Fault(f"{place}.max", f"{high} must be more than min ({low})")
            return
        if self.confirm_press:
            reason = "is not for a step: each press is one step, from the value that is shown"
            yield Fault(f"{place}.confirm_press", reason)
        own = {**checking.inputs, self.id: self._as_number()}
        faults = list(super().faults(place, replace(checking, inputs=own)))
        yield from faults
        message = f"{place}.message"
        if self.template == self.message and not any(
            fault.place.startswith(message) for fault in faults
        ):
            named = ", ".join(f"{{{name}}}" for name in placeholder_ids([self.message]))
            instead = f'; write "{{value}}" in place of {named}' if named else ""
            yield Fault(message, f'has no "{{value}}": every press would publish the same{instead}')
        yield from number_field_faults(f"{place}.value", self.value, "a value", checking.interfaces)

    def _as_number(self) -> NumberInput:
        """An input with the same limits, for texts and to try the message with."""
        return NumberInput.model_construct(
            id=self.id,
            label=self.label,
            kind="number",
            min=self.min,
            max=self.max,
            step=self.step if self.is_whole else None,
            unit=self.unit,
        )


def _renamed(template: Any, placeholder: str) -> Any:
    """The template with the widget's own placeholder in place of `{value}`."""
    if isinstance(template, dict):
        return {key: _renamed(value, placeholder) for key, value in template.items()}
    if isinstance(template, list):
        return [_renamed(value, placeholder) for value in template]
    return VALUE.sub(placeholder, template) if isinstance(template, str) else template


def _rounded(value: float, base: float) -> float:
    """Without the noise of a binary fraction; a float32's is larger."""
    if value.is_integer():
        return value
    return float(f"{value:.7g}" if to_float32(base) == base else f"{value:.12g}")
