"""Descriptions of what is shown: values and lamps."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field

from app.errors import Fault
from app.interfaces import INTEGERS, Interfaces
from app.interfaces.validation import shown
from app.panel.base import Description, Label, Span, some
from app.panel.constants import NUMBERS, holder, misfit, no_constant
from app.panel.faults.wording import listing
from app.panel.widgets.families import Display
from app.panel.widgets.numbers import Unit

# [+] [,] [.digits] [f, e, g, % or d]: a part of Python's, in which nothing can go wrong.
FORMAT: Final = r"^\+?,?(\.[0-9]{1,2}[feg%]|[feg%d])$"
SHAPE_AND_TEXT: Final = "only the colour would tell them apart"

Factor = Annotated[float, Field(allow_inf_nan=False)]


class Readout(Display):
    """A field's value, as `value * scale + offset` in a format, or by the name of a constant."""

    kind: Literal["readout"]
    format: Annotated[str, Field(pattern=FORMAT)] | None = None
    unit: Unit = ""
    scale: Factor = 1.0
    offset: Factor = 0.0
    constants: Annotated[str, Field(pattern=r"^[A-Z][A-Z0-9_]*$")] | None = None

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        yield from _number(place, self, field_type)
        yield from _constants(place, self, interfaces)


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


class Indicator(Display):
    """A lamp: one state for each value; a value without one shows as unknown."""

    kind: Literal["indicator"]
    states: Annotated[tuple[LampState, ...], Field(strict=False), AfterValidator(some)]
    span: Span = 4

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        yield from _states(place, self, field_type, interfaces)

    def resolved(self, interfaces: Interfaces) -> Self:
        kind = interfaces.field_type(self.type, self.field)
        constants = interfaces.constants(holder(self, interfaces))
        states = [
            one.model_copy(update={"value": value_of_state(one.value, kind, constants)})
            for one in self.states
        ]
        return self.model_copy(update={"states": tuple(states)})


def value_of_state(given: bool | int | str, kind: str, constants: Mapping[str, Any]) -> Any:
    """What a lamp's state is for: a text is a constant's name where the field is a whole number.

    A name that there is no constant of stays what it is.
    """
    named = isinstance(given, str) and kind in INTEGERS
    return constants.get(str(given), given) if named else given


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
