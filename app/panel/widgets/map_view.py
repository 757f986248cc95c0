"""A map with the robot on it."""

from collections.abc import Iterator
from functools import cached_property
from typing import Annotated, Any, Final, Literal

from pydantic import BeforeValidator, Field, WithJsonSchema

from app.panel.base import (
    Description,
    File,
    FiniteNumber,
    Label,
    Rows,
    Seconds,
    Span,
    TopicName,
    TopicQos,
)
from app.panel.geojson import RouteGraph, read_route_graph
from app.panel.places import FrameName, Metres, Yaw
from app.panel.shared_keys import AgeKey, RobotsKey, TopicKeys
from app.panel.widgets.displays import PictureName, picture_faults
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource, TopicWidget
from app.panel.widgets.map_layers import GRID_TYPE, MAX_LAYERS, Corners, MapLayer, updates_of
from app.ros.dialects.dialect import Role
from app.ros.messages.validation import format_value
from app.system.errors import Fault

POSE_PATHS: Final = {
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose",
    "nav_msgs/msg/Odometry": "pose.pose",
}
AGE: Final = "age(header.stamp)"
TF_TYPE: Final = "tf2_msgs/msg/TFMessage"


class PoseTopic(TopicKeys):
    """A topic with the robot's pose in the map's frame, in place of its transforms."""

    type: Literal[
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "nav_msgs/msg/Odometry",
    ] = "geometry_msgs/msg/PoseWithCovarianceStamped"

    @property
    def paths(self) -> tuple[str, str, str, str, str]:
        """The fields of x and y (metres), heading (radians), the frame, and how old the pose was when
        it arrived (seconds)."""
        pose = POSE_PATHS[self.type]
        place = f"{pose}.position"
        return f"{place}.x", f"{place}.y", f"yaw({pose}.orientation)", "header.frame_id", AGE


class MapRoutes(Description):
    """The route graph of a GeoJSON file, as Nav2's route server has it."""

    file: File
    label: Label | None = None

    @cached_property
    def graph(self) -> RouteGraph:
        return read_route_graph(self.file)


def _check_origin(value: Any) -> Any:
    if not isinstance(value, list | tuple) or len(value) != len(("x", "y", "yaw")):
        raise ValueError(f"must be x, y and yaw, like [-10.0, -5.0, 0.0], not {format_value(value)}")
    return value


ORIGIN: Final = {"type": "array", "items": {"type": "number"}, "minItems": 3, "maxItems": 3}
Origin = Annotated[
    tuple[Metres, Metres, Yaw],
    Field(strict=False),
    BeforeValidator(_check_origin),
    WithJsonSchema(ORIGIN),
]


class MapPlan(Description):
    """A picture over the map, or under it: `origin` is x and y of its lower left corner in metres and
    its yaw in radians, in the map's frame; `resolution` is in metres per pixel."""

    src: PictureName
    resolution: Annotated[FiniteNumber, Field(gt=0, le=100)]
    origin: Origin = (0.0, 0.0, 0.0)
    under_map: bool = False
    label: Label | None = None


class MapView(RobotsKey, AgeKey, TopicWidget, DisplayWidget):
    """Shows a map (`nav_msgs/msg/OccupancyGrid`) with the robot: by its transforms from the map's frame
    to `base_frame`, or by a topic with its pose. A pose older than `max_age_s` is drawn as old, where
    the robot was last seen. `layers` are drawn over the map; `footprint` has the robot's corners in
    `base_frame`, in metres. `robots`: on a page of several robots the others may be shown too."""

    kind: Literal["map"]
    topic: TopicName = "/map"
    type: Literal["nav_msgs/msg/OccupancyGrid"] = "nav_msgs/msg/OccupancyGrid"
    pose: PoseTopic | None = None
    base_frame: FrameName = "base_link"
    radius: Annotated[float, Field(gt=0, le=100)] = 0.3
    footprint: Corners | None = None
    layers: Annotated[tuple[MapLayer, ...], Field(strict=False, max_length=MAX_LAYERS)] = Field(
        default=(), alias="layer"
    )
    routes: MapRoutes | None = None
    plan: MapPlan | None = None
    max_age_s: Seconds = 2.0
    span: Span = 8
    rows: Rows = 4

    @property
    def grids(self) -> tuple[str, ...]:
        """The topics of the map and of its costmaps."""
        costmaps = (layer.topic for layer in self.layers if layer.type == GRID_TYPE)
        return tuple(dict.fromkeys((self.topic, *costmaps)))

    @property
    def has_list(self) -> bool:
        """Whether there is something that the operator may hide."""
        return bool(self.layers or self.routes or self.plan)

    @property
    def uses_transforms(self) -> bool:
        """Whether the robot's transforms are needed: for its pose, or to place a layer."""
        return self.pose is None or bool(self.layers)

    def sources(self) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, ())
        yield updates_of(self.topic)
        for number, layer in enumerate(self.layers):
            yield from layer.sources(f"layer[{number}]")
        if self.pose is not None:
            yield TopicSource(self.pose.topic, self.pose.type, self.pose.qos, self.pose.paths, "pose")
        if self.uses_transforms:
            for topic in ("/tf", "/tf_static"):
                yield TopicSource(topic, TF_TYPE, TopicQos(), ())

    def endpoints(self) -> Iterator[tuple[Role, str]]:
        """Without the updates: few robots publish those of a map."""
        updates = {updates_of(topic).topic for topic in self.grids}
        yield from (each for each in super().endpoints() if each[1] not in updates)

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        yield from super().faults(place, checking)
        for number, layer in enumerate(self.layers):
            yield from layer.faults(f"{place}.layer[{number}]")
        if self.routes is not None:
            yield from (Fault(f"{place}.routes.file", words) for words in self.routes.graph.faults)
        if self.plan is not None:
            yield from picture_faults(f"{place}.plan.src", self.plan.src, checking.pictures)
