"""Hold-to-run commands, by a button or a joystick, with the fields that the server fills in."""

import re
from abc import abstractmethod
from collections.abc import Iterator, Mapping
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from app.panel.base import Description, Interlocks, Rows, Span, WrittenField
from app.panel.checks.templates import template_faults
from app.panel.checks.types import type_fault
from app.panel.shared_keys import Unit
from app.panel.template import set_field
from app.panel.values import number_text
from app.panel.widgets.families import CheckContext, KeyCommand, PublishCommand, SentMessage
from app.panel.widgets.key_parts import ConfirmationKeys, KeyRole
from app.ros.messages import Interfaces
from app.system.errors import Fault, FieldError, InterfaceError

# Hold-to-run commands, with the fields that the server fills in.

DEADLINE_TYPES: Final = (r"uint(16|32|64)|float(32|64)", "uint16, uint32, uint64, float32 or float64")
COUNTER_TYPES: Final = (r"uint(8|16|32|64)", "uint8, uint16, uint32 or uint64")


class HoldCommand(ConfirmationKeys, KeyCommand, PublishCommand):
    """Publishes a message `rate_hz` times a second while its key is held, and another one once after.

    `deadline_field` gets the milliseconds within which the next message arrives, 0 in the last one;
    `counter_field` counts the messages.
    """

    role: KeyRole = "hold"
    interlocks: Interlocks = Field(alias="interlock")
    rate_hz: Annotated[float, Field(ge=1, le=100)] = 20.0
    deadline_field: WrittenField | None = None
    counter_field: WrittenField | None = None
    span: Span = 4

    why_needed: ClassVar[Mapping[str, str]] = {
        "interlock": "a hold needs the interlock whose loss ends it",
        "release": "a hold needs the message that is published when it ends",
    }

    @property
    def period_s(self) -> float:
        return 1 / self.rate_hz

    @property
    def deadline_ms(self) -> int:
        """Three periods, at least 100 ms: two messages may be late or lost before the robot stops."""
        return max(100, round(3000 / self.rate_hz))

    @abstractmethod
    def moving(self, x: float, y: float) -> Mapping[str, Any]:
        """The template of the message while it is held; `x` and `y` are the values of a joystick's
        axes, 0 of a key."""

    @abstractmethod
    def stopping(self) -> Mapping[str, Any]:
        """The template of the message when it ends."""

    def axes_at(self, x: float, y: float) -> tuple[float, float]:
        """The values of the axes at a deflection from -1 to 1: 0 of a key, which has none."""
        return 0.0, 0.0

    def texts_at(self, x: float, y: float) -> dict[str, str]:
        """The same by axis, as an operator reads them; empty of a key."""
        return {}

    @property
    def previewed(self) -> Mapping[str, Any]:
        """The template of the message while it is held, as a preview shows it."""
        return self.moving(0.0, 0.0)

    @property
    def own_comments(self) -> Mapping[str, str]:
        """Further comments of a preview."""
        return {}

    @property
    def checked_templates(self) -> Iterator[tuple[str, Mapping[str, Any]]]:
        """(key, template) of all that is checked, at its limits."""
        yield "message", self.moving(0.0, 0.0)
        yield "release", self.stopping()

    def templates(self) -> list[Any]:
        return [self.moving(0.0, 0.0), self.stopping()]

    def sent_messages(self, interfaces: Interfaces) -> Iterator[SentMessage]:
        own = {
            f".{self.deadline_field}": "ms within which the next one comes",
            f".{self.counter_field}": "counts the messages",
        }
        often = f"{number_text(self.rate_hz)} times a second while it is held"
        first = fill_own_fields(self, self.previewed, self.deadline_ms, 1)
        when = f"publishes {self.topic} ({self.type}) {often}"
        yield SentMessage(when, self.type, first, {**own, **self.own_comments})
        last = fill_own_fields(self, self.stopping(), 0, 1)
        yield SentMessage("and once when it ends", self.type, last, own)

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        if self.asks:
            message = 'asks nothing of a hold, which ends with the finger: "pin" or "two_persons" do'
            yield Fault(f"{place}.confirm_press", message)
        try:
            checking.interfaces.require(self.type)
        except InterfaceError as error:
            yield type_fault(f"{place}.type", error)
            return
        fields = list(_own_field_faults(place, self, checking.interfaces))
        yield from fields or self._message_faults(place, checking)

    def _message_faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        for part, template in self.checked_templates:
            try:
                whole = fill_own_fields(self, template, 0, 0)
            except FieldError as error:
                yield Fault(f"{place}.{part}.{error.field}", error.message)
                continue
            yield from template_faults(f"{place}.{part}", whole, self.type, checking)


class Hold(HoldCommand):
    """Publishes `message` while its button is held, and `release` once after."""

    kind: Literal["hold"]
    message: dict[str, Any]
    release: dict[str, Any]

    def moving(self, x: float, y: float) -> Mapping[str, Any]:
        return self.message

    def stopping(self) -> Mapping[str, Any]:
        return self.release


def fill_own_fields(hold: HoldCommand, fields: Mapping[str, Any], deadline_ms: int, count: int) -> Any:
    """The fields of a message with its deadline and its number, if the hold has fields for them."""
    whole: Any = fields
    if hold.deadline_field is not None:
        whole = set_field(whole, hold.deadline_field, deadline_ms)
    if hold.counter_field is not None:
        whole = set_field(whole, hold.counter_field, count)
    return whole


def _own_field_faults(place: str, hold: HoldCommand, interfaces: Interfaces) -> Iterator[Fault]:
    own = (
        ("deadline_field", hold.deadline_field, DEADLINE_TYPES),
        ("counter_field", hold.counter_field, COUNTER_TYPES),
    )
    for key, path, (kinds, words) in own:
        if path is None:
            continue
        try:
            field_type = interfaces.field_type(hold.type, path)
        except InterfaceError as error:
            yield Fault(f"{place}.{key}", str(error))
            continue
        if not re.fullmatch(kinds, field_type):
            yield Fault(f"{place}.{key}", f'"{path}" is {field_type}: it must be {words}')
            continue
        for part, template in hold.checked_templates:
            if _has_field(template, path):
                message = f"is filled in by the panel server: it is the {key}"
                yield Fault(f"{place}.{part}.{path}", message, cause=f"own {place} {key}")
    if hold.counter_field is not None and hold.counter_field == hold.deadline_field:
        yield Fault(f"{place}.counter_field", f'"{hold.counter_field}" is the deadline_field already')


def _has_field(template: Mapping[str, Any], path: str) -> bool:
    """Whether a template sets the field. A list must have all its elements in any case."""
    inner: Any = template
    for step in path.split("."):
        if "[" in step or not isinstance(inner, Mapping) or step not in inner:
            return False
        inner = inner[step]
    return True


# Two axes that a finger holds.

TWIST: Final[Mapping[str, Any]] = {"linear": {"x": "{y}"}, "angular": {"z": "{x}"}}
TWISTS: Final = ("geometry_msgs/msg/Twist", "geometry_msgs/msg/TwistStamped")


Deflection = Annotated[float, Field(ge=-1e6, le=1e6, allow_inf_nan=False)]


class Axis(Description):
    """`max` is the value at full deflection; a negative one turns the axis around."""

    max: Deflection = 1.0
    unit: Unit = ""


class SideAxis(Axis):
    """The axis to the right. As ROS counts turns, its value is negative there."""

    max: Deflection = -1.0


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
    gamepad: Literal["left", "right"] | None = None
    rows: Rows = 3

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
    def checked_templates(self) -> Iterator[tuple[str, Mapping[str, Any]]]:
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
