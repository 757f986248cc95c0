"""What can be wrong in a parameter's description whose shape is right: its own limits and options."""

from collections.abc import Iterator, Mapping
from math import isfinite
from typing import Any, Final

from app.errors import Fault
from app.interfaces import INTEGERS
from app.interfaces.validation import shown
from app.panel.model import Panel
from app.panel.number_range import Range
from app.panel.widgets.check_inputs import option_faults
from app.panel.widgets.inputs import digits
from app.panel.widgets.parameter import Parameter

LONGEST_TEXT: Final = 1000  # characters that can be set
KINDS: Final[Mapping[str, str]] = {
    "bool": "true or false",
    "integer": "a whole number (int64)",
    "double": "a number",
    "string": f"text of {LONGEST_TEXT} characters at most",
}


def parameter_faults(place: str, of: Parameter) -> Iterator[Fault]:
    given = {key: getattr(of, key) for key in ("min", "max", "step") if getattr(of, key) is not None}
    if not of.counts:
        for key in (*given, *(["unit"] if of.unit else [])):
            what = f'is for numbers; the type is "{of.type}"'
            yield Fault(f"{place}.{key}", what, cause=f"number {place}")
    if of.options:
        yield from _options(place, of)
        for key in given if of.counts else ():
            what = "is for what is entered: with options one of them is chosen"
            yield Fault(f"{place}.{key}", what, cause=f"number {place}")
    elif of.counts:
        yield from _limits(place, of, given)


def _options(place: str, of: Parameter) -> Iterator[Fault]:
    if of.type == "bool":
        yield Fault(f"{place}.options", 'a bool has none: its switch has the words of "on" and "off"')
        return
    yield from option_faults(place, of.options)
    for i, option in enumerate(of.options):
        value = option.value
        several = value if of.many and isinstance(value, list) else [value]
        right = of.many == isinstance(value, list) and all(fits(of.element, one) for one in several)
        if not right:
            what = f"must be {KINDS[of.element]}, not {shown(value)}"
            yield Fault(f"{place}.options[{i}].value", f"a list: each {what}" if of.many else what)


def fits(kind: str, value: Any) -> bool:
    """Whether a value of TOML or JSON is one of a single parameter's type."""
    match kind:
        case "bool":
            return isinstance(value, bool)
        case "string":
            return isinstance(value, str) and len(value) <= LONGEST_TEXT
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    low, high = INTEGERS["int64"]
    return isinstance(value, int) and low <= value <= high if kind == "integer" else isfinite(value)


def _limits(place: str, of: Parameter, given: Mapping[str, float]) -> Iterator[Fault]:
    if of.element == "integer":
        broken = {key: one for key, one in given.items() if not one.is_integer()}
        for key, one in broken.items():
            what = f"{digits(one)} must be whole: the type is {of.type}"
            yield Fault(f"{place}.{key}", what, cause=f"number {place}")
        if broken:
            return
    if of.min is None or of.max is None:
        return
    low, high = digits(of.min), digits(of.max)
    if of.max <= of.min:
        yield Fault(f"{place}.max", f"{high} must be more than min ({low})")
    elif of.step is not None and not Range(of.min, None, of.step).on_step(of.max):
        step = digits(of.step)
        yield Fault(f"{place}.step", f"no whole number of steps of {step} leads from {low} to {high}")


def type_faults(panel: Panel) -> Iterator[Fault]:
    """A parameter has one type, wherever the panel names it."""
    firsts: dict[tuple[str, str], str] = {}
    for p, page in enumerate(panel.pages):
        for w, widget in enumerate(page.widgets):
            if isinstance(widget, Parameter):
                first = firsts.setdefault((widget.node, widget.parameter), widget.type)
                if first != widget.type:
                    what = (
                        f"{widget.parameter} of {widget.node} is {widget.type} here but {first} above"
                    )
                    cause = f"parameter {widget.node} {widget.parameter}"
                    yield Fault(f"page[{p}].widget[{w}].type", what, cause=cause)
