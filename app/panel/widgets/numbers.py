"""The descriptions of number inputs: limits, steps, and checks of a value."""

from collections.abc import Iterator, Mapping
from fractions import Fraction
from typing import Annotated, Any, Final, Literal

from pydantic import Field, model_validator

from app.panel.base import Span
from app.panel.numbers import Conversion, conversion, is_on_step, step_fault, units_like
from app.panel.shared_keys import Unit
from app.panel.values import number_text
from app.panel.widgets.families import BaseWidget, CheckContext, Input
from app.ros.messages.validation import format_value
from app.system.errors import Fault, InputError
from app.system.texts import Text, TextLike, number, say
from app.system.texts.locales import clear_text, is_unclear, lone_group, read_number
from app.system.texts.text import after_space, number_like

MAX_EXACT_NUMBER: Final = 2.0**53  # beyond this, numbers of a browser are not exact

Number = Annotated[float, Field(ge=-MAX_EXACT_NUMBER, le=MAX_EXACT_NUMBER)]


def no_number(label: TextLike, limits: TextLike, value: Any, *, whole: bool) -> Text:
    """Why a value is refused that is not a number, or not written like one, or like two."""
    if isinstance(value, str) and (both := lone_group(value)) is not None:
        first, second = (number(clear_text(number_text(each))) for each in both)
        return say("input_unclear_number", label=label, given=value, first=first, second=second)
    shown, example = format_value(value), number_like(whole=whole)
    return say("input_not_a_number", label=label, limits=limits, given=shown, example=example)


class SteppedWidget(BaseWidget):
    """A widget with − and + buttons."""

    @property
    def decrease_label(self) -> Text:
        return say("less", label=self.label)

    @property
    def increase_label(self) -> Text:
        return say("more", label=self.label)


