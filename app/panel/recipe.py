"""The table `[[recipe]]` of a panel file: inputs whose values are kept together under a name."""

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from app.panel.base import (
    AnyText,
    Description,
    FieldPath,
    Id,
    Interlocks,
    Label,
    MessageField,
    MessageOrServiceType,
    NodeName,
    ParameterName,
    Seconds,
    TopicName,
    TopicQos,
    non_empty,
)
from app.panel.shared_keys import AgeKey, OptionalTopicKeys
from app.panel.widgets.key_parts import ConfirmPress

MAX_FIELDS: Final = 60

ParameterKind = Literal["bool", "integer", "double", "string"]
Names = Annotated[dict[Id, ParameterName], Field(max_length=MAX_FIELDS)]
Paths = Annotated[dict[Id, FieldPath], Field(max_length=MAX_FIELDS)]
Kinds = Annotated[dict[Id, ParameterKind], Field(max_length=MAX_FIELDS)]


class RecipeReadback(AgeKey, OptionalTopicKeys):
    """By what the robot reports the values that it has: a topic, or parameters of a node."""

    node: NodeName | None = None
    fields: Paths = Field(default_factory=dict)
    parameters: Names = Field(default_factory=dict)
    parameter_types: Kinds = Field(default_factory=dict)


class RecipeSet(Description):
    """A set of recipes: all have values of the same inputs. A recipe is loaded by a message to `topic`,
    a call of `service`, or parameters of `node`."""

    id: Id
    label: Label
    fields: Annotated[
        tuple[Id, ...], Field(strict=False, max_length=MAX_FIELDS), AfterValidator(non_empty)
    ]
    interlocks: Interlocks = Field(default=(), alias="interlock")
    confirm_press: ConfirmPress = False
    confirm_edit: Literal["pin", "two_persons"] | None = None
    topic: TopicName | None = None
    service: TopicName | None = None
    node: NodeName | None = None
    type: MessageOrServiceType = ""
    qos: TopicQos = TopicQos()
    message: dict[str, Any] | None = None
    request: dict[str, Any] | None = None
    success: MessageField | None = None
    answer: AnyText = ""
    parameters: Names = Field(default_factory=dict)
    parameter_types: Kinds = Field(default_factory=dict)
    timeout_s: Seconds = 5.0
    confirm_s: Seconds = 3.0
    readback: RecipeReadback | None = None

    @property
    def readback_topics(self) -> tuple[str, ...]:
        """The topics by which the robot reports what is loaded."""
        topic = self.readback.topic if self.readback else None
        return () if topic is None else (topic,)
