"""What the robot's nodes write to their log."""

from collections.abc import Iterator
from typing import Annotated, Final, Literal

from pydantic import Field

from app.panel.base import Span, TopicName
from app.panel.widgets.families import DisplayWidget, TopicSource, TopicWidget

LEVELS: Final = ("debug", "info", "warn", "error", "fatal")
Level = Literal["debug", "info", "warn", "error", "fatal"]


class LogView(TopicWidget, DisplayWidget):
    """The newest `lines` of a log, of at least a `level`, by nodes whose name has `node` in it.

    The server keeps the newest `keep` lines. With `own`, the panel's own are among them.
    """

    kind: Literal["log"]
    topic: TopicName = "/rosout"
    type: Literal["rcl_interfaces/msg/Log"] = "rcl_interfaces/msg/Log"
    level: Level = "info"
    node: Annotated[str, Field(max_length=100)] = ""
    lines: Annotated[int, Field(ge=5, le=200)] = 50
    keep: Annotated[int, Field(ge=100, le=10_000)] = 1_000
    own: bool = False
    span: Span = 12
    rows: Annotated[int, Field(ge=1, le=8)] = 3

    def sources(self) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, ())