class Numeric(SteppedWidget, Input):
    """A number with limits; a whole number if `min` and `step` are whole. `value * scale + offset` is
    sent, or with `send_unit` the value in that unit.

    Without a `step` any number between the limits is accepted. If both limits are written as whole
    numbers (0, not 0.0), the step is 1.
    """

    min: Number
    max: Number
    step: Annotated[Number, Field(gt=0)] | None = None
    unit: Unit = ""
    default: Number | None = None
    scale: Number = 1.0
    offset: Number = 0.0
    send_unit: Annotated[str, Field(min_length=1, max_length=20)] | None = None
    span: Span = 6

    @model_validator(mode="before")
    @classmethod
    def _default_step(cls, table: Any) -> Any:
        """Sets the default step; only the raw table shows how the limits are written."""
        limits = [table.get(key) for key in ("min", "max")] if isinstance(table, Mapping) else []
        whole = limits and all(type(limit) is int for limit in limits)
        return {"step": 1, **table} if whole else table

    @property
    def initial_text(self) -> str:
        """The initial text of its entry."""
        return "" if self.default is None else clear_text(number_text(self.default))

    @property
    def is_whole(self) -> bool:
        return self.step is not None and self.step.is_integer() and self.min.is_integer()

    @property
    def value_description(self) -> str:
        return "whole numbers" if self.is_whole else "numbers"

    @property
    def comment(self) -> str:
        unit = f" {self.unit}" if self.unit else ""
        first = f", {self.initial_text} at first" if self.initial_text else ""
        return f"{number_text(self.min)} to {number_text(self.max)}{unit}{first}{self._sent_comment}"

    @property
    def _sent_comment(self) -> str:
        """The range that leaves the panel, where it is another one."""
        if not self.is_converted:
            return ""
        low, high = sorted(map(float, map(self.sent_value, (self.min, self.max))))
        unit = f" {self.send_unit}" if self.send_unit else ""
        return f"; sent as {number_text(low)} to {number_text(high)}{unit}"

    @property
    def is_converted(self) -> bool:
        """Whether another number is sent than the one that is shown."""
        return (self.scale, self.offset) != (1.0, 0.0) or self.send_unit is not None

    @property
    def _conversion(self) -> Conversion:
        known = conversion(str(self.unit), self.send_unit) if self.send_unit else None
        return known or Conversion(Fraction(repr(self.scale)), Fraction(repr(self.offset)))

    def sent_value(self, value: Any) -> Any:
        """A whole number where every step is sent as one."""
        if not self.is_converted:
            return value
        converted = self._conversion
        steps = () if self.step is None else (self.min, self.min + self.step)
        whole = steps and all(float(converted.apply(step)).is_integer() for step in steps)
        sent = converted.apply(value)
        return round(sent) if whole else float(sent)

    def entered_value(self, sent: float) -> float:
        """The value whose `sent_value` this is: what the robot has, in the operator's unit."""
        if not self.is_converted:
            return sent
        scale, offset = self._conversion
        return float((Fraction(repr(sent)) - Fraction(offset)) / Fraction(scale)) if scale else sent

    @property
    def html_attributes(self) -> dict[str, str]:
        """Limits and step as HTML attributes."""
        step = "any" if self.step is None else number_text(self.step)
        return {"min": number_text(self.min), "max": number_text(self.max), "step": step}

    @property
    def limits_text(self) -> Text:
        """The limits as text: "0 to 1.5 m/s, in steps of 0.1"."""
        low, high = number(number_text(self.min)), number(number_text(self.max))
        unit = after_space(self.unit)
        if self.step is None:
            return say("limits_both", low=low, high=high, unit=unit)
        return say("limits", low=low, high=high, unit=unit, step=number(number_text(self.step)))

    @property
    def range_text(self) -> Text:
        """The limits beside a label that has the unit, for narrow places: "0 to 1.5"."""
        low, high = number(number_text(self.min)), number(number_text(self.max))
        return say("limits_both", low=low, high=high, unit="")

    @property
    def default_value(self) -> int | float | None:
        return None if self.default is None else self.to_type(self.default)

    def to_type(self, value: float) -> int | float:
        """A value of this input as an int or a float, as a message needs it."""
        return round(value) if self.is_whole else value

    def is_on_step(self, value: float) -> bool:
        """Whether a value is a whole number of steps from `min`, as `is_on_step` has it."""
        return self.step is None or is_on_step(value, self.min, self.step, whole=self.is_whole)

    def examples(self) -> list[Any]:
        return [self.to_type(self.min), self.to_type(self.max)]

    def parse_text(self, text: str, language: str) -> int | float | str:
        value = read_number(text, language, whole=self.is_whole)
        return text.strip() if value is None or is_unclear(text, self.permits) else value

    def permits(self, value: float) -> bool:
        """Whether a number is within the limits and on a step."""
        is_whole = not self.is_whole or float(value).is_integer()
        return is_whole and self.min <= value <= self.max and self.is_on_step(value)

    def check_value(self, value: Any) -> int | float:
        label, allowed = self.label, self.limits_text
        if value == "" or value is None:
            raise InputError(say("input_number_empty", label=label, limits=allowed))
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(no_number(label, allowed, value, whole=self.is_whole))
        # Limits first: a value beyond them may be no float, or take long to divide.
        if not self.min <= value <= self.max or not self.is_on_step(float(value)):
            small = isinstance(value, float) and abs(value) <= MAX_EXACT_NUMBER
            text = number(number_text(value) if small else format_value(value))
            raise InputError(say("input_outside_limits", label=label, limits=allowed, given=text))
        return self.to_type(float(value))

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        low, high = number_text(self.min), number_text(self.max)
        step = "" if self.step is None else number_text(self.step)
        default = "" if self.default is None else number_text(self.default)
        yield from self._conversion_faults(place)
        if self.max <= self.min:
            yield Fault(f"{place}.max", f"{high} must be more than min ({low})")
        elif not self.is_on_step(self.max):
            yield Fault(f"{place}.step", step_fault(self.step or 0, self.min, self.max))
        elif self.default is not None and not self.min <= self.default <= self.max:
            yield Fault(f"{place}.default", f"{default} is not from {low} to {high}")
        elif self.default is not None and not self.is_on_step(self.default):
            message = f"is not on a step of {step} from {low}"
            any_number = f"; limits written as {self.min} and {self.max} take any number"
            yield Fault(
                f"{place}.default", f"{default} {message}{any_number if self.step == 1 else ''}"
            )

    def _conversion_faults(self, place: str) -> Iterator[Fault]:
        unit = str(self.unit)
        if self.scale == 0:
            yield Fault(f"{place}.scale", "is 0: the same number would always be sent")
        if self.send_unit is None:
            return
        if (self.scale, self.offset) != (1.0, 0.0):
            message = "stands beside scale or offset: write the one or the others"
            yield Fault(f"{place}.send_unit", message)
        elif not unit:
            yield Fault(
                f"{place}.unit",
                f'is missing: the robot gets "{self.send_unit}" (send_unit); unit is what is entered',
            )
        elif conversion(unit, self.send_unit) is None:
            known = units_like(unit)
            right = f"{unit} can be sent as {', '.join(known)}" if known else "write scale and offset"
            yield Fault(f"{place}.send_unit", f'from "{unit}" to "{self.send_unit}": {right}')


class NumberInput(Numeric):
    kind: Literal["number"]


class SliderInput(Numeric):
    kind: Literal["slider"]

    @property
    def initial_text(self) -> str:
        return clear_text(number_text(self.min if self.default is None else self.default))
