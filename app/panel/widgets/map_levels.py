"""The levels of a building on one map: each has a map of its own, and the robot is on one of them."""

from collections.abc import Iterator, Sequence
from typing import Annotated, Final

from pydantic import Field

from app.panel.base import Description, Id, Label, TopicName, TopicQos
from app.panel.checks.types import value_faults
from app.panel.constants import parent_type, value_mismatch
from app.panel.values import same_value
from app.panel.widgets.displays import StateValue, resolve_state_value
from app.panel.widgets.families import TopicField, TopicSource
from app.panel.widgets.map_layers import GRID_TYPE, updates_of
from app.ros.messages import Interfaces
from app.system.errors import Fault
from app.system.texts.text import alike

MAX_LEVELS: Final = 12


class MapLevel(Description):
    """A level of a building, with the topic of its map. `value` is what `robot_level` has while the
    robot is there, by default the id."""

    id: Id
    label: Label
    topic: TopicName
    value: StateValue | None = None
    qos: TopicQos = TopicQos()

    @property
    def type(self) -> str:
        return GRID_TYPE

    @property
    def compared(self) -> bool | int | str:
        """The value of `robot_level` while the robot is there."""
        return self.id if self.value is None else self.value

    def sources(self, place: str) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, (), place)
        yield updates_of(self.topic, place)


class RobotLevel(TopicField):
    """The field that says on which level the robot is."""


MapLevels = Annotated[tuple[MapLevel, ...], Field(strict=False, max_length=MAX_LEVELS)]


def level_faults(
    place: str, levels: Sequence[MapLevel], source: RobotLevel | None, interfaces: Interfaces
) -> Iterator[Fault]:
    """Faults of the levels of the map at `place`."""
    for n, level in enumerate(levels):
        for m, earlier in enumerate(levels[:n]):
            if level.id == earlier.id:
                yield Fault(f"{place}.level[{n}].id", f'"{level.id}" is already the id of level[{m}]')
            if alike(level.label, earlier.label):
                message = f'"{level.label}" is already the label of level[{m}]'
                yield Fault(f"{place}.level[{n}].label", message)
            if level.topic == earlier.topic:
                message = f"{level.topic} is already the map of level[{m}]: each level has its own"
                yield Fault(f"{place}.level[{n}].topic", message)
    if source is None:
        for n, level in enumerate(levels):
            if level.value is not None:
                message = "is compared with robot_level: name its topic, or leave the value out"
                yield Fault(f"{place}.level[{n}].value", message, cause=f"robot_level {place}")
        return
    if not levels:
        yield Fault(f"{place}.robot_level", "is for a map with levels: write [[….level]] tables")
        return
    faults = list(
        value_faults(f"{place}.robot_level", source.type, source.field, "a level", interfaces)
    )
    yield from faults
    if not faults:
        yield from _value_faults(place, levels, source, interfaces)


def _value_faults(
    place: str, levels: Sequence[MapLevel], source: RobotLevel, interfaces: Interfaces
) -> Iterator[Fault]:
    kind = interfaces.field_type(source.type, source.field)
    values = [level.compared for level in with_values(levels, source, interfaces)]
    for n, value in enumerate(values):
        where = f"{place}.level[{n}].value"
        if fault := value_mismatch(value, kind):
            yield Fault(where, fault, cause=f"value {place}")
        elif any(same_value(value, earlier) for earlier in values[:n]):
            yield Fault(where, f"{value!r} is already the value of an earlier level")


def with_values(
    levels: Sequence[MapLevel], source: RobotLevel, interfaces: Interfaces
) -> tuple[MapLevel, ...]:
    """The levels with values in place of constants' names."""
    kind = interfaces.field_type(source.type, source.field)
    constants = interfaces.constants(parent_type(source, interfaces))
    return tuple(
        level.model_copy(update={"value": resolve_state_value(level.compared, kind, constants)})
        for level in levels
    )
