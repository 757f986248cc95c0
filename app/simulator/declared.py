"""The parameters that a panel names, with plausible values, as their nodes declare them: pure."""

from collections.abc import Iterable, Mapping
from typing import Any, Final

from app.i18n import render
from app.panel.demo import NO_ENTRY, DemoEntry
from app.panel.number_range import Range
from app.panel.widgets import parameter as widgets
from app.simulator.answers import CHOICES
from app.simulator.parameters import Parameter
from app.simulator.values.guesses import span_of

# The numbers of rcl_interfaces/msg/ParameterType.
TYPES: Final[Mapping[str, int]] = {
    "bool": 1,
    "integer": 2,
    "double": 3,
    "string": 4,
    "bool[]": 6,
    "integer[]": 7,
    "double[]": 8,
    "string[]": 9,
}
LENGTH: Final = 3  # of a list without options


def declared_by(
    panels: Iterable[widgets.Parameter], demo: Mapping[str, DemoEntry]
) -> dict[str, dict[str, Parameter]]:
    """Node → name → parameter. Of several widgets for one parameter the limits are those that they
    all have."""
    parameters: dict[str, dict[str, list[widgets.Parameter]]] = {}
    for panel in panels:
        parameters.setdefault(panel.node, {}).setdefault(panel.parameter, []).append(panel)
    return {
        node: {
            name: _declared(several, demo.get(node, NO_ENTRY).parameters.get(name))
            for name, several in names.items()
        }
        for node, names in parameters.items()
    }


def _declared(several: list[widgets.Parameter], entry: Any) -> Parameter:
    first = several[0]
    alike = len({(limits.min, limits.max, limits.step) for limits in several}) == 1
    limits = _limits(first) if alike else None
    options = tuple(option.value for option in first.options) if len(several) == 1 else ()
    value = entry if entry is not None else _value(first, limits, options)
    if first.element_type == "double":
        value = [float(element) for element in value] if first.is_list else float(value)
    return Parameter(TYPES[first.type], value, limits=limits, options=options)


def _limits(widget: widgets.Parameter) -> Range | None:
    if not widget.has_numbers or widget.min is widget.max is None:
        return None
    limits = (widget.min, widget.max, widget.step)
    if widget.element_type == "integer":
        return Range(*(None if limit is None else int(limit) for limit in limits))
    return Range(*limits)


def _value(widget: widgets.Parameter, limits: Range | None, options: tuple[Any, ...]) -> Any:
    if options:
        return options[0]
    if widget.type == "string[]":
        return list(CHOICES)
    value = _single(widget, limits)
    return [value] * LENGTH if widget.is_list else value


def _single(widget: widgets.Parameter, limits: Range | None) -> Any:
    match widget.element_type:
        case "bool":
            return False
        case "string":
            return "demo"
    span = span_of(render(widget.unit), widget.parameter, render(widget.label))
    middle = (span.low + span.high) / 2
    if limits is not None:
        middle = _inside(limits, middle)
    return round(middle) if widget.element_type == "integer" else round(middle, 3)


def _inside(limits: Range, guess: float) -> float:
    """A value on a step of the limits, near their middle."""
    low, high, step = limits.low, limits.high, limits.step
    if low is None or high is None:
        near = guess if limits.contains(guess) else low if low is not None else high
        return guess if near is None else near
    middle = (low + high) / 2
    return low + round((middle - low) / step) * step if step else middle
