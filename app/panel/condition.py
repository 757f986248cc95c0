"""The descriptions of a condition, which is a field of a topic with the values that meet it, and of an
interlock."""

from collections.abc import Mapping
from functools import cached_property, partial
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Final, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr

from app.panel.base import (
    Description,
    Id,
    Label,
    Type,
    non_empty,
    panel_text,
)
from app.panel.numbers import sent_number
from app.panel.shared_keys import AgeKey, FieldKeys, NumberKeys, RobotKey
from app.ros.messages.validation import format_value
from app.system.texts import PanelText, TextLike

# The description of a condition: a field of a topic, and the values of it that meet the condition.
#
# With `scale` and `offset` the comparisons are of `value * scale + offset`, in the unit that is shown.
# On load they become comparisons of the field's own value, so that they are exact.

VALUE: Final = "{value}"  # in `own_sentence`: the value that does not meet the condition
COMPARISONS: Final = ("equals", "not_equals", "min", "max", "one_of")


def _check_value(value: Any) -> Any:
    if not isinstance(value, bool | int | float | str):
        raise ValueError(f"must be a number, true or false, or text, not {format_value(value)}")
    if value != value:
        raise ValueError("NaN is no value that could permit")
    return value


# A value of the field's type, or the name of a constant of the message around it.
ComparedValue = Annotated[bool | int | float | str, BeforeValidator(_check_value)]


ComparedValues = Annotated[tuple[ComparedValue, ...], Field(strict=False), AfterValidator(non_empty)]


class Condition(NumberKeys, AgeKey, FieldKeys):
    """A field of a topic: a bool that must be true or, with comparisons, a value that must meet all of
    them. A value that was never received, is stale or cut off does not meet it."""

    noun: ClassVar[str] = "a condition"  # in faults

    label: Label | None = None
    action: Label | None = None
    type: Type = "std_msgs/msg/Bool"
    equals: ComparedValue | None = None
    not_equals: ComparedValue | None = None
    min: ComparedValue | None = None
    max: ComparedValue | None = None
    one_of: ComparedValues | None = None
    _constants: Mapping[Any, str] = PrivateAttr(default_factory=dict)
    _written: Mapping[str, Any] = PrivateAttr(default_factory=dict)

    @property
    def name(self) -> TextLike:
        """What sentences call it."""
        return self.subject

    @property
    def subject(self) -> TextLike:
        """What sentences call the value: operators know its label, engineers the topic."""
        return self.label or self.topic

    @property
    def own_sentence(self) -> str | PanelText | None:
        """The panel file's sentence for a value that does not meet the condition, if it has one."""
        return None

    @cached_property
    def comparisons(self) -> Mapping[str, Any]:
        """Key → value of the comparisons; empty if the value must be true."""
        values = {key: getattr(self, key) for key in COMPARISONS}
        return {key: value for key, value in values.items() if value is not None}

    @property
    def written(self) -> Mapping[str, Any]:
        """Key → value of the comparisons as they are shown."""
        return self._written or self.comparisons

    @property
    def constants(self) -> Mapping[Any, str]:
        """Value → name of the constants by which the field's values are shown; set on load."""
        return self._constants

    def with_constants(self, comparisons: Mapping[str, Any], constants: Mapping[Any, str]) -> Self:
        """The condition with values in place of constants' names in its comparisons."""
        resolved = self.model_copy(update=dict(comparisons))
        resolved._constants = constants
        return resolved

    def of_field(self) -> Self:
        """The condition with comparisons of the field's own value in place of those that are shown.
        With a negative scale the least value that is shown is the field's greatest."""
        if not self.is_scaled:
            return self
        unscaled = partial(sent_number, self.scale, self.offset)
        raw: dict[str, Any] = {
            key: tuple(map(unscaled, value)) if key == "one_of" else unscaled(value)
            for key, value in self.comparisons.items()
        }
        if self.scale < 0:
            raw["min"], raw["max"] = raw.get("max"), raw.get("min")
        made = self.model_copy(update=raw)
        made._written = self.comparisons
        return made


class NamedCondition(RobotKey, Condition):
    """A condition that widgets name by its id: it locks nothing. `robot` is the one that publishes it,
    by default that of the widget that names it."""

    id: Id


# The description of an interlock: a condition that permits commands.

if TYPE_CHECKING:
    HelpText = str | PanelText
    Picture = str | PanelText
else:
    HelpText = panel_text(400)
    Picture = panel_text(255)


class Help(Description):
    """What to do while an interlock locks: `text` has a step a line, and `picture` is a file of the
    folder of pictures."""

    text: HelpText | None = None
    picture: Picture | None = None


class Interlock(NamedCondition):
    """A condition that permits the commands which name it, and locks them while it is not met.
    `locked` is its own sentence then."""

    noun: ClassVar[str] = "an interlock"

    require_publisher: bool = False
    publishers: Literal["any", "one"] = "any"
    locked: Label | None = None
    help: Help = Help()

    @property
    def own_sentence(self) -> str | PanelText | None:
        return self.locked

    @property
    def name(self) -> TextLike:
        return self.label or self.id

    @property
    def advice(self) -> TextLike:
        """What to do while it is not met, a step a line; "" if the panel file does not say."""
        return self.help.text or self.action or ""
