"""A list of places that one goal leads through, and how far the robot is on it."""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar, Final, Literal

from pydantic import Field

from app.panel.base import Id, Rows, Seconds, Span, TopicName, TopicQos
from app.panel.shared_keys import AgeKey
from app.panel.widgets.families import TopicSource
from app.panel.widgets.place import MapInput, message_parts
from app.ros.messages import Interfaces
from app.ros.messages.validation import format_value
from app.system.errors import InputError
from app.system.texts import say

MAX_STOPS: Final = 100
Stops = Annotated[tuple[Id, ...], Field(strict=False, min_length=1, max_length=MAX_STOPS)]
PATH_TYPE: Final = "nav_msgs/msg/Path"
PARTS: Final = ("poses", "frame", "label")
# Fields of a feedback that say at which pose of a goal the robot is: its index, or how many are left.
INDEX: Final = "current_waypoint"
LEFT: Final = "number_of_poses_remaining"
WAY: Final = "distance_remaining"


def feedback_fields(type_name: str, interfaces: Interfaces) -> tuple[str, ...]:
    """The fields of an action's feedback that say how far it is with its poses; none of an action that
    does not say it."""
    feedback = interfaces.action_types(type_name).feedback
    known = {field.name for field in interfaces.structures[feedback].fields}
    return tuple(name for name in (INDEX, LEFT, WAY) if name in known)


def tour_parts(stops: list[dict[str, Any]], frame: str, label: str) -> dict[str, Any]:
    """The parts of a tour that messages may name: `poses` is a list of
    `geometry_msgs/msg/PoseStamped`, of which the stamp is 0: the newest transform counts. `stops` are
    the parts of its poses, see `message_parts`."""
    poses = [{"header": {"frame_id": frame}, "pose": stop["pose"]} for stop in stops]
    return dict(zip(PARTS, (poses, frame, label), strict=True))


class Tour(AgeKey, MapInput):
    """Places in the order in which one goal leads through them, such as of FollowWaypoints, and where
    the robot is on the way. `action` is the id of the action whose goals it shows, by default of those
    that send it. `topic` has the poses of a goal that another program sent. Feedback older than
    `max_age_s` is shown as old."""

    parts: ClassVar[tuple[str, ...]] = PARTS

    kind: Literal["tour"]
    places: Stops | None = None
    action: Id | None = None
    topic: TopicName | None = None
    qos: TopicQos = TopicQos()
    max_age_s: Seconds = 5.0
    span: Span = 4
    rows: Rows = 4

    def sources(self) -> Iterator[TopicSource]:
        """The poses of other programs' goals; its map listens to the rest."""
        if self.topic is not None:
            yield TopicSource(self.topic, PATH_TYPE, self.qos, ())

    @property
    def value_description(self) -> str:
        return "a tour"

    @property
    def comment(self) -> str:
        stops = ", ".join(self.places or ())
        return f"the tour {stops} on the map {format_value(self.map)}"

    @property
    def default_value(self) -> str | None:
        return " ".join(self.places) if self.places else None

    def examples(self) -> list[Any]:
        return [self.default_value or ""]

    def check_value(self, value: Any) -> str:
        """The ids of its places; a page with another list is of another panel file."""
        if self.places and value == self.default_value:
            return str(value)
        raise InputError(say("tour_other", label=self.label))

    def sent_value(self, value: Any) -> Any:
        """Its parts, as an example: a press gets them with the poses and the map's frame."""
        stops = [message_parts(0.0, 0.0, 0.0, "map", "") for _ in self.places or ()]
        return tour_parts(stops, "map", str(self.label))
