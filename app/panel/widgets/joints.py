"""Bars of a robot's joints, found by their names in each message."""

from collections.abc import Iterator
from itertools import pairwise
from math import degrees
from typing import Annotated, Final, Literal, NamedTuple

from pydantic import AfterValidator, Field

from app.panel.base import Description, Label, MessageField, Span, TopicName, Type, non_empty
from app.panel.checks.types import field_faults
from app.panel.numbers import NUMBERS
from app.panel.shared_keys import AgeKey, NumberFormat, number_key_faults
from app.panel.values import number_text
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource, TopicWidget
from app.panel.widgets.numbers import Number
from app.ros.messages import STRING_TYPES, Interfaces
from app.system.errors import Fault
from app.system.texts import TextLike, number

MAX_JOINTS: Final = 24


class JointUnit(NamedTuple):
    """How a number of ROS (radians, metres) is shown: times `factor`, with `text` behind it."""

    factor: float
    text: str


UNITS: Final = {
    "deg": JointUnit(degrees(1), "°"),
    "rad": JointUnit(1.0, "rad"),
    "mm": JointUnit(1000.0, "mm"),
    "m": JointUnit(1.0, "m"),
    "deg/s": JointUnit(degrees(1), "°/s"),
    "rad/s": JointUnit(1.0, "rad/s"),
    "mm/s": JointUnit(1000.0, "mm/s"),
    "m/s": JointUnit(1.0, "m/s"),
    "Nm": JointUnit(1.0, "Nm"),
    "N": JointUnit(1.0, "N"),
    "%": JointUnit(1.0, "%"),
}
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^\x00-\x1f]+$")]
ListName = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*$", max_length=100)]


class Joint(Description):
    """One joint: its mechanical range and its soft limits, in its unit."""

    name: Name
    label: Label | None = None
    unit: Literal["deg", "rad", "mm", "m", "deg/s", "rad/s", "mm/s", "m/s", "Nm", "N", "%"] = "deg"
    min: Number
    max: Number
    low: Number | None = None
    high: Number | None = None
    near: Annotated[Number, Field(ge=0)] = 0.0

    @property
    def shown_unit(self) -> JointUnit:
        return UNITS[self.unit]

    @property
    def shown_label(self) -> TextLike:
        """Its label, or the robot's own name for it."""
        return self.name if self.label is None else self.label

    @property
    def ends(self) -> tuple[TextLike, TextLike]:
        """The ends of the range, as they are written beside the bar."""
        return number(number_text(self.min)), number(number_text(self.max))

    @property
    def zero(self) -> float:
        """Where bars begin, in percent of the range: at zero, or at the end that is nearer to it."""
        return self.percent(0.0)

    @property
    def hatched(self) -> list[tuple[float, float]]:
        """(begin, width), in percent of the range, of what is beyond the soft limits."""
        below = [(0.0, self.percent(self.low))] if self.low is not None else []
        above = (
            [(self.percent(self.high), round(100 - self.percent(self.high), 1))]
            if self.high is not None
            else []
        )
        return [*below, *above]

    def percent(self, value: float) -> float:
        """Where a number is in the range; one beyond it is at its end."""
        part = (value - self.min) / (self.max - self.min)
        return round(100 * min(max(part, 0.0), 1.0), 1)


class Joints(AgeKey, TopicWidget, DisplayWidget):
    """Shows the elements of a list of numbers (`field`) that have the names of joints in the list
    `names` beside it."""

    kind: Literal["joints"]
    topic: TopicName = "/joint_states"
    type: Type = "sensor_msgs/msg/JointState"
    field: MessageField = "position"
    names: ListName = "name"
    joints: Annotated[
        tuple[Joint, ...],
        Field(strict=False, alias="joint", max_length=MAX_JOINTS),
        AfterValidator(non_empty),
    ]
    format: NumberFormat = "+.1f"
    span: Span = 6

    def path(self, joint: Joint) -> str:
        """The path of a joint's number."""
        quoted = joint.name.replace("'", "''")
        return f"{self.field}[{self.names}='{quoted}']"

    def sources(self) -> Iterator[TopicSource]:
        paths = tuple(self.path(joint) for joint in self.joints)
        yield TopicSource(self.topic, self.type, self.qos, paths)

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        faults = list(self._list_faults(place, checking.interfaces))
        yield from faults
        for j, joint in enumerate(self.joints):
            at = f"{place}.joint[{j}]"
            first = next(i for i, other in enumerate(self.joints) if other.name == joint.name)
            if first != j:
                yield Fault(f"{at}.name", f'"{joint.name}" is already the name of joint[{first}]')
            yield from _limit_faults(at, joint)

    def _list_faults(self, place: str, interfaces: Interfaces) -> Iterator[Fault]:
        faults = list(field_faults(place, self.type, self.field, interfaces))
        yield from faults
        if faults:
            return
        numbers = interfaces.type_at(self.type, self.field)
        if numbers.container == "one" or numbers.name not in NUMBERS:
            yield Fault(f"{place}.field", f'"{self.field}" is {numbers}: joints are a list of numbers')
            return
        yield from number_key_faults(place, self, self.field, "float64")  # in radians or metres
        around, dot, _ = self.field.rpartition(".")
        named = list(field_faults(place, self.type, f"{around}{dot}{self.names}", interfaces))
        yield from (Fault(f"{place}.names", fault.message) for fault in named)
        if not named:
            names = interfaces.type_at(self.type, f"{around}{dot}{self.names}")
            if names.container == "one" or names.name not in STRING_TYPES:
                message = f'"{self.names}" is {names}: names are a list of texts'
                yield Fault(f"{place}.names", message)


def _limit_faults(place: str, joint: Joint) -> Iterator[Fault]:
    """The first fault of a joint's limits."""
    limits = (("min", joint.min), ("low", joint.low), ("high", joint.high), ("max", joint.max))
    ordered = [(key, value) for key, value in limits if value is not None]
    for (key, value), (above, next_value) in pairwise(ordered):
        touching = (key, above) in (("min", "low"), ("high", "max"))
        if value > next_value or (value == next_value and not touching):
            message = f"{number_text(next_value)} must be more than {key} ({number_text(value)})"
            yield Fault(f"{place}.{above}", message)
            return
