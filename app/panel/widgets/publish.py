"""Commands that publish a message once, and what shows that one took effect."""

from typing import Any, Literal

from pydantic import Field

from app.panel.base import (
    Description,
    FieldPath,
    Interlocks,
    Placed,
    Seconds,
    Span,
    Topic,
    TopicQos,
    Type,
)


class Confirm(Description):
    """A field of the robot's that shows that a command took effect: it comes to have the value
    `equals` (or that of an input, `"{id}"`) in time. The type is that which the panel gives for
    the topic elsewhere, if there is none here."""

    topic: Topic
    type: Type | None = None
    field: FieldPath = "data"
    equals: Any
    within_s: Seconds = 2.0


class Publish(Placed):
    """A command; with `one_shot` it is locked until its effect is confirmed, or did not show."""

    kind: Literal["publish"]
    topic: Topic
    type: Type
    message: dict[str, Any]
    interlocks: Interlocks = Field(default=(), alias="interlock")
    qos: TopicQos = TopicQos()
    confirm: Confirm | None = None
    one_shot: bool = False
    confirm_press: bool = False
    span: Span = 4

    @property
    def template(self) -> dict[str, Any]:
        return self.message
