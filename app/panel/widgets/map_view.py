"""A map with the robot on it."""

from collections.abc import Iterator
from functools import cached_property
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal, Self

from pydantic import BeforeValidator, Field, WithJsonSchema

from app.panel.base import (
    Description,
    File,
    FiniteNumber,
    Id,
    Label,
    Rows,
    Seconds,
    Span,
    TopicName,
    TopicQos,
)
from app.panel.places import FrameName, Metres, Place, Yaw
from app.panel.shared_keys import AgeKey, RobotsKey, TopicKeys
from app.panel.widgets.displays import PictureName, picture_faults
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource, TopicWidget
from app.panel.widgets.map_layers import (
    GRID_TYPE,
    MAX_LAYERS,
    Corners,
    MapLayer,
    level_key_faults,
    updates_of,
)
from app.panel.widgets.map_levels import (
    MapLevel,
    MapLevels,
    RobotLevel,
    level_faults,
    with_values,
)
from app.ros.dialects.dialect import Role
from app.ros.messages import Interfaces
from app.ros.messages.validation import format_value
from app.system.errors import Fault

if TYPE_CHECKING:
    from app.panel.geojson import RouteGraph

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
    """The route graph of a GeoJSON file, as Nav2's route server has it. `level` is the level of the map
    that it is on."""

    file: File
    label: Label | None = None
    level: Id | None = None

    @cached_property
    def graph(self) -> "RouteGraph":
        from app.panel.geojson import read_route_graph  # few panels have a graph

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
    level: Id | None = None


class MapView(RobotsKey, AgeKey, TopicWidget, DisplayWidget):
    """Shows a map (`nav_msgs/msg/OccupancyGrid`) with the robot: by its transforms from the map's frame
    to `base_frame`, or by a topic with its pose. A pose older than `max_age_s` is drawn as old, where
    the robot was last seen. `layers` are drawn over the map; `footprint` has the robot's corners in
    `base_frame`, in metres. `robots`: on a page of several robots the others may be shown too. With
    `levels` each of them has a map, and the robot is on the one that `robot_level` says or, without it,
    on the only one to whose map its pose leads."""

    kind: Literal["map"]
    topic: TopicName = "/map"
    type: Literal["nav_msgs/msg/OccupancyGrid"] = "nav_msgs/msg/OccupancyGrid"
    levels: MapLevels = Field(default=(), alias="level")
    robot_level: RobotLevel | None = None
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
        """The topics of its maps and costmaps."""
        maps = (level.topic for level in self.maps)
        costmaps = (layer.topic for layer in self.layers if layer.type == GRID_TYPE)
        return tuple(dict.fromkeys((*maps, *costmaps)))

    @cached_property
    def maps(self) -> tuple[MapLevel, ...]:
        """Its levels; a map without levels is the only one, without a name."""
        own: dict[str, Any] = {"id": "", "label": "", "topic": self.topic, "qos": self.qos}
        return self.levels or (MapLevel.model_construct(**own),)

    def offers(self, place: Place) -> bool:
        """Whether a place may be of it: of one of its levels or, without levels, of none."""
        if not self.levels:
            return place.level is None
        known = {level.id for level in self.levels}
        return place.map_version is not None if place.level is None else place.level in known

    @property
    def keep_out(self) -> tuple[MapLayer, ...]:
        """The masks in whose cells no goal may be."""
        return tuple(layer for layer in self.layers if layer.shows == "keep_out")

    @property
    def deciding_topics(self) -> frozenset[str]:
        """The topics, beside maps and transforms, by which a goal on it is judged."""
        sources = (self.pose, self.robot_level)
        infos = (layer.info for layer in self.keep_out if layer.info)
        return frozenset((*(source.topic for source in sources if source is not None), *infos))

    @property
    def has_list(self) -> bool:
        """Whether there is something that the operator may hide."""
        return bool(self.layers or self.routes or self.plan)

    @property
    def uses_transforms(self) -> bool:
        """Whether the robot's transforms are needed: for its pose, or to place a layer."""
        return self.pose is None or bool(self.layers)

    def sources(self) -> Iterator[TopicSource]:
        for number, level in enumerate(self.maps):
            yield from level.sources(f"level[{number}]" if self.levels else "")
        if self.robot_level is not None:
            yield self.robot_level.source("robot_level")
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
        yield from level_faults(place, self.levels, self.robot_level, checking.interfaces)
        yield from self._level_faults(place)
        levels = [str(level.id) for level in self.levels]
        for number, layer in enumerate(self.layers):
            yield from layer.faults(f"{place}.layer[{number}]", levels, checking.interfaces)
        if self.routes is not None:
            yield from (Fault(f"{place}.routes.file", words) for words in self.routes.graph.faults)
        if self.plan is not None:
            yield from picture_faults(f"{place}.plan.src", self.plan.src, checking.pictures)

    def _level_faults(self, place: str) -> Iterator[Fault]:
        """Faults of what is of a map without levels, or of one with."""
        if self.levels and "topic" in self.model_fields_set:
            yield Fault(f"{place}.topic", "is of a map without levels: here each level has its topic")
        known = [str(level.id) for level in self.levels]
        for key, table in (("routes", self.routes), ("plan", self.plan)):
            if table is not None:
                yield from level_key_faults(f"{place}.{key}", table.level, known, required=bool(known))

    def with_constants(self, interfaces: Interfaces) -> Self:
        if self.robot_level is None:
            return self
        levels = with_values(self.levels, self.robot_level, interfaces)
        return self.model_copy(update={"levels": levels})
