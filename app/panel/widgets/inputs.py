"""Descriptions of inputs: what an operator enters, and what a message takes by an input's id."""

import json
from collections.abc import Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field, model_validator

from app.i18n import say
from app.panel.base import Description, Label, Placed, Span, said, some

MOST: Final = 2.0**53  # beyond this a browser's numbers are not exact

Number = Annotated[float, Field(ge=-MOST, le=MOST)]
Unit = Annotated[str, Field(max_length=20)]


class TextInput(Placed):
    kind: Literal["text"]
    max_length: Annotated[int, Field(ge=1, le=1000)] = 80
    default: Annotated[str, Field(pattern=r"^[^\x00]*$")] = ""

    @property
    def gives(self) -> str:
        return "text"


class Stepped(Placed):
    """What has − and + beside it."""

    @property
    def less(self) -> str:
        return say("less", label=self.label)

    @property
    def more(self) -> str:
        return say("more", label=self.label)


class Numeric(Stepped):
    """A number with limits; whole numbers, if its lowest and its step are whole.

    Without a `step` any number between the limits is taken; but limits that are written as whole
    numbers, as 0 and not as 0.0, are those of whole numbers.
    """

    min: Number
    max: Number
    step: Annotated[Number, Field(gt=0)] | None = None
    unit: Unit = ""
    default: Number | None = None
    span: Span = 6

    @model_validator(mode="before")
    @classmethod
    def _stepped(cls, given: Any) -> Any:
        """Only here it shows how the limits are written."""
        limits = [given.get(key) for key in ("min", "max")] if isinstance(given, Mapping) else []
        whole = limits and all(type(limit) is int for limit in limits)
        return {"step": 1, **given} if whole else given

    @property
    def whole(self) -> bool:
        return self.step is not None and self.step.is_integer() and self.min.is_integer()

    @property
    def gives(self) -> str:
        return "whole numbers" if self.whole else "numbers"

    @property
    def attributes(self) -> dict[str, str]:
        """Limits and step as HTML has them."""
        step = "any" if self.step is None else digits(self.step)
        return {"min": digits(self.min), "max": digits(self.max), "step": step}

    def typed(self, value: float) -> int | float:
        """A value of this input, as a message takes it."""
        return int(value) if self.whole else value


class NumberInput(Numeric):
    kind: Literal["number"]

    @property
    def start(self) -> str:
        return "" if self.default is None else digits(self.default)


class SliderInput(Numeric):
    kind: Literal["slider"]

    @property
    def start(self) -> str:
        return digits(self.min if self.default is None else self.default)


def _plain(given: Any) -> Any:
    """An option's value; what it has inside is as TOML has it, but no dates."""
    try:
        json.dumps(given)
    except TypeError:
        raise ValueError("must be text, a number, true or false, a list or a table") from None
    return given


class Option(Description):
    """What can be chosen; `key` is its value as a form posts it."""

    value: Annotated[Any, AfterValidator(_plain)]
    label: Label

    @property
    def key(self) -> str:
        return self.value if isinstance(self.value, str) else json.dumps(self.value)


class SelectInput(Placed):
    kind: Literal["select"]
    span: Span = 6
    options: Annotated[tuple[Option, ...], Field(strict=False), AfterValidator(some)]
    default: Any = None

    @property
    def start(self) -> str:
        """The key of the option that is chosen at first."""
        first = (option for option in self.options if same(option.value, self.default))
        return next(first, self.options[0]).key

    @property
    def gives(self) -> str:
        return "the values of its options"


class ToggleInput(Placed):
    kind: Literal["toggle"]
    span: Span = 6
    on: Label = said("on")
    off: Label = said("off")
    default: bool = False

    @property
    def gives(self) -> str:
        return "true or false"


def digits(number: float) -> str:
    """A number as it is written and as HTML has it: "5", "0.25", "1e-07"."""
    return str(int(number)) if number.is_integer() else repr(number)


def same(one: Any, other: Any) -> bool:
    """Whether two values are one, as TOML and JSON see it: 1 is 1.0, but not true."""
    return one == other and isinstance(one, bool) == isinstance(other, bool)
