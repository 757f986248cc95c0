"""Checks of the `[demo]` table: names that the panel does not use, keys and values that do not fit."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, Final, Literal

from app.panel.constants import mismatch_at
from app.panel.demo import DemoEntry
from app.panel.file.keys import place_of
from app.panel.file.wording import closest_name, known_hint, list_names
from app.panel.model import Panel
from app.panel.numbers import NUMBERS
from app.panel.used import used_names
from app.panel.values import join_list, number_text
from app.panel.widgets.parameter import Parameter, is_valid_value
from app.ros.messages import INTEGER_RANGES, Interfaces
from app.ros.messages.validation import format_value
from app.system.errors import Fault, FieldError, InterfaceError

Use = Literal["topic", "publication", "service", "action", "node"]

# What a name is → the keys that it may have beside `silent`.
KEYS: Final[Mapping[Use, tuple[str, ...]]] = {
    "topic": ("range", "ranges", "values", "message", "period_s", "hz"),
    "publication": (),
    "service": ("response",),
    "action": ("result", "duration_s"),
    "node": ("parameters",),
}
WORDS: Final[Mapping[Use, str]] = {
    "topic": "a topic that the panel shows",
    "publication": "a topic that the panel publishes",
    "service": "a service",
    "action": "an action",
    "node": "a node with parameters",
}


@dataclass(frozen=True, slots=True)
class _Names:
    """What a panel uses: use → name → type; of a node, its parameters."""

    types: Mapping[Use, Mapping[str, str]]
    parameters: Mapping[str, Mapping[str, Parameter]]
    every: frozenset[str] = field(default=frozenset())

    def uses(self, name: str) -> list[Use]:
        of_types: list[Use] = [use for use, names in self.types.items() if name in names]
        return [*of_types, "node"] if name in self.parameters else of_types


def demo_faults(panel: Panel, interfaces: Interfaces) -> Iterator[Fault]:
    """The faults of all entries. By their cause they are consequences of faults of subscriptions."""
    for fault in _entry_faults(panel, _names(panel), interfaces):
        yield replace(fault, cause=f"listens {fault.cause or fault.place}")


def _entry_faults(panel: Panel, names: _Names, interfaces: Interfaces) -> Iterator[Fault]:
    for name, entry in panel.demo.items():
        place = place_of(("demo", name))
        uses = names.uses(name)
        if not uses:
            meant = closest_name(name, names.every)
            hint = f"did you mean {meant}?" if meant else f"there is {list_names(sorted(names.every))}"
            yield Fault(place, f"the panel does not use {name}; {hint}", cause=name)
            continue
        yield from _key_faults(place, name, entry, uses)
        for use in uses:
            yield from _use_faults(place, name, entry, use, names, panel, interfaces)


def _names(panel: Panel) -> _Names:
    types: dict[Use, Mapping[str, str]] = {use: used for use, used in used_names(panel).items()}
    parameters: dict[str, dict[str, Parameter]] = {}
    for widget in panel.parameters():
        parameters.setdefault(widget.node, {})[widget.parameter] = widget
    every = frozenset().union(*types.values(), parameters)
    return _Names(types, parameters, every)


def _key_faults(place: str, name: str, entry: DemoEntry, uses: list[Use]) -> Iterator[Fault]:
    """Faults of keys that are for other names."""
    allowed = {"silent", *(key for use in uses for key in KEYS[use])}
    for key in sorted(entry.model_fields_set - allowed):
        right = next(use for use, keys in KEYS.items() if key in keys)
        message = f"is for {WORDS[right]}; {name} is {WORDS[uses[0]]}"
        yield Fault(f"{place}.{key}", message, cause=f"demo {name}")


def _use_faults(
    place: str,
    name: str,
    entry: DemoEntry,
    use: Use,
    names: _Names,
    panel: Panel,
    interfaces: Interfaces,
) -> Iterator[Fault]:
    if use == "node":
        yield from _parameter_faults(place, name, entry, names.parameters[name])
        return
    type_name = names.types[use][name]
    try:
        match use:
            case "topic":
                yield from _field_faults(place, name, entry, panel, interfaces)
                yield from _message_faults(f"{place}.message", type_name, entry.message, interfaces)
            case "service":
                response = interfaces.service_types(type_name)[1]
                yield from _message_faults(f"{place}.response", response, entry.response, interfaces)
            case "action":
                result = interfaces.action_types(type_name).result
                yield from _message_faults(f"{place}.result", result, entry.result, interfaces)
    except InterfaceError:
        return  # the type is reported where the panel uses it


def _message_faults(
    place: str, type_name: str, fields: Mapping[str, Any], interfaces: Interfaces
) -> Iterator[Fault]:
    try:
        interfaces.encode(type_name, fields)
    except FieldError as error:
        yield Fault(f"{place}.{error.field}".rstrip("."), error.message)


def _field_faults(
    place: str, name: str, entry: DemoEntry, panel: Panel, interfaces: Interfaces
) -> Iterator[Fault]:
    """Faults of `range`, `ranges` and `values`."""
    type_name = panel.listened()[name]
    paths = dict.fromkeys(panel.subscribed_fields().get(name, ()))
    kinds = {path: interfaces.type_at(type_name, path).name for path in paths}
    numbers = {path: kind for path, kind in kinds.items() if kind in NUMBERS}
    if entry.range is not None and not numbers:
        yield Fault(f"{place}.range", f"is for numbers; the panel shows no number of {name}")
    for path, kind in numbers.items() if entry.range else ():
        yield from _range_faults(f"{place}.range", path, kind, entry.range or ())
    for path, limits in entry.ranges.items():
        if path not in numbers:
            message = f"the panel shows no number at {path}; {known_hint(path, numbers)}"
            yield Fault(f"{place}.ranges", message)
        else:
            yield from _range_faults(f"{place}.ranges", path, numbers[path], limits)
    for i, value in enumerate(entry.values or ()):
        misfits = [(path, mismatch_at(value, type_name, path, interfaces)) for path in kinds]
        if wrong := next(((path, message) for path, message in misfits if message), None):
            yield Fault(f"{place}.values[{i}]", f'"{wrong[0]}": {wrong[1]}')
            return


def _range_faults(place: str, path: str, kind: str, limits: tuple[float, ...]) -> Iterator[Fault]:
    low, high = INTEGER_RANGES.get(kind, (-float("inf"), float("inf")))
    if limits[0] < low or limits[1] > high:
        limits_text = join_list(number_text(float(limit)) for limit in limits)
        yield Fault(place, f'"{path}" is {kind}, which goes from {low} to {high}, not [{limits_text}]')


def _parameter_faults(
    place: str, node: str, entry: DemoEntry, known: Mapping[str, Parameter]
) -> Iterator[Fault]:
    for name, value in entry.parameters.items():
        at = f"{place}.parameters"
        if name not in known:
            message = f"the panel has no parameter {name} of {node}; {known_hint(name, known)}"
            yield Fault(at, message)
            continue
        widget = known[name]
        several = value if widget.is_list and isinstance(value, list) else [value]
        fits = widget.is_list == isinstance(value, list)
        if not fits or not all(is_valid_value(widget.element_type, element) for element in several):
            yield Fault(at, f"{name} must be {widget.type}, not {format_value(value)}")
