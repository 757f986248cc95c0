"""The description of a ROS 2 parameter of a node, shown and set, and what can be wrong in it."""

from collections.abc import Iterable, Iterator, Mapping
from math import isfinite
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import AfterValidator, Field

from app.dialect.endpoint import Role
from app.errors import Fault
from app.i18n import Text, TextLike, render, say
from app.interfaces import INTEGERS, Interfaces
from app.interfaces.names import TOPIC
from app.interfaces.validation import shown
from app.panel.base import SaidLabel, Seconds, Span, said
from app.panel.list_text import listed, quoted
from app.panel.number_range import Range, decimal
from app.panel.values import digits, same
from app.panel.widgets.families import Checking, Entered, Pressed, Sent
from app.panel.widgets.inputs import SWITCHED, Option, option_faults
from app.panel.widgets.numbers import DECIMAL, Number, Stepped, Unit

One = bool | int | float | str
Value = One | tuple[One, ...]

EVENTS: Final = "/parameter_events"
EVENT_TYPE: Final = "rcl_interfaces/msg/ParameterEvent"

# The services of a node that a parameter needs, with their types.
GET: Final = ("get_parameters", "rcl_interfaces/srv/GetParameters")
DESCRIBE: Final = ("describe_parameters", "rcl_interfaces/srv/DescribeParameters")
SET: Final = ("set_parameters", "rcl_interfaces/srv/SetParameters")

LONGEST_TEXT: Final = 1000  # characters that can be set
KINDS: Final[Mapping[str, str]] = {
    "bool": "true or false",
    "integer": "a whole number (int64)",
    "double": "a number",
    "string": f"text of {LONGEST_TEXT} characters at most",
}


def _node(given: str) -> str:
    if not TOPIC.fullmatch(given) or "__" in given:
        raise ValueError(
            f"{shown(given)} is not the absolute name of a ROS 2 node: it must be like /cell1/arm"
        )
    return given


class Parameter(Stepped, Entered, Pressed):
    """A parameter of a node; `min`, `max` and `step` narrow what the node describes.

    It is its own input: a press sets the value that comes under the widget's id.
    """

    kind: Literal["parameter"]
    node: Annotated[str, AfterValidator(_node), Field(max_length=200)]
    parameter: Annotated[str, Field(pattern=r"^[^\s\x00-\x1f]+$", max_length=255)]
    type: Literal["bool", "integer", "double", "string", "bool[]", "integer[]", "double[]", "string[]"]
    unit: Unit = ""
    options: Annotated[tuple[Option, ...], Field(strict=False)] = ()
    min: Number | None = None
    max: Number | None = None
    step: Annotated[Number, Field(gt=0)] | None = None
    on: SaidLabel = said("on")
    off: SaidLabel = said("off")
    timeout_s: Seconds = 5.0
    span: Span = 6

    own_types: ClassVar[tuple[str, ...]] = (
        EVENT_TYPE,
        *(f"{name}_Request" for _, name in (GET, DESCRIBE, SET)),
    )

    @property
    def many(self) -> bool:
        """Whether it is a list."""
        return self.type.endswith("[]")

    @property
    def element(self) -> str:
        """The type of one value."""
        return self.type.removesuffix("[]")

    @property
    def counts(self) -> bool:
        """Whether it is a number, or a list of them."""
        return self.element in ("integer", "double")

    @property
    def numeric(self) -> bool:
        """Whether it is entered as a number."""
        return self.counts and not self.many and not self.options

    @property
    def template(self) -> dict[str, Any]:
        return {"value": f"{{{self.id}}}"}

    def sent(self, interfaces: Interfaces) -> Iterator[Sent]:
        yield Sent(f'sets {self.parameter} of {self.node} ({self.type}) to "{{{self.id}}}"')

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        for name, _ in (GET, DESCRIBE, SET):
            yield "SS", f"{self.node}/{name}"

    def typed(self, text: str) -> Any:
        if self.options or self.many:
            return text
        match self.type:
            case "bool":
                return SWITCHED.get(text, text)
            case "double":
                return float(text) if DECIMAL.fullmatch(text) else text
        return text

    def faults(self, place: str, checking: Checking) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        keys = ("min", "max", "step")
        given = {key: getattr(self, key) for key in keys if getattr(self, key) is not None}
        if not self.counts:
            for key in (*given, *(["unit"] if self.unit else [])):
                what = f'is for numbers; the type is "{self.type}"'
                yield Fault(f"{place}.{key}", what, cause=f"number {place}")
        if self.options:
            yield from _options(place, self)
            for key in given if self.counts else ():
                what = "is for what is entered: with options one of them is chosen"
                yield Fault(f"{place}.{key}", what, cause=f"number {place}")
        elif self.counts:
            yield from _limits(place, self, given)

    @property
    def press(self) -> Text:
        """What the button is called where its place does not tell what it sets."""
        return say("set_named", label=self.label)

    @property
    def again(self) -> Text:
        """What the button is called that asks its node once more."""
        return say("read_named", label=self.label)

    def option(self, value: Any) -> Option | None:
        """The option that has this value."""
        value = list(value) if isinstance(value, tuple) else value
        return next((one for one in self.options if same(one.value, value)), None)

    def written(self, value: Value) -> TextLike:
        """A value as an operator reads it, exactly."""
        option = self.option(value)
        return self.unchosen(value) if option is None else option.label

    def unchosen(self, value: Value) -> TextLike:
        """The same of a value that is no option's."""
        if value == ():
            return say("empty")
        if isinstance(value, bool):
            return self.on if value else self.off
        text = self.entered(value)
        return f"{text} {self.unit}" if self.unit else text

    def entered(self, value: Value) -> str:
        """A value as it is entered where no option is chosen. True and false are entered in lists only:
        as the panel file calls them, or in English."""
        if isinstance(value, tuple):
            return listed(quoted(one) if isinstance(one, str) else self._one(one) for one in value)
        return self._one(value)

    def _one(self, value: bool | float | str) -> str:
        if isinstance(value, bool):
            return render(self.on if value else self.off)
        return decimal(value) if isinstance(value, float) else f"{value}"


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


def type_faults(parameters: Iterable[tuple[str, Parameter]]) -> Iterator[Fault]:
    """A parameter has one type, wherever the panel names it; each comes with its place."""
    firsts: dict[tuple[str, str], str] = {}
    for place, widget in parameters:
        first = firsts.setdefault((widget.node, widget.parameter), widget.type)
        if first != widget.type:
            what = f"{widget.parameter} of {widget.node} is {widget.type} here but {first} above"
            cause = f"parameter {widget.node} {widget.parameter}"
            yield Fault(f"{place}.type", what, cause=cause)
