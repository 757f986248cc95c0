"""The descriptions of displays: readouts, lamps, cameras, logs, pallets, check lists, and static
parts."""

from collections.abc import Collection, Iterator, Mapping
from math import isfinite
from typing import Annotated, Any, ClassVar, Final, Literal, Protocol, Self

from pydantic import AfterValidator, BeforeValidator, Field, GetJsonSchemaHandler
from pydantic.json_schema import JsonSchemaValue

from app.panel.base import (
    Description,
    Icon,
    Id,
    Interlocks,
    Label,
    Rows,
    Seconds,
    Span,
    TopicName,
    TopicQos,
    non_empty,
)
from app.panel.checks.types import value_faults
from app.panel.constants import HasField, parent_type, value_mismatch
from app.panel.file.wording import list_names, no_such
from app.panel.shared_keys import AgeKey, FieldKeys, NumberKeys, NumberOrTimeFormat, number_key_faults
from app.panel.times import DEFAULT_FORMATS
from app.panel.widgets.families import (
    BaseWidget,
    CheckContext,
    Display,
    DisplayWidget,
    TopicField,
    TopicSource,
    TopicWidget,
)
from app.panel.widgets.numbers import MAX_EXACT_NUMBER
from app.panel.widgets.templated import TemplateCommand
from app.ros.messages import INTEGER_RANGES, Interfaces, Type
from app.ros.messages.validation import fitting_constants, format_value, unknown_constant
from app.system.errors import Fault
from app.system.pictures import PICTURE
from app.system.texts import TextLike
from app.system.texts.text import alike

# The descriptions of displays: readouts and lamps.

# What names of constants begin with; "" for all.
ConstantPrefix = Annotated[str, Field(pattern=r"^([A-Z][A-Z0-9_]*)?$")]
SHAPE_AND_TEXT: Final = "only the colour would tell them apart"


class Readout(NumberKeys, Display):
    """Shows a field as `value * scale + offset` in a format, as a time, or as a constant's name."""

    whole_types: ClassVar[Collection[str]] = DEFAULT_FORMATS.keys()

    kind: Literal["readout"]
    format: NumberOrTimeFormat | None = None
    constants: ConstantPrefix | None = None

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        yield from number_key_faults(place, self, self.field, field_type)
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


States = Annotated[tuple[LampState, ...], Field(strict=False), AfterValidator(non_empty)]


class StatesKey(FieldKeys):
    """A state for each value of a field."""

    states: States

    def with_constants(self, interfaces: Interfaces) -> Self:
        """The same with values in place of constants' names."""
        return self.model_copy(update={"states": resolved_states(self, interfaces)})


class Indicator(StatesKey, Display):
    """A lamp with a state for each value. A value without a state is shown as unknown."""

    kind: Literal["indicator"]
    span: Span = 4

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        yield from state_faults(place, self, field_type, interfaces, "an indicator")


def resolved_states(table: "HasStates", interfaces: Interfaces) -> tuple[LampState, ...]:
    """The states of a table with values in place of constants' names."""
    kind = interfaces.field_type(table.type, table.field)
    constants = interfaces.constants(parent_type(table, interfaces))
    return tuple(
        state.model_copy(update={"value": resolve_state_value(state.value, kind, constants)})
        for state in table.states
    )


def resolve_state_value(value: bool | int | str, kind: str, constants: Mapping[str, Any]) -> Any:
    """The value of a lamp's state. A text is a constant's name if the field is a whole number; an
    unknown name is returned as it is.
    """
    named = isinstance(value, str) and kind in INTEGER_RANGES
    return constants.get(str(value), value) if named else value


def _same_look(look: tuple[str, TextLike], other: tuple[str, TextLike]) -> bool:
    return look[0] == other[0] and alike(look[1], other[1])


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


# Fields that a widget reads beside its own: a number of the file or of a topic, and their checks.


class OrNumber:
    """A JSON schema that has a number beside the table."""

    def __get_pydantic_json_schema__(
        self, schema: Any, handler: GetJsonSchemaHandler
    ) -> JsonSchemaValue:
        return {"anyOf": [{"type": "number"}, handler(schema)]}


def number_or_table(value: Any, validate: Any) -> Any:
    """A number, or the table of a field of a topic that has it."""
    number = isinstance(value, int | float) and not isinstance(value, bool)
    if number and isfinite(value) and abs(value) <= MAX_EXACT_NUMBER:
        return float(value)
    if isinstance(value, Mapping):
        return validate(value)
    expected = 'a number, or a table like { topic = "/setpoint", type = "std_msgs/msg/Float64" }'
    raise ValueError(f"must be {expected}, not {format_value(value)}")


# A lamp on a button: what the robot itself reports, whatever was pressed.


class KeyLamp(StatesKey, TopicField):
    """A state for each value of the field that the robot reports."""

    def faults(self, place: str, interfaces: Interfaces) -> Iterator[Fault]:
        """Faults of the table at `place`."""
        faults = list(value_faults(place, self.type, self.field, "a lamp", interfaces))
        yield from faults
        if not faults:
            kind = interfaces.field_type(self.type, self.field)
            yield from state_faults(place, self, kind, interfaces, "a lamp")


class LampCommand(TemplateCommand):
    """A press whose button may have a lamp."""

    lamp: KeyLamp | None = None

    def sources(self) -> Iterator[TopicSource]:
        yield from super().sources()
        if self.lamp is not None:
            yield self.lamp.source("lamp")

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        if self.lamp is not None:
            yield from self.lamp.faults(f"{place}.lamp", checking.interfaces)

    def with_constants(self, interfaces: Interfaces) -> Self:
        if self.lamp is None:
            return self
        return self.model_copy(update={"lamp": self.lamp.with_constants(interfaces)})


