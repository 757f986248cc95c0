"""Steps in their order, of which some are done; under a fault they say how to go on."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import BeforeValidator, Field, WithJsonSchema

from app.panel.base import Description, Id, Interlocks, Label, Span
from app.panel.checks.types import value_faults
from app.panel.constants import parent_type, value_mismatch
from app.panel.file.wording import no_such
from app.panel.values import same_value
from app.panel.widgets.displays import (
    PictureName,
    StateValue,
    name_faults,
    picture_faults,
    resolve_state_value,
)
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicField, TopicSource
from app.ros.messages import INTEGER_RANGES, STRING_TYPES, Interfaces, Type
from app.ros.messages.validation import format_value, unknown_constant
from app.system.errors import Fault

MAX_STEPS: Final = 50
ALARM_LINES: Final = 4  # of the action of an alarm that are shown as steps


def _check_mark(value: Any) -> Any:
    is_place = isinstance(value, list | tuple) and len(value) == 2
    if not is_place or not all(_is_percent(part) for part in value):
        expected = "a place like [62, 20]: in percent from the left and from the top of the picture"
        raise ValueError(f"must be {expected}, not {format_value(value)}")
    return tuple(map(float, value))


def _is_percent(part: Any) -> bool:
    return isinstance(part, int | float) and not isinstance(part, bool) and 0 <= part <= 100


Mark = Annotated[
    tuple[float, float],
    BeforeValidator(_check_mark),
    WithJsonSchema(
        {
            "type": "array",
            "items": {"type": "number", "minimum": 0, "maximum": 100},
            "minItems": 2,
            "maxItems": 2,
        }
    ),
]


class CurrentStep(TopicField):
    """The field that says which step is under way."""


class RecoveryStep(Description):
    """A step of the way out of a fault. With a `condition` it is done while that is met, and its `text`
    is that condition's `action` if there is no other. `mark` is a place of the picture, in percent from
    the left and from the top."""

    text: Label | None = None
    note: Label | None = None
    condition: Id | None = None
    picture: PictureName | None = None
    mark: Mark | None = None


class SequenceStep(RecoveryStep):
    """A step of the usual sequence, under way while the `current` field has its `value`."""

    value: StateValue | None = None


class Sequence(DisplayWidget):
    """Shows `steps`, and `recovery` while a condition of `fault` is not met or one of `alarms` stands.

    The `current` field has the value of a step, or its number from 0. Without that field the steps tick
    themselves by their conditions. At most `rows_shown` of them are shown, the one that is under way
    among them.
    """

    shows_alarms: ClassVar[bool] = True

    kind: Literal["sequence"]
    current: CurrentStep | None = None
    steps: Annotated[tuple[SequenceStep, ...], Field(strict=False, max_length=MAX_STEPS)] = ()
    recovery: Annotated[tuple[RecoveryStep, ...], Field(strict=False, max_length=MAX_STEPS)] = ()
    fault: Interlocks = ()
    alarms: Annotated[tuple[Id, ...], Field(strict=False)] = ()
    picture: PictureName | None = None
    rows_shown: Annotated[int, Field(ge=1, le=20)] = 4
    span: Span = 6

    @property
    def all_steps(self) -> Iterator[tuple[str, RecoveryStep]]:
        """(place, step) of every step."""
        yield from ((f"steps[{number}]", step) for number, step in enumerate(self.steps))
        yield from ((f"recovery[{number}]", step) for number, step in enumerate(self.recovery))

    @property
    def rows_at_most(self) -> int:
        """How many steps are shown at once."""
        alarm = ALARM_LINES if self.alarms else 0
        return min(self.rows_shown, max(len(self.steps), len(self.recovery) + alarm, 1))

    @property
    def has_picture(self) -> bool:
        """Whether it has a place for pictures."""
        return self.picture is not None or any(step.picture for _, step in self.all_steps)

    @property
    def values(self) -> tuple[Any, ...]:
        """The value of the `current` field during each step: without one, its number from 0."""
        numbered = enumerate(self.steps)
        return tuple(number if step.value is None else step.value for number, step in numbered)

    @property
    def fault_conditions(self) -> tuple[str, ...]:
        """The ids of the conditions that end the usual sequence: by default those of `recovery`."""
        own = (step.condition for step in self.recovery if step.condition is not None)
        return self.fault or tuple(dict.fromkeys(own))

    @property
    def named_conditions(self) -> tuple[str, ...]:
        own = (step.condition for _, step in self.all_steps if step.condition is not None)
        return tuple(dict.fromkeys((*self.fault_conditions, *own)))

    def sources(self) -> Iterator[TopicSource]:
        if self.current is not None:
            yield self.current.source("current")

    def with_constants(self, interfaces: Interfaces) -> Self:
        if self.current is None:
            return self
        kind = interfaces.field_type(self.current.type, self.current.field)
        constants = interfaces.constants(parent_type(self.current, interfaces))
        values = [resolve_state_value(value, kind, constants) for value in self.values]
        pairs = zip(self.steps, values, strict=True)
        steps = tuple(step.model_copy(update={"value": value}) for step, value in pairs)
        return self.model_copy(update={"steps": steps})

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if not (self.steps or self.recovery or self.alarms):
            yield Fault(place, "has no steps: give it steps, recovery or alarms")
        if self.fault and not self.recovery:
            yield Fault(
                f"{place}.fault", "has no meaning without recovery, the steps that are shown then"
            )
        for i, name in enumerate(self.fault):
            at = f"[{i}]" if len(self.fault) > 1 else ""
            yield from name_faults(f"{place}.fault{at}", name, checking)
        for i, name in enumerate(self.alarms):
            yield from _alarm_faults(f"{place}.alarms[{i}]", name, checking)
        yield from picture_faults(f"{place}.picture", self.picture, checking.pictures)
        for at, step in self.all_steps:
            yield from self._step_faults(f"{place}.{at}", step, checking)
        if self.current is not None:
            yield from self._current_faults(place, self.current, checking.interfaces)
        else:
            for number, step in enumerate(self.steps):
                if step.value is not None:
                    message = "has no meaning without [page.widget.current], the field that has it"
                    yield Fault(f"{place}.steps[{number}].value", message, cause=f"current {place}")

    def _step_faults(self, place: str, step: RecoveryStep, checking: CheckContext) -> Iterator[Fault]:
        if step.condition is not None:
            yield from name_faults(f"{place}.condition", step.condition, checking)
        if step.text is None:
            if step.condition is None:
                yield Fault(f"{place}.text", "is missing: what the operator does in this step")
            elif step.condition in checking.conditions and not checking.conditions[step.condition]:
                message = f'is missing: "{step.condition}" has no action that could stand in its place'
                yield Fault(f"{place}.text", message, cause=f"action {step.condition}")
        yield from picture_faults(f"{place}.picture", step.picture, checking.pictures)
        if step.mark is not None and not (step.picture or self.picture):
            yield Fault(
                f"{place}.mark", "has no meaning without a picture: give the step or the widget one"
            )

    def _current_faults(
        self, place: str, current: CurrentStep, interfaces: Interfaces
    ) -> Iterator[Fault]:
        at = f"{place}.current"
        faults = list(value_faults(at, current.type, current.field, "a step", interfaces))
        yield from faults
        if faults:
            return
        kind = interfaces.type_at(current.type, current.field)
        if kind.name not in INTEGER_RANGES and kind.name not in STRING_TYPES and kind.name != "bool":
            message = f'"{current.field}" is {kind}: a step is a whole number, a text or a bool'
            yield Fault(f"{at}.field", message)
            return
        type_name = parent_type(current, interfaces)
        constants = interfaces.constants(type_name)
        seen: list[Any] = []
        for number, step in enumerate(self.steps):
            where = f"{place}.steps[{number}].value"
            value = resolve_state_value(self.values[number], kind.name, constants)
            if isinstance(value, str) and kind.name in INTEGER_RANGES:
                message = unknown_constant(value, Type(kind.name), type_name, constants)
                yield Fault(where, message, cause=f"value {place}")
            elif step.value is None and kind.name not in INTEGER_RANGES:
                message = f'is missing: "{current.field}" is {kind}, so a step has no number'
                yield Fault(where, message, cause=f"value {place}")
            elif fault := value_mismatch(value, kind.name):
                yield Fault(where, fault, cause=f"value {place}")
            elif any(same_value(value, other) for other in seen):
                yield Fault(where, f"{value!r} is already the value of an earlier step")
            seen.append(value)


def _alarm_faults(place: str, name: str, checking: CheckContext) -> Iterator[Fault]:
    if name not in checking.alarms:
        message = no_such("alarm", name, checking.alarms)
        yield Fault(place, message, cause=f"alarm {name}")
    elif not checking.alarms[name]:
        message = f'"{name}" has no action that could be shown: give that alarm one'
        yield Fault(place, message, cause=f"action {name}")
