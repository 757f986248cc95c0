"""The newest picture of a camera."""

from collections.abc import Iterator
from typing import Annotated, Literal

from pydantic import Field

from app.errors import Fault
from app.panel.base import Seconds, Span, TopicQos
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource, TopicWidget

PictureType = Literal["sensor_msgs/msg/CompressedImage", "sensor_msgs/msg/Image"]


class Camera(TopicWidget, DisplayWidget):
    """Shows the newest picture of a topic, which is subscribed to only while a browser shows it.

    One older than `max_age_s` is marked as old; of one with more than `max_bytes`, or more than
    `max_side_px` pixels a side, nothing is shown.
    Each browser gets at most `max_hz` pictures per second, and as few as it takes.
    """

    kind: Literal["camera"]
    type: PictureType = "sensor_msgs/msg/CompressedImage"
    qos: TopicQos = TopicQos(reliability="best_effort", durability="volatile", depth=1)
    max_age_s: Seconds = 1.0
    max_hz: Annotated[float, Field(ge=0.1, le=60)] = 15.0
    max_bytes: Annotated[int, Field(ge=1_000, le=64_000_000)] = 8_000_000
    max_side_px: Annotated[int, Field(ge=16, le=16_384)] = 4096
    span: Span = 6
    rows: Annotated[int, Field(ge=1, le=8)] = 2

    def sources(self) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, (), on_demand=True)

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        if self.topic in checking.types:
            message = f"{self.topic} is listened to at all times by another part of the panel"
            yield Fault(f"{place}.topic", f"{message}: a camera's topic is only a camera's")
        yield from super().faults(place, checking)
