"""What can be wrong in a readout or an indicator: its field, its format, its states."""

import re
from collections.abc import Iterator, Mapping
from difflib import get_close_matches
from typing import Any, Final

from app.errors import Fault, InterfaceError
from app.interfaces import INTEGERS, Interfaces
from app.interfaces.validation import shown
from app.panel.checks.types import type_fault
from app.panel.constants import holder, value_of_state
from app.panel.faults.wording import listing
from app.panel.interlock import Interlock
from app.panel.model import Display
from app.panel.widgets.displays import Indicator, Readout
from app.panel.widgets.publish import Confirm

NUMBERS: Final = frozenset({*INTEGERS, "float32", "float64"})
SHAPE_AND_TEXT: Final = "only the colour would tell them apart"


def field_faults(
    place: str, of: Interlock | Display | Confirm, interfaces: Interfaces
) -> Iterator[Fault]:
    """A type that is not there, a field that it does not have."""
    assert of.type is not None
    try:
        interfaces.require(of.type)
    except InterfaceError as error:
        yield type_fault(f"{place}.type", error)
        return
    try:
        interfaces.field_type(of.type, of.field)
    except InterfaceError as error:
        yield Fault(f"{place}.field", str(error))


def display_faults(place: str, of: Display, interfaces: Interfaces) -> Iterator[Fault]:
    faults = list(field_faults(place, of, interfaces))
    yield from faults
    if faults:
        return
    kind = interfaces.field_type(of.type, of.field)
    if re.search(r"[/\]]", kind):
        who = "a readout" if isinstance(of, Readout) else "an indicator"
        yield Fault(f"{place}.field", f'"{of.field}" is {kind}: {who} shows one value of it, not all')
    elif isinstance(of, Readout):
        yield from _number(place, of, kind)
        yield from _constants(place, of, interfaces)
    else:
        yield from _states(place, of, kind, interfaces)


def _number(place: str, of: Readout, kind: str) -> Iterator[Fault]:
    scaled = (of.scale, of.offset) != (1.0, 0.0)
    for key, given in (("format", of.format), ("scale", scaled), ("unit", of.unit)):
        if given and kind not in NUMBERS:
            what = f'is for numbers; "{of.field}" is {kind}'
            yield Fault(f"{place}.{key}", what, cause=f"number {place}")
        elif given and of.constants is not None:
            what = "is for numbers; constants are shown by their names"
            yield Fault(f"{place}.{key}", what, cause=f"number {place}")
    if of.format and of.format.endswith("d") and kind in NUMBERS and (scaled or kind not in INTEGERS):
        what = "a scaled number" if scaled else kind
        yield Fault(f"{place}.format", f'"{of.format}" is for whole numbers; this is {what}')


def _constants(place: str, of: Readout, interfaces: Interfaces) -> Iterator[Fault]:
    if of.constants is None:
        return
    type_name = holder(of, interfaces)
    names = interfaces.constants(type_name)
    found = {name: value for name, value in names.items() if name.startswith(of.constants)}
    if not found:
        what = f"no constant of {type_name} starts so; it has {listing(names)}"
        yield Fault(f"{place}.constants", what)
    for name, value in found.items():
        first = next(other for other, its in found.items() if its == value)
        if first != name:
            what = f"{first} and {name} are both {value}: a longer prefix tells them apart"
            yield Fault(f"{place}.constants", what)
            return


def _states(place: str, of: Indicator, kind: str, interfaces: Interfaces) -> Iterator[Fault]:
    if kind in ("float32", "float64"):
        what = "an indicator is for whole numbers, bools and texts"
        yield Fault(f"{place}.field", f'"{of.field}" is {kind}: {what}')
        return
    looks = [(state.shape, state.text) for state in of.states]
    type_name = holder(of, interfaces)
    constants = interfaces.constants(type_name)
    given = [value_of_state(state.value, kind, constants) for state in of.states]
    values = [(type(value), value) for value in given]
    for i, state in enumerate(of.states):
        at = f"{place}.states[{i}]"
        if isinstance(given[i], str) and kind in INTEGERS:
            what = no_constant(given[i], kind, type_name, constants)
            yield Fault(f"{at}.value", what, cause=f"state {place}")
            continue
        if fault := misfit(given[i], kind):
            yield Fault(f"{at}.value", fault, cause=f"state {place}")
            continue
        if values[i] in values[:i]:
            first = values.index(values[i])
            yield Fault(f"{at}.value", f"{shown(state.value)} is already the value of states[{first}]")
        if looks[i] in looks[:i]:
            first = looks.index(looks[i])
            yield Fault(at, f"has the shape and text of states[{first}]: {SHAPE_AND_TEXT}")


def misfit(value: Any, kind: str) -> str | None:
    """Why a field of this type never has this value."""
    if kind in ("float32", "float64"):
        number = isinstance(value, int | float) and not isinstance(value, bool)
        return None if number else f"must be a number ({kind}), not {shown(value)}"
    if kind == "bool":
        return None if isinstance(value, bool) else f"must be true or false (bool), not {shown(value)}"
    if kind in INTEGERS:
        low, high = INTEGERS[kind]
        if isinstance(value, bool) or not isinstance(value, int):
            return f"must be a whole number ({kind}), not {shown(value)}"
        inside = low <= value <= high
        return None if inside else f"{value} is out of range: {kind} goes from {low} to {high}"
    return None if isinstance(value, str) else f"must be text ({kind}), not {shown(value)}"


def no_constant(name: str, kind: str, type_name: str, constants: Mapping[str, Any]) -> str:
    """What would be right where a whole number is meant, and a text is no constant's name."""
    what = (
        f"must be a whole number ({kind}) or the name of a constant of {type_name}, not {shown(name)}"
    )
    fitting = [one for one, value in constants.items() if misfit(value, kind) is None]
    near = get_close_matches(name, fitting, n=1, cutoff=0.5)
    has = f"it has {listing(fitting)}"
    return f"{what}; did you mean {near[0]}? {has}" if near else f"{what}; {has}"
