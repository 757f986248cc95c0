"""An input whose value is a place or a pose on a map."""

import json
import math
import re
from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Literal, NamedTuple

from pydantic import AfterValidator, Field

from app.panel.base import Id, Rows, SaidLabel, Span, catalogue_default, distinct
from app.panel.shared_keys import NeedsKey
from app.panel.widgets.families import DisplayWidget, Input, TopicSource
from app.ros.messages.validation import format_value
from app.system.errors import InputError
from app.system.texts import say

NUMBER: Final = r"-?[0-9]{1,7}(?:\.[0-9]{1,4})?"
POSE: Final = re.compile(rf"x=({NUMBER}) y=({NUMBER}) yaw=({NUMBER}) map=([0-9a-f]{{16}})")
PARTS: Final = ("x", "y", "yaw", "orientation", "pose", "frame", "label")


class MapPose(NamedTuple):
    """A pose that was touched on a map: metres, and radians. `version` is that of the map which the
    screen showed."""

    x: float
    y: float
    yaw: float
    version: str


def read_pose(text: str) -> MapPose | None:
    """The pose of a text such as `x=12.40 y=6.85 yaw=0.00 map=0123456789abcdef`; None for another
    text."""
    parts = POSE.fullmatch(text)
    if parts is None:
        return None
    x, y, yaw = (float(number) for number in parts.groups()[:3])
    return MapPose(x, y, math.remainder(yaw, math.tau), parts[4])


def message_parts(x: float, y: float, yaw: float, frame: str, label: str) -> dict[str, Any]:
    """The parts of a pose that messages may name, such as `{goal.x}`: `orientation` is a
    `geometry_msgs/msg/Quaternion`, `pose` a `geometry_msgs/msg/Pose`."""
    orientation = {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}
    position = {"x": x, "y": y, "z": 0.0}
    pose = {"position": position, "orientation": orientation}
    values = (x, y, yaw, orientation, pose, frame, label)
    return dict(zip(PARTS, values, strict=True))


class MapInput(DisplayWidget, Input):
    """An input whose value is on the map with this id. `radius` (metres) is how much floor must be free
    around each pose, by default the map's. Without `require_pose` it may be sent while it is not known
    where the robot is."""

    map: Id
    places: Annotated[tuple[Id, ...], Field(strict=False)] | None = None
    radius: Annotated[float, Field(gt=0, le=10)] | None = None
    require_pose: bool = True

    def sources(self) -> Iterator[TopicSource]:
        """None: its map listens to them."""
        yield from ()


class PlaceInput(NeedsKey, MapInput):
    """A place of the panel file or, with `touch`, a pose that is touched on the map. With `save`
    operators save places of their own; `needs` is what that needs beside its role."""

    parts: ClassVar[tuple[str, ...]] = PARTS

    kind: Literal["place"]
    touch: bool = False
    save: bool = False
    places: Annotated[tuple[Id, ...], Field(strict=False), AfterValidator(distinct)] | None = None
    question: SaidLabel = catalogue_default("place_question")
    span: Span = 4
    rows: Rows = 4

    @property
    def value_description(self) -> str:
        return "a place"

    @property
    def comment(self) -> str:
        touched = " or a touched pose" if self.touch else ""
        return f"a place{touched} on the map {format_value(self.map)}"

    def examples(self) -> list[Any]:
        return ["x=1.50 y=-2.25 yaw=1.57 map=0123456789abcdef"]

    def check_value(self, value: Any) -> str:
        """The id of a place, or the text of a pose; whether it may be sent is judged by the map."""
        if isinstance(value, str) and value and len(value) <= MAX_TEXT:
            return value
        raise InputError(say("input_not_chosen", label=self.label))

    def sent_value(self, value: Any) -> Any:
        """The parts of a touched pose, as an example: a press gets them with the map's frame."""
        pose = read_pose(str(value))
        return message_parts(*(pose or (0.0, 0.0, 0.0))[:3], "map", json.dumps(value))


MAX_TEXT: Final = 120
