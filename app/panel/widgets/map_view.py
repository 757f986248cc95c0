"""A map with the robot on it."""

from collections.abc import Iterator
from typing import Annotated, Final, Literal

from pydantic import Field

from app.panel.base import Rows, Seconds, Span, TopicName, TopicQos
from app.panel.shared_keys import AgeKey, TopicKeys
from app.panel.widgets.families import DisplayWidget, TopicSource, TopicWidget

POSE_PATHS: Final = {
    "geometry_msgs/msg/PoseStamped": "pose",
    "geometry_msgs/msg/PoseWithCovarianceStamped": "pose.pose",
    "nav_msgs/msg/Odometry": "pose.pose",
}
TF_TYPE: Final = "tf2_msgs/msg/TFMessage"
FrameName = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^[^/\s][^\s]*$")]


class PoseTopic(TopicKeys):
    """A topic with the robot's pose in the map's frame, in place of its transforms."""

    type: Literal[
        "geometry_msgs/msg/PoseStamped",
        "geometry_msgs/msg/PoseWithCovarianceStamped",
        "nav_msgs/msg/Odometry",
    ] = "geometry_msgs/msg/PoseWithCovarianceStamped"

    @property
    def paths(self) -> tuple[str, str, str, str]:
        """The fields of x and y (metres), heading (radians) and the frame."""
        pose = POSE_PATHS[self.type]
        place = f"{pose}.position"
        return f"{place}.x", f"{place}.y", f"yaw({pose}.orientation)", "header.frame_id"


class MapView(AgeKey, TopicWidget, DisplayWidget):
    """Shows a map (`nav_msgs/msg/OccupancyGrid`) with the robot: by its transforms from the map's frame
    to `base_frame`, or by a topic with its pose. A pose older than `max_age_s` is drawn as old, where
    the robot was last seen."""

    kind: Literal["map"]
    topic: TopicName = "/map"
    type: Literal["nav_msgs/msg/OccupancyGrid"] = "nav_msgs/msg/OccupancyGrid"
    pose: PoseTopic | None = None
    base_frame: FrameName = "base_link"
    radius: Annotated[float, Field(gt=0, le=100)] = 0.3
    max_age_s: Seconds = 2.0
    span: Span = 8
    rows: Rows = 4

    def sources(self) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, ())
        if self.pose is not None:
            yield TopicSource(self.pose.topic, self.pose.type, self.pose.qos, self.pose.paths, "pose")
        else:
            for topic in ("/tf", "/tf_static"):
                yield TopicSource(topic, TF_TYPE, TopicQos(), ())
