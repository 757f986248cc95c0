"""Commands that publish a message once, or a value one step higher or lower."""

import re
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from app.panel.base import Seconds, Span, TopicName, Type
from app.panel.checks.templates import NOW_RULE, example_values, unknown_input_faults
from app.panel.checks.types import number_faults, value_faults
from app.panel.constants import mismatch_at
from app.panel.numbers import to_float32
from app.panel.shared_keys import FieldKey, NumberFormat, Unit, number_key_faults
from app.panel.template import NOW, fill, input_of, placeholder_ids, placeholders
from app.panel.values import number_text
from app.panel.widgets.displays import LampCommand
from app.panel.widgets.families import (
    CheckContext,
    EntryWidget,
    PublishCommand,
    TopicField,
    TopicSource,
)
from app.panel.widgets.numbers import Number, NumberInput, SteppedWidget
from app.panel.widgets.templated import TemplateCommand
from app.ros.messages import Interfaces
from app.system.errors import Fault, FieldError
from app.system.texts import ENGLISH, Text
from app.system.texts.locales import read_number

# Commands that publish a message once, and the confirmation of their effect.


class Confirm(FieldKey):
    """A field that confirms the effect of a command: it must have the value `equals` (or that of an
    input, `"{id}"`) within `within_s`. The default type is that of the topic elsewhere in the panel."""

    topic: TopicName
    type: Type | None = None
    equals: Any
    within_s: Seconds = 2.0


class PublishPress(TemplateCommand, PublishCommand):
    """A press that publishes one message. With `one_shot` it is locked until its effect is confirmed,
    or the time for that is over."""

    template_key: ClassVar[str] = "message"

    if TYPE_CHECKING:

        @property
        def confirm(self) -> Confirm | None: ...
        @property
        def one_shot(self) -> bool: ...

    @property
    def one_at_a_time(self) -> bool:
        return self.one_shot

    @property
    def shows_more(self) -> bool:
        """Whether more of it is shown than its lock."""
        return self.confirm is not None or self.one_at_a_time or any(self.sources())

    @property
    def action_text(self) -> str:
        return f"publishes {self.topic} ({self.type})"

    def template_type(self, interfaces: Interfaces) -> str:
        interfaces.require(self.type)
        return self.type

    def templates(self) -> list[Any]:
        return [self.template, *([self.confirm.equals] if self.confirm else [])]


class SinglePublish(PublishPress):
    """A press that publishes a message of the panel file."""

    message: dict[str, Any]
    confirm: Confirm | None = None
    one_shot: bool = False
    span: Span = 4

    @property
    def template(self) -> dict[str, Any]:
        return self.message

    def response_faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.confirm is not None:
            yield from confirm_faults(f"{place}.confirm", self.confirm, checking, self.topic)
        elif self.one_shot:
            message = "needs `confirm`: without it the panel does not know when the command is done"
            yield Fault(f"{place}.one_shot", message)


class Publish(SinglePublish, LampCommand):
    kind: Literal["publish"]


def confirm_faults(
    place: str, confirm: Confirm, checking: CheckContext, own_topic: str = ""
) -> Iterator[Fault]:
    """Faults of the table at `place` that says what confirms a command on `own_topic`."""
    known = confirm.type or checking.types.get(confirm.topic)
    if known is None:
        message = f"is missing: nothing else in the panel says what {confirm.topic} is"
        if confirm.topic == own_topic:
            message = f"is missing; on {own_topic} this button publishes: name where the robot answers"
        yield Fault(f"{place}.type", message, cause=f"listens {confirm.topic}")
        return
    faults = list(value_faults(place, known, confirm.field, "a confirmation", checking.interfaces))
    yield from faults or _equals_faults(place, confirm, known, checking)


def _equals_faults(
    place: str, confirm: Confirm, type_name: str, checking: CheckContext
) -> Iterator[Fault]:
    try:
        names = list(placeholders(confirm.equals, "equals"))
    except FieldError as error:
        yield Fault(f"{place}.{error.field}", error.message)
        return
    faults = list(unknown_input_faults(place, names, checking))
    faults += [Fault(f"{place}.{where}", NOW_RULE) for where, name in names if name == NOW]
    yield from faults
    used = {input_of(name) for _, name in names}
    if faults or used & {*checking.faulty}:
        return
    for values in example_values({name: checking.inputs[name] for name in used}):
        value = fill(confirm.equals, values)
        if fault := mismatch_at(value, type_name, confirm.field, checking.interfaces):
            yield Fault(f"{place}.equals", fault)
            return


# Two keys that publish a value one step above or below the one that the robot reports.

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
    format: NumberFormat | None = None
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
        """The value of a key, as the page has it: no one types it."""
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
        yield from self._value_faults(place, checking.interfaces)

    def _value_faults(self, place: str, interfaces: Interfaces) -> Iterator[Fault]:
        """Faults of the reported field, and of the format of its numbers."""
        at, source = f"{place}.value", self.value
        faults = list(number_faults(at, source.type, source.field, "a value", interfaces))
        yield from faults
        if not faults:
            kind = interfaces.field_type(source.type, source.field)
            yield from number_key_faults(place, self, source.field, kind)

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
