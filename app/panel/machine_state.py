"""The table `[state]` of a panel file: what the machine is doing, in one word, as the robot says it."""

from collections.abc import Iterator, Mapping
from functools import cached_property
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, Field

from app.errors import Fault
from app.i18n import say
from app.interfaces import Interfaces
from app.panel.base import Label, non_empty
from app.panel.checks.types import field_faults
from app.panel.constants import parent_type
from app.panel.widgets.displays import LampState, resolve_state_value, state_faults
from app.panel.widgets.families import CheckContext, Display, TopicField, TopicSource

STATE_ID: Final = "machine_state"
MAX_DETAILS: Final = 2


class StateDetail(TopicField):
    """What stands beside the state, such as the mode or the order: a field, after its `label`. `words`
    are what is shown for its values."""

    label: Label | None = None
    words: Mapping[str, Label] = Field(default_factory=dict)


class StateRules(TopicField):
    """The states that the robot reports, with the word and the shape of each; a state that it does not
    report now is shown as not known."""

    states: Annotated[tuple[LampState, ...], Field(strict=False), AfterValidator(non_empty)]
    details: Annotated[tuple[StateDetail, ...], Field(strict=False, max_length=MAX_DETAILS)] = Field(
        (), alias="detail"
    )

    @cached_property
    def display(self) -> "MachineState":
        """The display in the frame of every page."""
        keys: dict[str, Any] = {name: getattr(self, name) for name in type(self).model_fields}
        fixed: dict[str, Any] = {"id": STATE_ID, "kind": "state", "label": say("machine_state")}
        return MachineState.model_construct(None, **fixed, **keys)

    def with_constants(self, interfaces: Interfaces) -> Self:
        """The same with values in place of constants' names."""
        states = [
            state.model_copy(update={"value": self.value_of(state.value, interfaces)})
            for state in self.states
        ]
        return self.model_copy(update={"states": tuple(states)})

    def value_of(self, value: bool | int | str, interfaces: Interfaces) -> Any:
        """The value of a state in the message: that of a constant by its name."""
        kind = interfaces.field_type(self.type, self.field)
        return resolve_state_value(value, kind, interfaces.constants(parent_type(self, interfaces)))


class MachineState(Display):
    """The state as a display: it is not in a page, but in the frame."""

    kind: Literal["state"]
    states: tuple[LampState, ...]
    details: tuple[StateDetail, ...] = ()

    def sources(self) -> Iterator[TopicSource]:
        yield from super().sources()
        for number, detail in enumerate(self.details):
            yield detail.source(f"detail[{number}]")

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        for number, detail in enumerate(self.details):
            at = f"{place}.detail[{number}]"
            yield from field_faults(at, detail.type, detail.field, checking.interfaces)

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        yield from state_faults(place, self, field_type, interfaces, "the machine's state")
