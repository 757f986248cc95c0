"""Commands that act for as long as a button is held."""

from typing import Annotated, Any, Literal

from pydantic import Field

from app.panel.base import Interlocks, Placed, Span, Topic, TopicQos, Type, WrittenField


class Hold(Placed):
    """Published `rate_hz` times a second while its button is held, and `release` once after.

    `deadline_field` gets the milliseconds within which the next message must come, 0 in the last
    one; `counter_field` counts the messages.
    """

    kind: Literal["hold"]
    topic: Topic
    type: Type
    message: dict[str, Any]
    release: dict[str, Any]
    interlocks: Interlocks = Field(alias="interlock")
    rate_hz: Annotated[float, Field(ge=1, le=100)] = 20.0
    deadline_field: WrittenField | None = None
    counter_field: WrittenField | None = None
    qos: TopicQos = TopicQos()
    span: Span = 4

    @property
    def period_s(self) -> float:
        return 1 / self.rate_hz

    @property
    def deadline_ms(self) -> int:
        """Three periods, 100 ms at least: two messages may be late or lost before the robot stops."""
        return max(100, round(3000 / self.rate_hz))
