"""The descriptions of displays: readouts and lamps."""

from collections.abc import Collection, Iterator, Mapping
from typing import Annotated, Any, ClassVar, Final, Literal, Protocol, Self

from pydantic import AfterValidator, BeforeValidator, Field

from app.errors import Fault
from app.i18n import TextLike
from app.i18n.values import alike
from app.interfaces import INTEGER_RANGES, Interfaces, Type
from app.interfaces.validation import fitting_constants, format_value, unknown_constant
from app.panel.base import Description, Label, Span, non_empty
from app.panel.constants import NUMBERS, HasField, parent_type, value_mismatch
from app.panel.faults.wording import list_names
from app.panel.number_format import FORMAT, Factor
from app.panel.times import DEFAULT_FORMATS, time_faults
from app.panel.widgets.families import Display
from app.panel.widgets.numbers import Unit

CONSTANTS: Final = r"^([A-Z][A-Z0-9_]*)?$"  # what names begin with; "" for all
# The same, or a time: see `app.panel.times`.
FORMAT_OR_TIME: Final = rf"{FORMAT}|^(time|age|duration)$"
SHAPE_AND_TEXT: Final = "only the colour would tell them apart"


class Readout(Display):
    """Shows a field as `value * scale + offset` in a format, as a time, or as a constant's name."""

    whole_types: ClassVar[Collection[str]] = DEFAULT_FORMATS.keys()

    kind: Literal["readout"]
    format: Annotated[str, Field(pattern=FORMAT_OR_TIME)] | None = None
    unit: Unit = ""
    scale: Factor = 1.0
    offset: Factor = 0.0
    constants: Annotated[str, Field(pattern=CONSTANTS)] | None = None

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        times = list(time_faults(place, self.format, field_type, self.unit))
        yield from times or _number_faults(place, self, field_type)
        yield from constant_faults(place, self, interfaces)


def check_state_value(value: Any) -> Any:
    if not isinstance(value, bool | int | str):
        raise ValueError(f"must be a whole number, true or false, or text, not {format_value(value)}")
    return value


StateValue = Annotated[bool | int | str, BeforeValidator(check_state_value)]


class LampState(Description):
    """How a lamp shows one value, which may be a constant's name. Normal states are grey, white or
    black; colours are for abnormal ones."""

    value: StateValue
    text: Label
    shape: Literal["circle", "square", "triangle", "diamond", "cross", "bar", "play", "pause"]
    colour: Literal["grey", "white", "black", "blue", "yellow", "red"] = "grey"


class Indicator(Display):
    """A lamp with a state for each value. A value without a state is shown as unknown."""

    kind: Literal["indicator"]
    states: Annotated[tuple[LampState, ...], Field(strict=False), AfterValidator(non_empty)]
    span: Span = 4

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        yield from state_faults(place, self, field_type, interfaces, "an indicator")

    def with_constants(self, interfaces: Interfaces) -> Self:
        kind = interfaces.field_type(self.type, self.field)
        constants = interfaces.constants(parent_type(self, interfaces))
        states = [
            state.model_copy(update={"value": resolve_state_value(state.value, kind, constants)})
            for state in self.states
        ]
        return self.model_copy(update={"states": tuple(states)})


def resolve_state_value(value: bool | int | str, kind: str, constants: Mapping[str, Any]) -> Any:
    """The value of a lamp's state. A text is a constant's name if the field is a whole number; an
    unknown name is returned as it is.
    """
    named = isinstance(value, str) and kind in INTEGER_RANGES
    return constants.get(str(value), value) if named else value


def _same_look(look: tuple[str, TextLike], other: tuple[str, TextLike]) -> bool:
    return look[0] == other[0] and alike(look[1], other[1])


