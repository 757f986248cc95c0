"""The description of a ROS 2 parameter of a node, shown and set."""

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from app.i18n import say
from app.interfaces.names import TOPIC
from app.interfaces.validation import shown
from app.panel.base import Interlocks, Label, Seconds, Span, said
from app.panel.list_text import listed, quoted
from app.panel.number_range import decimal
from app.panel.widgets.inputs import Number, Option, Stepped, Unit, same

One = bool | int | float | str
Value = One | tuple[One, ...]

EVENTS: Final = "/parameter_events"
EVENT_TYPE: Final = "rcl_interfaces/msg/ParameterEvent"

# The services of a node that a parameter needs, with their types.
GET: Final = ("get_parameters", "rcl_interfaces/srv/GetParameters")
DESCRIBE: Final = ("describe_parameters", "rcl_interfaces/srv/DescribeParameters")
SET: Final = ("set_parameters", "rcl_interfaces/srv/SetParameters")


def _node(given: str) -> str:
    if not TOPIC.fullmatch(given) or "__" in given:
        raise ValueError(
            f"{shown(given)} is not the absolute name of a ROS 2 node: it must be like /cell1/arm"
        )
    return given


class Parameter(Stepped):
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
    on: Label = said("on")
    off: Label = said("off")
    interlocks: Interlocks = Field(default=(), alias="interlock")
    timeout_s: Seconds = 5.0
    confirm_press: bool = False
    span: Span = 6

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

    @property
    def press(self) -> str:
        """What the button is called where its place does not tell what it sets."""
        return say("set_named", label=self.label)

    @property
    def again(self) -> str:
        """What the button is called that asks its node once more."""
        return say("read_named", label=self.label)

    def option(self, value: Any) -> Option | None:
        """The option that has this value."""
        value = list(value) if isinstance(value, tuple) else value
        return next((one for one in self.options if same(one.value, value)), None)

    def written(self, value: Value) -> str:
        """A value as an operator reads it, exactly."""
        option = self.option(value)
        return self.unchosen(value) if option is None else option.label

    def unchosen(self, value: Value) -> str:
        """The same of a value that is no option's."""
        text = self.entered(value)
        if value == ():
            return say("empty")
        return f"{text} {self.unit}" if self.unit else text

    def entered(self, value: Value) -> str:
        """A value as it is entered where no option is chosen."""
        if isinstance(value, tuple):
            return listed(quoted(one) if isinstance(one, str) else self._one(one) for one in value)
        return self._one(value)

    def _one(self, value: bool | float | str) -> str:
        if isinstance(value, bool):
            return self.on if value else self.off
        return decimal(value) if isinstance(value, float) else f"{value}"
