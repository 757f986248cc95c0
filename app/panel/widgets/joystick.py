"""Two axes that a finger holds."""

from collections.abc import Iterator, Mapping
from typing import Annotated, Any, Final, Literal

from pydantic import Field

from app.errors import Fault
from app.panel.base import Description
from app.panel.values import number_text
from app.panel.widgets.families import CheckContext
from app.panel.widgets.hold import HoldCommand
from app.panel.widgets.numbers import Unit

TWIST: Final[Mapping[str, Any]] = {"linear": {"x": "{y}"}, "angular": {"z": "{x}"}}
TWISTS: Final = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")


class Axis(Description):
    """`max` is the value at full deflection; a negative one turns the axis around."""

    max: Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)] = 1.0
    unit: Unit = ""


class SideAxis(Axis):
    """The axis to the right. As ROS counts turns, its value is negative there."""

    max: Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)] = -1.0


class Joystick(HoldCommand):
    """Publishes `message` with the values of its axes while it is held, and the same with zeros after.

    In the messages `{x}` is the axis to the right and `{y}` that to the front. A Twist needs no
    message: y drives and x turns, to the left where it is positive (REP 103).
    """

    kind: Literal["joystick"]
    message: dict[str, Any] = Field(default_factory=dict)
    release: dict[str, Any] = Field(default_factory=dict)
    x_axis: SideAxis = SideAxis()
    y_axis: Axis = Axis()
    shape: Literal["circle", "square"] = "circle"
    dead_zone: Annotated[float, Field(ge=0, le=0.9)] = 0.1
    ramp_s: Annotated[float, Field(ge=0, le=10)] = 0.0
    frame_id: Annotated[str, Field(max_length=100)] = "base_link"
    rows: Annotated[int, Field(ge=1, le=8)] = 3

    @property
    def template(self) -> Mapping[str, Any]:
        """The message with `{x}` and `{y}`."""
        if self.message or self.type not in TWISTS:
            return self.message
        if self.type == TWISTS[0]:
            return TWIST
        return {"header": {"stamp": "{now}", "frame_id": self.frame_id}, "twist": TWIST}

    def moving(self, x: float, y: float) -> Mapping[str, Any]:
        fields: Mapping[str, Any] = _with_axes(self.template, x, y)
        return fields

    def stopping(self) -> Mapping[str, Any]:
        return self.release or self.moving(0.0, 0.0)

    def axes_at(self, x: float, y: float) -> tuple[float, float]:
        # Zero has no sign.
        return x * self.x_axis.max + 0.0, y * self.y_axis.max + 0.0

    def texts_at(self, x: float, y: float) -> dict[str, str]:
        values = zip("xy", self.axes_at(x, y), (self.x_axis.unit, self.y_axis.unit), strict=True)
        return {axis: f"{value:.2f} {unit}".strip().replace("-", "−") for axis, value, unit in values}

    @property
    def previewed(self) -> Mapping[str, Any]:
        return self.template

    @property
    def own_comments(self) -> Mapping[str, str]:
        axes = (("x", "to the right", self.x_axis), ("y", "to the front", self.y_axis))
        return {name: f"{number_text(axis.max)} when {where}" for name, where, axis in axes}

    @property
    def checked(self) -> Iterator[tuple[str, Mapping[str, Any]]]:
        yield "message", self.moving(float(self.x_axis.max), float(self.y_axis.max))
        if self.release:  # else the same message
            yield "release", self.release

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        for name, axis in (("x", self.x_axis), ("y", self.y_axis)):
            if axis.max == 0:
                yield Fault(f"{place}.{name}_axis.max", "is 0: the axis would do nothing")
            if name in checking.all_inputs:
                message = f'"{name}" is the id of an input: in this message {{{name}}} is the axis'
                yield Fault(f"{place}.{name}_axis", message)
        if not self.template:
            message = f'is missing: a message of {self.type} names its axes, as in {{ x = "{{x}}" }}'
            yield Fault(f"{place}.message", message)
            return
        yield from super().faults(place, checking)


def _with_axes(template: Any, x: float, y: float) -> Any:
    """The template with the values of the axes in place of `{x}` and `{y}`."""
    if isinstance(template, Mapping):
        return {key: _with_axes(value, x, y) for key, value in template.items()}
    if isinstance(template, list | tuple):
        return [_with_axes(item, x, y) for item in template]
    return {"{x}": x, "{y}": y}.get(template, template) if isinstance(template, str) else template
