"""The description of a ROS 2 parameter of a node, shown and set."""

from typing import Annotated, Any, Final, Literal

from pydantic import AfterValidator, Field

from app.interfaces.scalars import shown
from app.keys import TOPIC
from app.panel.description import Interlocks, Label, Seconds, Span
from app.panel.inputs import Number, Stepped, Unit
from app.panel.ranges import decimal
from app.sentences import say

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
    type: Literal["bool", "integer", "double", "string"]
    unit: Unit = ""
    min: Number | None = None
    max: Number | None = None
    step: Annotated[Number, Field(gt=0)] | None = None
    on: Label = say("on")
    off: Label = say("off")
    interlocks: Interlocks = Field(default=(), alias="interlock")
    timeout_s: Seconds = 5.0
    confirm_press: bool = False
    span: Span = 6

    @property
    def numeric(self) -> bool:
        return self.type in ("integer", "double")

    @property
    def template(self) -> dict[str, Any]:
        return {"value": f"{{{self.id}}}"}

    @property
    def press(self) -> str:
        """What the button is called where its place does not tell what it sets."""
        return say("set_named", label=self.label)

    def written(self, value: bool | float | str) -> str:
        """A value as an operator reads it, exactly."""
        if isinstance(value, bool):
            return self.on if value else self.off
        if isinstance(value, float):
            value = decimal(value)
        return f"{value} {self.unit}" if self.unit else f"{value}"
