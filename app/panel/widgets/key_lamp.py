"""A lamp on a button: what the robot itself reports, whatever was pressed."""

from collections.abc import Iterator
from typing import Annotated, Self

from pydantic import AfterValidator, Field

from app.errors import Fault
from app.interfaces import Interfaces
from app.panel.base import non_empty
from app.panel.checks.types import field_faults
from app.panel.constants import parent_type
from app.panel.widgets.displays import LampState, resolve_state_value, state_faults
from app.panel.widgets.families import CheckContext, TopicField, TopicSource
from app.panel.widgets.templated import TemplateCommand


class KeyLamp(TopicField):
    """A state for each value of the field that the robot reports."""

    states: Annotated[tuple[LampState, ...], Field(strict=False), AfterValidator(non_empty)]

    def faults(self, place: str, interfaces: Interfaces) -> Iterator[Fault]:
        """Faults of the table at `place`."""
        faults = list(field_faults(place, self.type, self.field, interfaces))
        yield from faults
        if not faults:
            kind = interfaces.field_type(self.type, self.field)
            yield from state_faults(place, self, kind, interfaces, "a lamp")

    def with_constants(self, interfaces: Interfaces) -> Self:
        """The lamp with values in place of constants' names."""
        kind = interfaces.field_type(self.type, self.field)
        constants = interfaces.constants(parent_type(self, interfaces))
        states = tuple(
            state.model_copy(update={"value": resolve_state_value(state.value, kind, constants)})
            for state in self.states
        )
        return self.model_copy(update={"states": states})


class LampCommand(TemplateCommand):
    """A press whose button may have a lamp."""

    lamp: KeyLamp | None = None

    def sources(self) -> Iterator[TopicSource]:
        yield from super().sources()
        if self.lamp is not None:
            yield self.lamp.source("lamp")

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        if self.lamp is not None:
            yield from self.lamp.faults(f"{place}.lamp", checking.interfaces)

    def with_constants(self, interfaces: Interfaces) -> Self:
        if self.lamp is None:
            return self
        return self.model_copy(update={"lamp": self.lamp.with_constants(interfaces)})
