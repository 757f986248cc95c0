"""The description of a ROS 2 parameter that is shown and set, and its checks."""

from collections.abc import Iterable, Iterator, Mapping
from math import isfinite
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from app.panel.base import (
    NodeName,
    ParameterName,
    SaidLabel,
    Seconds,
    Span,
    TopicQos,
    catalogue_default,
)
from app.panel.numbers import Range, decimal_text, step_fault
from app.panel.shared_keys import Unit
from app.panel.values import join_list, number_text, quote_element, same_value
from app.panel.widgets.families import CheckContext, EntryWidget, PressCommand, SentMessage
from app.panel.widgets.inputs import BOOL_TEXTS, Option, SelectInput, option_faults
from app.panel.widgets.numbers import Number, SteppedWidget
from app.ros.dialects.dialect import Role
from app.ros.messages import INTEGER_RANGES, Interfaces
from app.ros.messages.names import PARAMETER_EVENTS
from app.ros.messages.validation import format_value
from app.system.errors import Fault
from app.system.texts import PanelText, Text, TextLike, number, say
from app.system.texts.locales import clear_text, is_unclear, read_number, read_numbers
from app.system.texts.text import numbers, with_unit

Scalar = bool | int | float | str
Value = Scalar | tuple[Scalar, ...]

EVENTS: Final = PARAMETER_EVENTS
EVENT_TYPE: Final = "rcl_interfaces/msg/ParameterEvent"
# rmw_qos_profile_parameter_events, with a durability: the subscription waits for no publisher.
EVENTS_QOS: Final = TopicQos(durability="volatile", depth=1000)

# The node's parameter services that are used, with their types.
GET: Final = ("get_parameters", "rcl_interfaces/srv/GetParameters")
DESCRIBE: Final = ("describe_parameters", "rcl_interfaces/srv/DescribeParameters")
SET: Final = ("set_parameters", "rcl_interfaces/srv/SetParameters")
SERVICES: Final = (GET, DESCRIBE, SET)
# All or none of several values; a node may lack it.
SET_ATOMICALLY: Final = ("set_parameters_atomically", "rcl_interfaces/srv/SetParametersAtomically")

MAX_TEXT: Final = 1000  # characters that can be set
TYPE_TEXTS: Final[Mapping[str, str]] = {
    "bool": "true or false",
    "integer": "a whole number (int64)",
    "double": "a number",
    "string": f"text of {MAX_TEXT} characters at most",
}


class Parameter(SteppedWidget, EntryWidget, PressCommand):
    """A parameter of a node; `min`, `max` and `step` narrow the range that the node describes.

    It is an input too: a press sets the value that it has under the widget's id.
    """

    on_phone: ClassVar[bool] = True
    kind: Literal["parameter"]
    node: NodeName
    parameter: ParameterName
    type: Literal["bool", "integer", "double", "string", "bool[]", "integer[]", "double[]", "string[]"]
    unit: Unit = ""
    options: Annotated[tuple[Option, ...], Field(strict=False)] = ()
    min: Number | None = None
    max: Number | None = None
    step: Annotated[Number, Field(gt=0)] | None = None
    on: SaidLabel = catalogue_default("on")
    off: SaidLabel = catalogue_default("off")
    timeout_s: Seconds = 5.0
    span: Span = 6

    required_types: ClassVar[tuple[str, ...]] = (
        EVENT_TYPE,
        *(f"{name}_Request" for _, name in SERVICES),
    )

    @property
    def is_list(self) -> bool:
        """Whether it is a list."""
        return self.type.endswith("[]")

    @property
    def element_type(self) -> str:
        """The type of one value."""
        return self.type.removesuffix("[]")

    @property
    def has_numbers(self) -> bool:
        """Whether it is a number, or a list of them."""
        return self.element_type in ("integer", "double")

    @property
    def is_number_entry(self) -> bool:
        """Whether it is entered as a number."""
        return self.has_numbers and not self.is_list and not self.options

    @property
    def is_number_list(self) -> bool:
        """Whether it is entered as a list of numbers."""
        return self.has_numbers and self.is_list and not self.options

    @property
    def is_whole(self) -> bool:
        return self.element_type == "integer"

    @property
    def template(self) -> dict[str, Any]:
        return {"value": f"{{{self.id}}}"}

    def sent_messages(self, interfaces: Interfaces) -> Iterator[SentMessage]:
        yield SentMessage(f'sets {self.parameter} of {self.node} ({self.type}) to "{{{self.id}}}"')

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        for name, _ in SERVICES:
            yield "SS", f"{self.node}/{name}"

    def parse_text(self, text: str, language: str) -> Any:
        if self.is_number_list:
            return read_numbers(text, language, whole=self.is_whole, permits=self._permits)
        if self.is_number_entry:
            value = read_number(text, language, whole=self.is_whole)
            return text.strip() if value is None or is_unclear(text, self._permits) else value
        return BOOL_TEXTS.get(text, text) if self.type == "bool" else text

    def _permits(self, value: float) -> bool:
        """Whether the limits of the panel file permit a number; those of the node may be closer."""
        is_whole = not self.is_whole or float(value).is_integer()
        return is_whole and Range(self.min, self.max, self.step).contains(value)

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        keys = ("min", "max", "step")
        limits = {key: getattr(self, key) for key in keys if getattr(self, key) is not None}
        if not self.has_numbers:
            for key in (*limits, *(["unit"] if self.unit else [])):
                message = f'is for numbers; the type is "{self.type}"'
                yield Fault(f"{place}.{key}", message, cause=f"number {place}")
        if self.options:
            yield from _option_faults(place, self)
            for key in limits if self.has_numbers else ():
                message = "is for what is entered: with options one of them is chosen"
                yield Fault(f"{place}.{key}", message, cause=f"number {place}")
        elif self.has_numbers:
            yield from _limit_faults(place, self, limits)

    @property
    def press_label(self) -> Text:
        """The accessible name of the button that sets the value."""
        return say("parameter_set_label", label=self.label)

    @property
    def read_label(self) -> Text:
        """The accessible name of the button that queries the node again."""
        return say("parameter_read_again_label", label=self.label)

    def find_option(self, value: Any) -> Option | None:
        """The option with this value; None without one."""
        value = list(value) if isinstance(value, tuple) else value
        return next((option for option in self.options if same_value(option.value, value)), None)

    def value_text(self, value: Value) -> TextLike:
        """A value as text for an operator: an option's label, or the exact value with its unit."""
        option = self.find_option(value)
        return self.unlisted_text(value) if option is None else option.label

    def unlisted_text(self, value: Value) -> TextLike:
        """The same for a value that no option has."""
        if value == ():
            return say("empty")
        if isinstance(value, bool):
            return self.on if value else self.off
        return self.entry_text(value, self.unit)  # a list is shown as it is entered

    def entry_text(self, value: Value, unit: str | PanelText = "", *, clear: bool = False) -> TextLike:
        """A value as the text of its entry, and its unit; `clear`: it is read again. True
        and false are entered in lists only: as the panel file calls them, in the panel's language, or
        in English."""
        if not self.has_numbers:
            return with_unit(self._plain_text(value), unit)
        if isinstance(value, tuple):
            texts = map(self.element_text, value)
            return numbers(map(clear_text, texts) if clear else texts, unit)
        text = self.element_text(value)
        return number(clear_text(text) if clear else text, unit)

    def _plain_text(self, value: Value) -> str:
        if not isinstance(value, tuple):
            return self.element_text(value)
        return join_list(
            quote_element(element) if isinstance(element, str) else self.element_text(element)
            for element in value
        )

    def element_text(self, value: bool | float | str) -> str:
        """One value, or one of a list, in Python's notation."""
        if isinstance(value, bool):
            return str(self.on if value else self.off)
        return decimal_text(value) if isinstance(value, float) else f"{value}"