# The newest picture of a camera.

PictureType = Literal["sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"]


class Camera(AgeKey, TopicWidget, DisplayWidget):
    """Shows the newest picture of a topic, which is subscribed to only while a browser shows it.

    One older than `max_age_s` is marked as old; of one with more than `max_bytes`, or more than
    `max_side_px` pixels a side, nothing is shown.
    Each browser gets at most `max_hz` pictures per second, and as few as it takes.
    """

    kind: Literal["camera"]
    type: PictureType = "sensor_msgs/msg/CompressedImage"
    qos: TopicQos = TopicQos(reliability="best_effort", durability="volatile", depth=1)
    max_age_s: Seconds = 1.0
    max_hz: Annotated[float, Field(ge=0.1, le=60)] = 15.0
    max_bytes: Annotated[int, Field(ge=1_000, le=64_000_000)] = 8_000_000
    max_side_px: Annotated[int, Field(ge=16, le=16_384)] = 4096
    span: Span = 6
    rows: Rows = 2

    def sources(self) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, (), on_demand=True)

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.topic in checking.types:
            message = f"{self.topic} is listened to at all times by another part of the panel"
            yield Fault(f"{place}.topic", f"{message}: a camera's topic is only a camera's")
        yield from super().faults(place, checking)


# What the robot's nodes write to their log.

LEVELS: Final = ("debug", "info", "warn", "error", "fatal")
Level = Literal["debug", "info", "warn", "error", "fatal"]


class LogView(TopicWidget, DisplayWidget):
    """The newest `lines` of a log, of at least a `level`, by nodes whose name has `node` in it.

    The server keeps the newest `keep` lines. With `own`, the panel's own are among them.
    """

    kind: Literal["log"]
    topic: TopicName = "/rosout"
    type: Literal["rcl_interfaces/msg/Log"] = "rcl_interfaces/msg/Log"
    level: Level = "info"
    node: Annotated[str, Field(max_length=100)] = ""
    lines: Annotated[int, Field(ge=5, le=200)] = 50
    keep: Annotated[int, Field(ge=100, le=10_000)] = 1_000
    own: bool = False
    span: Span = 12
    rows: Rows = 3

    def sources(self) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, ())


# A plan of a pallet that a count fills, box by box and layer by layer.


class Pallet(Display):
    """Shows the layer that is filled: `across` boxes in a row, `along` rows, and `layers` of them."""

    kind: Literal["pallet"]
    across: Annotated[int, Field(ge=1, le=30)]
    along: Annotated[int, Field(ge=1, le=30)]
    layers: Annotated[int, Field(ge=1, le=100)] = 1
    span: Span = 4

    @property
    def in_layer(self) -> int:
        """The boxes of one layer."""
        return self.across * self.along

    def value_faults(self, place: str, field_type: str, interfaces: Interfaces) -> Iterator[Fault]:
        if field_type not in INTEGER_RANGES:
            message = f'"{self.field}" is {field_type}: a pallet is filled by a whole number'
            yield Fault(f"{place}.field", message)


# What only stands on a page: texts, pictures, links to other pages.


PictureName = Annotated[str, Field(pattern=PICTURE)]


class Static(BaseWidget):
    """A widget that never changes."""

    on_phone: ClassVar[bool] = True


class TextLabel(Static):
    """A text; its `label` is what it says."""

    kind: Literal["label"]
    size: Literal["small", "normal", "large"] = "normal"


class Picture(Static):
    """A picture from the panel's folder of pictures; its `label` says what it shows."""

    kind: Literal["image"]
    src: PictureName

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from picture_faults(f"{place}.src", self.src, checking.pictures)


class PageLink(Static):
    """A key that opens another page of the panel."""

    on_phone: ClassVar[bool] = False  # its tabs open pages

    kind: Literal["link"]
    page: Id
    icon: Icon | None = None

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.page not in checking.pages:
            message = no_such("page", self.page, checking.pages)
            yield Fault(f"{place}.page", message, cause=f"page {self.page}")


# A check list of interlocks and conditions.


def name_faults(place: str, name: str, checking: CheckContext) -> Iterator[Fault]:
    """A fault of an id that is of no condition."""
    if name not in checking.conditions:
        message = no_such("interlock or condition", name, checking.conditions)
        yield Fault(place, message, cause=f"interlock {name}")


def picture_faults(place: str, name: str | None, pictures: Collection[str]) -> Iterator[Fault]:
    """A fault of the name of a picture that is not there."""
    if name is not None and name not in pictures:
        message = no_such("picture", name, pictures, " in the folder `pictures`")
        yield Fault(place, message, cause=f"picture {name}")


class Conditions(DisplayWidget):
    """Shows interlocks and conditions, those that are not met first; at most `rows_shown` of them."""

    kind: Literal["conditions"]
    conditions: Interlocks
    rows_shown: Annotated[int, Field(ge=1, le=20)] = 4
    span: Span = 6

    @property
    def rows_at_most(self) -> int:
        return min(self.rows_shown, len(self.conditions))

    @property
    def named_conditions(self) -> tuple[str, ...]:
        return self.conditions

    def sources(self) -> Iterator[TopicSource]:
        yield from ()  # the panel listens to its conditions

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        for name in self.conditions:
            yield from name_faults(f"{place}.conditions", name, checking)
