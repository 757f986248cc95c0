"""What can be wrong in an input whose shape is right: limits, steps, defaults, options."""

from collections.abc import Iterator, Sequence
from fractions import Fraction

from app.errors import Fault
from app.interfaces.validation import shown
from app.panel.model import Input
from app.panel.widgets.inputs import Numeric, Option, SelectInput, TextInput, digits, same


def input_faults(place: str, of: Input) -> Iterator[Fault]:
    match of:
        case TextInput() if len(of.default) > of.max_length:
            yield Fault(f"{place}.default", f"is longer than max_length ({of.max_length})")
        case SelectInput():
            yield from _select(place, of)
        case Numeric():
            yield from _numeric(place, of)


def on_step(of: Numeric, value: float) -> bool:
    """Whether a value is whole steps away from the lowest, exactly as both are written."""
    if of.step is None:
        return True
    low, step = Fraction(repr(of.min)), Fraction(repr(of.step))
    return (Fraction(repr(value)) - low) % step == 0


def _numeric(place: str, of: Numeric) -> Iterator[Fault]:
    low, high = digits(of.min), digits(of.max)
    step = "" if of.step is None else digits(of.step)
    if of.max <= of.min:
        yield Fault(f"{place}.max", f"{high} must be more than min ({low})")
    elif not on_step(of, of.max):
        yield Fault(f"{place}.step", f"no whole number of steps of {step} leads from {low} to {high}")
    elif of.default is not None and not of.min <= of.default <= of.max:
        yield Fault(f"{place}.default", f"{digits(of.default)} is not from {low} to {high}")
    elif of.default is not None and not on_step(of, of.default):
        what = f"is not on a step of {step} from {low}"
        hint = f"; limits written as {of.min} and {of.max} take any number" if of.step == 1 else ""
        yield Fault(f"{place}.default", f"{digits(of.default)} {what}{hint}")


def _select(place: str, of: SelectInput) -> Iterator[Fault]:
    yield from option_faults(place, of.options)
    if of.default is not None and not any(same(o.value, of.default) for o in of.options):
        there = ", ".join(shown(option.value) for option in of.options)
        yield Fault(f"{place}.default", f"{shown(of.default)} is no option; there is {there}")


def option_faults(place: str, options: Sequence[Option]) -> Iterator[Fault]:
    """Options that can't be told apart."""
    keys = [option.key for option in options]
    labels = [option.label for option in options]
    for i, (key, label) in enumerate(zip(keys, labels, strict=True)):
        if key in keys[:i]:
            yield Fault(f"{place}.options[{i}].value", f"{key} is already options[{keys.index(key)}]")
        if label in labels[:i]:
            what = f'"{label}" is already the label of options[{labels.index(label)}]'
            yield Fault(f"{place}.options[{i}].label", what)
