"""Commands that publish a message once, and the confirmation of their effect."""

import re
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, ClassVar, Literal

from app.errors import Fault, FieldError
from app.interfaces import Interfaces
from app.panel.base import Description, Seconds, Span, TopicName, Type
from app.panel.checks.templates import NOW_RULE, example_values, unknown_input_faults
from app.panel.checks.types import field_faults
from app.panel.constants import mismatch_at
from app.panel.field_paths import FieldPath
from app.panel.template import NOW, fill, placeholders
from app.panel.widgets.families import CheckContext, PublishCommand
from app.panel.widgets.key_lamp import LampCommand
from app.panel.widgets.templated import TemplateCommand


class Confirm(Description):
    """A field that confirms the effect of a command: it must have the value `equals` (or that of an
    input, `"{id}"`) within `within_s`. The default type is that of the topic elsewhere in the panel."""

    topic: TopicName
    type: Type | None = None
    field: FieldPath = "data"
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
    faults = list(field_faults(place, known, confirm.field, checking.interfaces))
    yield from faults
    if not faults:
        kind = checking.interfaces.field_type(known, confirm.field)
        yield from _equals_faults(place, confirm, known, kind, checking)


def _equals_faults(
    place: str, confirm: Confirm, type_name: str, kind: str, checking: CheckContext
) -> Iterator[Fault]:
    if re.search(r"[/\]]", kind):
        message = f'"{confirm.field}" is {kind}: one value of it can confirm, not all'
        yield Fault(f"{place}.field", message)
        return
    try:
        names = list(placeholders(confirm.equals, "equals"))
    except FieldError as error:
        yield Fault(f"{place}.{error.field}", error.message)
        return
    faults = list(unknown_input_faults(place, names, checking.inputs, checking.all_inputs))
    faults += [Fault(f"{place}.{where}", NOW_RULE) for where, name in names if name == NOW]
    yield from faults
    if faults or {name for _, name in names} & set(checking.faulty):
        return
    for values in example_values({name: checking.inputs[name] for _, name in names}):
        value = fill(confirm.equals, values)
        if fault := mismatch_at(value, type_name, confirm.field, checking.interfaces):
            yield Fault(f"{place}.equals", fault)
            return
