"""Inputs of numbers: their limits and steps, and what is checked of an entered number."""

import re
from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from app.errors import Fault, InputError
from app.i18n import Text, say
from app.interfaces.validation import shown
from app.panel.base import Span
from app.panel.values import digits
from app.panel.widgets.families import Checking, Input, Placed

MOST: Final = 2.0**53  # beyond this a browser's numbers are not exact
# Reads each character once, however long a text is: what two parts could take is tried again and again.
DECIMAL: Final = re.compile(r"\s*[+-]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][+-]?[0-9]+)?\s*", re.ASCII)

Number = Annotated[float, Field(ge=-MOST, le=MOST)]
Unit = Annotated[str, Field(max_length=20)]


class Stepped(Placed):
    """What has − and + beside it."""

    @property
    def less(self) -> Text:
        return say("less", label=self.label)

    @property
    def more(self) -> Text:
        return say("more", label=self.label)


class Numeric(Stepped, Input):
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
    def start(self) -> str:
        """What a page shows at first."""
        return "" if self.default is None else digits(self.default)

    @property
    def whole(self) -> bool:
        return self.step is not None and self.step.is_integer() and self.min.is_integer()

    @property
    def gives(self) -> str:
        return "whole numbers" if self.whole else "numbers"

    @property
    def about(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        first = f", {self.start} at first" if self.start else ""
        return f"{digits(self.min)} to {digits(self.max)}{unit}{first}"

    @property
    def attributes(self) -> dict[str, str]:
        """Limits and step as HTML has them."""
        step = "any" if self.step is None else digits(self.step)
        return {"min": digits(self.min), "max": digits(self.max), "step": step}

    @property
    def limits(self) -> Text:
        """What a number may be, as an operator reads it: "0 to 1.5 m/s, in steps of 0.1"."""
        low, high = digits(self.min), digits(self.max)
        unit = f" {self.unit}" if self.unit else ""
        if self.step is None:
            return say("limits_both", low=low, high=high, unit=unit)
        return say("limits", low=low, high=high, unit=unit, step=digits(self.step))

    @property
    def default_value(self) -> int | float | None:
        return None if self.default is None else self.in_type(self.default)

    def in_type(self, value: float) -> int | float:
        """A value of this input, as a message takes it."""
        return int(value) if self.whole else value

    def on_step(self, value: float) -> bool:
        """Whether a value is whole steps away from the lowest, exactly as both are written."""
        if self.step is None:
            return True
        low, step = Fraction(repr(self.min)), Fraction(repr(self.step))
        return (Fraction(repr(value)) - low) % step == 0

    def examples(self) -> list[Any]:
        return [self.in_type(self.min), self.in_type(self.max)]

    def typed(self, text: str) -> int | float | str:
        if not DECIMAL.fullmatch(text):
            return text
        value = float(text)
        return int(value) if abs(value) <= MOST and value.is_integer() else value

    def checked(self, given: Any) -> int | float:
        label, allowed = self.label, self.limits
        if given == "" or given is None:
            raise InputError(say("number_empty", label=label, limits=allowed))
        if isinstance(given, bool) or not isinstance(given, int | float):
            raise InputError(say("no_number", label=label, limits=allowed, given=shown(given)))
        # Limits first: what is beyond them may be no float at all, or take long to divide.
        if not self.min <= given <= self.max or not self.on_step(float(given)):
            small = isinstance(given, float) and abs(given) <= MOST
            text = digits(given) if small else shown(given)
            raise InputError(say("off_limits", label=label, limits=allowed, given=text))
        return self.in_type(float(given))

    def faults(self, place: str, checking: Checking) -> Iterator[Fault]:
        low, high = digits(self.min), digits(self.max)
        step = "" if self.step is None else digits(self.step)
        default = "" if self.default is None else digits(self.default)
        if self.max <= self.min:
            yield Fault(f"{place}.max", f"{high} must be more than min ({low})")
        elif not self.on_step(self.max):
            what = f"no whole number of steps of {step} leads from {low} to {high}"
            yield Fault(f"{place}.step", what)
        elif self.default is not None and not self.min <= self.default <= self.max:
            yield Fault(f"{place}.default", f"{default} is not from {low} to {high}")
        elif self.default is not None and not self.on_step(self.default):
            what = f"is not on a step of {step} from {low}"
            any_number = f"; limits written as {self.min} and {self.max} take any number"
            yield Fault(f"{place}.default", f"{default} {what}{any_number if self.step == 1 else ''}")


class NumberInput(Numeric):
    kind: Literal["number"]


class SliderInput(Numeric):
    kind: Literal["slider"]

    @property
    def start(self) -> str:
        return digits(self.min if self.default is None else self.default)
