"""Why a topic has no widget. Pure."""

from collections.abc import Mapping
from typing import Final

from app.interfaces import Interfaces

_DRAWN: Final = "{} is drawn by tools such as RViz or Foxglove; a panel has no widget for it"
# ROS's own topics that one may look for.
OF_NAMES: Final[Mapping[str, str]] = {
    "/tf": _DRAWN.format("the tree of frames"),
    "/tf_static": _DRAWN.format("the tree of frames"),
    "/robot_description": "the robot's model is a whole file as one text",
    "/diagnostics_agg": "it has what /diagnostics has",
}
OF_TYPES: Final[Mapping[str, str]] = {
    name: _DRAWN.format(noun)
    for name, noun in {
        "map_msgs/msg/OccupancyGridUpdate": "a map",
        "nav_msgs/msg/GridCells": "a map",
        "nav_msgs/msg/MapMetaData": "a map",
        "nav_msgs/msg/OccupancyGrid": "a map",
        "nav_msgs/msg/Path": "a path",
        "sensor_msgs/msg/LaserScan": "a laser scan",
        "sensor_msgs/msg/MultiEchoLaserScan": "a laser scan",
        "sensor_msgs/msg/PointCloud": "a point cloud",
        "sensor_msgs/msg/PointCloud2": "a point cloud",
        "tf2_msgs/msg/TFMessage": "the tree of frames",
        "visualization_msgs/msg/Marker": "a marker",
        "visualization_msgs/msg/MarkerArray": "a marker",
    }.items()
}
NO_JOINTS: Final = "no message arrived that names its joints"
NO_MESSAGE: Final = "give the message that a key sends"
COLOURS: Final = (frozenset("rgb"), frozenset(("red", "green", "blue")))


def is_colour(type_name: str, interfaces: Interfaces) -> bool:
    """Whether the fields of a type are a colour's."""
    names = {field.name for field in interfaces.structures[type_name].fields}
    return any(names >= colour for colour in COLOURS)


def why_no_display(type_name: str, interfaces: Interfaces) -> str:
    """The reason of a type without a field that is worth showing."""
    if type_name in OF_TYPES:
        return OF_TYPES[type_name]
    if is_colour(type_name, interfaces):
        return "no widget shows a colour"
    return "no field of it is a number, text or bool for operators"


def too_long(length: int) -> str:
    """The reason of a text that is no line of a display."""
    return f"its text of {length:,} characters is too long for a page"
