"""The description of an interlock: a field of a topic that permits commands."""

from collections.abc import Mapping
from functools import cached_property
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr

from app.i18n import TextLike
from app.interfaces.validation import format_value
from app.panel.base import Description, FieldPath, Id, Label, Seconds, Topic, TopicQos, Type
from app.panel.widgets.numbers import Unit

CONDITIONS: Final = ("equals", "not_equals", "min", "max", "one_of")


def _check_condition(given: Any) -> Any:
    if not isinstance(given, bool | int | float | str):
        raise ValueError(f"must be a number, true or false, or text, not {format_value(given)}")
    if given != given:
        raise ValueError("NaN is no value that could permit")
    return given


def _non_empty(given: tuple[Any, ...]) -> tuple[Any, ...]:
    if not given:
        raise ValueError("is empty: it must have one value at least")
    return given


# A value of the field's type, or the name of a constant of the message around it.
Condition = Annotated[bool | int | float | str, BeforeValidator(_check_condition)]


class Interlock(Description):
    """A field of a topic that permits commands: a bool that is true or, with conditions, a value that
    meets all of them. A value that was never received, is stale or cut off locks."""

    id: Id
    label: Label | None = None
    topic: Topic
    type: Type = "std_msgs/msg/Bool"
    field: FieldPath = "data"
    equals: Condition | None = None
    not_equals: Condition | None = None
    min: Condition | None = None
    max: Condition | None = None
    one_of: Annotated[tuple[Condition, ...], Field(strict=False), AfterValidator(_non_empty)] | None = (
        None
    )
    unit: Unit = ""
    max_age_s: Seconds | None = None
    require_publisher: bool = False
    publishers: Literal["any", "one"] = "any"
    qos: TopicQos = TopicQos()
    _constants: Mapping[Any, str] = PrivateAttr(default_factory=dict)

    @property
    def name(self) -> TextLike:
        return self.label or self.id

    @cached_property
    def conditions(self) -> Mapping[str, Any]:
        """Key → value of the given conditions."""
        given = {key: getattr(self, key) for key in CONDITIONS}
        return {key: value for key, value in given.items() if value is not None}

    @property
    def constants(self) -> Mapping[Any, str]:
        """Value → name of the constants by which the field's values are shown; set on load."""
        return self._constants

    def with_constants(
        self, conditions: Mapping[str, Any], constants: Mapping[Any, str]
    ) -> "Interlock":
        """The interlock with values in place of constants' names in its conditions."""
        made = self.model_copy(update=dict(conditions))
        made._constants = constants
        return made