def _option_faults(place: str, parameter: Parameter) -> Iterator[Fault]:
    if parameter.type == "bool":
        yield Fault(f"{place}.options", 'a bool has none: its switch has the words of "on" and "off"')
        return
    yield from option_faults(place, parameter.options)
    for i, option in enumerate(parameter.options):
        value = option.value
        several = value if parameter.is_list and isinstance(value, list) else [value]
        right = parameter.is_list == isinstance(value, list) and all(
            is_valid_value(parameter.element_type, element) for element in several
        )
        if not right:
            message = f"must be {TYPE_TEXTS[parameter.element_type]}, not {format_value(value)}"
            yield Fault(
                f"{place}.options[{i}].value",
                f"a list: each {message}" if parameter.is_list else message,
            )


def is_valid_value(kind: str, value: Any) -> bool:
    """Whether a value of TOML or JSON has the type of a single parameter."""
    match kind:
        case "bool":
            return isinstance(value, bool)
        case "string":
            return isinstance(value, str) and len(value) <= MAX_TEXT
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    low, high = INTEGER_RANGES["int64"]
    return isinstance(value, int) and low <= value <= high if kind == "integer" else isfinite(value)


def _limit_faults(place: str, parameter: Parameter, limits: Mapping[str, float]) -> Iterator[Fault]:
    if parameter.element_type == "integer":
        broken = {key: limit for key, limit in limits.items() if not limit.is_integer()}
        for key, limit in broken.items():
            message = f"{number_text(limit)} must be whole: the type is {parameter.type}"
            yield Fault(f"{place}.{key}", message, cause=f"number {place}")
        if broken:
            return
    if parameter.min is None or parameter.max is None:
        return
    low, high = number_text(parameter.min), number_text(parameter.max)
    if parameter.max <= parameter.min:
        yield Fault(f"{place}.max", f"{high} must be more than min ({low})")
    elif parameter.step is not None and not Range(parameter.min, None, parameter.step).is_on_step(
        parameter.max
    ):
        message = step_fault(parameter.step, parameter.min, parameter.max)
        yield Fault(f"{place}.step", message)


def type_faults(parameters: Iterable[tuple[str, Parameter]]) -> Iterator[Fault]:
    """Faults of a parameter with several types in the panel; `parameters` are (place, widget)."""
    firsts: dict[tuple[str, str], str] = {}
    for place, widget in parameters:
        first = firsts.setdefault((widget.node, widget.parameter), widget.type)
        if first != widget.type:
            message = f"{widget.parameter} of {widget.node} is {widget.type} here but {first} above"
            cause = f"parameter {widget.node} {widget.parameter}"
            yield Fault(f"{place}.type", message, cause=cause)


# The parameter whose texts are the options of a select: it is read as those that widgets show.


def listed_parameter(select: SelectInput) -> Parameter | None:
    """The parameter of a select with `options_from`, under an id that no widget has; None for another
    source."""
    listed = select.options_from.listed if select.options_from is not None else None
    if listed is None:
        return None
    return Parameter.model_construct(
        None,
        id=options_id(select),
        kind="parameter",
        label=select.label,
        node=listed.node,
        parameter=listed.name,
        type="integer" if listed.of_range else "string[]",
    )


def options_id(select: SelectInput) -> str:
    """The id under which the parameter of a select is known."""
    return f"{select.id}.options"
