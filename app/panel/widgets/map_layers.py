"""The layers of a map: what is drawn over it."""

from collections.abc import Collection, Iterator, Mapping, Sequence
from typing import Annotated, Final, Literal, NamedTuple

from pydantic import Field

from app.panel.base import FiniteNumber, Id, Label, TopicName, TopicQos
from app.panel.checks.types import field_faults
from app.panel.file.wording import no_such
from app.panel.shared_keys import AgeKey
from app.panel.widgets.families import TopicSource
from app.ros.messages import Interfaces
from app.system.errors import Fault

GRID_TYPE: Final = "nav_msgs/msg/OccupancyGrid"
UPDATE_TYPE: Final = "map_msgs/msg/OccupancyGridUpdate"
UPDATES: Final = "_updates"  # a grid's topic with this at its end has its updates
MAX_LAYERS: Final = 8
MAX_CORNERS: Final = 100

INFO_TYPE: Final = "nav2_msgs/msg/CostmapFilterInfo"
INFO_FIELDS: Final = ("type", "filter_mask_topic", "base", "multiplier")

LayerName = Literal["path", "scan", "footprint", "covariance", "costmap", "keep_out", "speed"]


class LayerKind(NamedTuple):
    """A kind of layers: the type of its topic, after how many seconds its newest message is old by
    default (None: never), whether its messages end when the robot stands, and whether it is a mask."""

    type: str
    max_age_s: float | None
    ends: bool = False
    is_mask: bool = False


LAYERS: Final[Mapping[LayerName, LayerKind]] = {
    "path": LayerKind("nav_msgs/msg/Path", 10.0, ends=True),
    "scan": LayerKind("sensor_msgs/msg/LaserScan", 1.0),
    "footprint": LayerKind("geometry_msgs/msg/PolygonStamped", 2.0),
    "covariance": LayerKind("geometry_msgs/msg/PoseWithCovarianceStamped", None),
    "costmap": LayerKind(GRID_TYPE, None),
    "keep_out": LayerKind(GRID_TYPE, None, is_mask=True),
    "speed": LayerKind(GRID_TYPE, None, is_mask=True),
}

Corner = Annotated[tuple[FiniteNumber, ...], Field(strict=False, min_length=2, max_length=2)]
Corners = Annotated[tuple[Corner, ...], Field(strict=False, min_length=3, max_length=MAX_CORNERS)]


class MapLayer(AgeKey):
    """A topic that is drawn over a map, in the map's frame by the robot's transforms. It is left out,
    and named, while its newest message is older than `max_age_s`. `info` is the topic of the
    CostmapFilterInfo that says of a mask what its cells mean; `level` the only level that it is of."""

    shows: LayerName
    topic: TopicName
    info: TopicName | None = None
    level: Id | None = None
    qos: TopicQos = TopicQos()
    label: Label | None = None
    line: Literal["dashed", "solid"] | None = None

    @property
    def row(self) -> LayerKind:
        return LAYERS[self.shows]

    @property
    def type(self) -> str:
        """The type of the topic, by the layer's kind."""
        return self.row.type

    @property
    def most_age_s(self) -> float | None:
        """The age at which it is old, in seconds; None for never."""
        return self.row.max_age_s if self.max_age_s is None else self.max_age_s

    @property
    def shown_line(self) -> str:
        """How a path is drawn; "" for other kinds."""
        return (self.line or "dashed") if self.shows == "path" else ""

    def sources(self, place: str) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, (), place)
        if self.type == GRID_TYPE:
            yield updates_of(self.topic, place)
        if self.info is not None:
            yield TopicSource(self.info, INFO_TYPE, TopicQos(), INFO_FIELDS, place)

    def faults(self, place: str, levels: Sequence[str], interfaces: Interfaces) -> Iterator[Fault]:
        yield from level_key_faults(place, self.level, levels, required=False)
        if self.row.is_mask and self.info is None:
            message = f"is missing: the topic of the {INFO_TYPE} that names {self.topic}"
            yield Fault(f"{place}.info", message)
        elif self.info is not None and not self.row.is_mask:
            yield Fault(f"{place}.info", f"is for masks: a {self.shows} has none")
        elif self.info is not None:
            yield from field_faults(f"{place}.info", INFO_TYPE, INFO_FIELDS[0], interfaces)
        if self.line is not None and self.shows != "path":
            yield Fault(f"{place}.line", f"is for paths: a {self.shows} has no line")


def updates_of(topic: str, place: str = "") -> TopicSource:
    """The updates of a grid's topic."""
    return TopicSource(topic + UPDATES, UPDATE_TYPE, TopicQos(), (), place)


def level_key_faults(
    place: str, level: str | None, known: Collection[str], *, required: bool
) -> Iterator[Fault]:
    """Faults of the key `level` of the table at `place`, with the ids of all levels."""
    if level is None:
        if required:
            message = f"is missing: the map has the levels {', '.join(known)}"
            yield Fault(f"{place}.level", message)
    elif level not in known:
        message = no_such("level", level, known) if known else "is for a map with levels; it has none"
        yield Fault(f"{place}.level", message, cause=f"level {level}")
