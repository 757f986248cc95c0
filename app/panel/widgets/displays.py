"""Descriptions of what is shown: values and lamps."""

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, BeforeValidator, Field

from app.interfaces.validation import shown
from app.panel.base import (
    Description,
    FieldPath,
    Label,
    Placed,
    Seconds,
    Span,
    Topic,
    TopicQos,
    Type,
    some,
)
from app.panel.widgets.inputs import Unit

# [+] [,] [.digits] [f, e, g, % or d]: a part of Python's, in which nothing can go wrong.
FORMAT: Final = r"^\+?,?(\.[0-9]{1,2}[feg%]|[feg%d])$"

Factor = Annotated[float, Field(allow_inf_nan=False)]


class Readout(Placed):
    """A field's value, as `value * scale + offset` in a format, or by the name of a constant."""

    kind: Literal["readout"]
    topic: Topic
    type: Type
    field: FieldPath = "data"
    format: Annotated[str, Field(pattern=FORMAT)] | None = None
    unit: Unit = ""
    scale: Factor = 1.0
    offset: Factor = 0.0
    constants: Annotated[str, Field(pattern=r"^[A-Z][A-Z0-9_]*$")] | None = None
    max_age_s: Seconds | None = None
    qos: TopicQos = TopicQos()


def _value(given: Any) -> Any:
    if not isinstance(given, bool | int | str):
        raise ValueError(f"must be a whole number, true or false, or text, not {shown(given)}")
    return given


class LampState(Description):
    """How a lamp shows one value, which may be a constant's name. What is normal is grey, white or
    black; colour is for the rest."""

    value: Annotated[bool | int | str, BeforeValidator(_value)]
    text: Label
    shape: Literal["circle", "square", "triangle", "diamond", "cross", "bar"]
    colour: Literal["grey", "white", "black", "blue", "yellow", "red"] = "grey"


class Indicator(Placed):
    """A lamp: one state for each value; a value without one shows as unknown."""

    kind: Literal["indicator"]
    topic: Topic
    type: Type
    field: FieldPath = "data"
    states: Annotated[tuple[LampState, ...], Field(strict=False), AfterValidator(some)]
    max_age_s: Seconds | None = None
    qos: TopicQos = TopicQos()
    span: Span = 4