def _number_faults(place: str, readout: Readout, kind: str) -> Iterator[Fault]:
    scaled = (readout.scale, readout.offset) != (1.0, 0.0)
    style = None if kind in DEFAULT_FORMATS else readout.format
    for key, setting in (("format", style), ("scale", scaled), ("unit", readout.unit)):
        if setting and kind not in NUMBERS:
            message = f'is for numbers; "{readout.field}" is {kind}'
            yield Fault(f"{place}.{key}", message, cause=f"number {place}")
        elif setting and readout.constants is not None:
            message = "is for numbers; constants are shown by their names"
            yield Fault(f"{place}.{key}", message, cause=f"number {place}")
    yield from format_fault(place, readout, kind)


class WrittenNumber(Protocol):
    """What is written with a format."""

    @property
    def format(self) -> str | None: ...
    @property
    def scale(self) -> float: ...
    @property
    def offset(self) -> float: ...


def format_fault(place: str, widget: WrittenNumber, kind: str) -> Iterator[Fault]:
    """A fault of a format for whole numbers, where the number is none."""
    scaled = (widget.scale, widget.offset) != (1.0, 0.0)
    if (
        widget.format
        and widget.format.endswith("d")
        and kind in NUMBERS
        and (scaled or kind not in INTEGER_RANGES)
    ):
        kind_text = "a scaled number" if scaled else kind
        yield Fault(f"{place}.format", f'"{widget.format}" is for whole numbers; this is {kind_text}')


class NamedByConstants(HasField, Protocol):
    """What shows a number by the name of a constant."""

    @property
    def constants(self) -> str | None: ...


def constant_faults(place: str, readout: NamedByConstants, interfaces: Interfaces) -> Iterator[Fault]:
    """Faults of a prefix of constants."""
    if readout.constants is None:
        return
    type_name = parent_type(readout, interfaces)
    kind = interfaces.type_at(readout.type, readout.field)
    names = fitting_constants(kind, interfaces.constants(type_name))
    shown = {name: value for name, value in names.items() if name.startswith(readout.constants)}
    if not shown:
        message = f"no constant of {type_name} starts so; it has {list_names(names)}"
        yield Fault(f"{place}.constants", message)
    for name, value in shown.items():
        first = next(other for other, its in shown.items() if its == value)
        if first != name:
            message = (
                f"{first} and {name} are both {value}: a longer prefix tells them apart, or a lamp"
            )
            yield Fault(f"{place}.constants", message)
            return


class HasStates(HasField, Protocol):
    """A widget that shows each value by a lamp of its own."""

    @property
    def states(self) -> tuple[LampState, ...]: ...


def state_faults(
    place: str, indicator: HasStates, kind: str, interfaces: Interfaces, who: str
) -> Iterator[Fault]:
    """Faults of states for a field of this type; `who` has them."""
    if kind in ("float32", "float64"):
        message = f"{who} is for whole numbers, bools and texts"
        yield Fault(f"{place}.field", f'"{indicator.field}" is {kind}: {message}')
        return
    looks = [(state.shape, state.text) for state in indicator.states]
    type_name = parent_type(indicator, interfaces)
    constants = interfaces.constants(type_name)
    state_values = [resolve_state_value(state.value, kind, constants) for state in indicator.states]
    values = [(type(value), value) for value in state_values]
    for i, state in enumerate(indicator.states):
        at = f"{place}.states[{i}]"
        if isinstance(state_values[i], str) and kind in INTEGER_RANGES:
            message = unknown_constant(state_values[i], Type(kind), type_name, constants)
            yield Fault(f"{at}.value", message, cause=f"state {place}")
            continue
        if fault := value_mismatch(state_values[i], kind):
            yield Fault(f"{at}.value", fault, cause=f"state {place}")
            continue
        if values[i] in values[:i]:
            above = values.index(values[i])
            yield Fault(
                f"{at}.value", f"{format_value(state.value)} is already the value of states[{above}]"
            )
        if (first := next((n for n in range(i) if _same_look(looks[n], looks[i])), None)) is not None:
            yield Fault(at, f"has the shape and text of states[{first}]: {SHAPE_AND_TEXT}")
