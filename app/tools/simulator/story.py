"""What the stories of a simulated robot have in common: the topics of a machine that is stepped with
time, and an action with one goal at a time. Pure."""

from abc import ABC, abstractmethod
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Generic, TypeVar

from app.panel.demo import Story
from app.tools.simulator.known_types import Moment, stamp
from app.tools.simulator.parameters import NodeParameters
from app.tools.simulator.robot import ActionServer

Fields = dict[str, Any]
Machine = TypeVar("Machine")

REPEAT_S: Final = 1.0
EARLY_S: Final = 0.02  # a step may come a little too early


@dataclass(frozen=True)  # a generic with slots can't be made by its alias
class StoryTopic(Generic[Machine]):
    """The fields of a topic. It is published when they change, at most each `least_s`, and again each
    `repeat_s`: a stamp alone is no change, so `value` is compared."""

    value: Callable[[Machine], Any]
    fields: Callable[[Any, Moment], Fields] = lambda value, _: {"data": value}
    least_s: float = 0.0
    latched: bool = True
    repeat_s: float = REPEAT_S


class PlayedStory(ABC):
    """A story, for the `names` that the panel uses; `actions` are its action servers."""

    def __init__(self, names: Story) -> None:
        self.names = names
        self.actions: Mapping[str, ActionServer] = {}

    @abstractmethod
    def is_latched(self, topic: str) -> bool:
        """Whether late subscribers get the last message."""

    @abstractmethod
    def receive(self, topic: str, message: Any) -> None:
        """A message on one of the topics that it subscribes to."""

    @abstractmethod
    def serve(self, service: str, request: Any) -> Fields:
        """The response, with a message if it is refused. A panel has words for success."""

    @abstractmethod
    def step(self, moment: Moment) -> Iterator[tuple[str, Fields]]:
        """The messages that it publishes, as (topic, fields)."""

    @abstractmethod
    def configure(self, nodes: Mapping[str, NodeParameters]) -> None:
        """Takes over the parameters of its nodes, by the nodes' names."""


class StoryTopics(Generic[Machine]):
    """The topics of a machine, and when each was published last."""

    def __init__(self, machine: Machine, rows: Mapping[str, StoryTopic[Machine]]) -> None:
        self._machine = machine
        self._rows = rows
        self._published: dict[str, tuple[float, Any]] = {}

    def is_latched(self, topic: str) -> bool:
        return topic in self._rows and self._rows[topic].latched

    def due(self, topic: str, moment: Moment) -> Fields | None:
        """The fields of the message that is due; None if there is none."""
        if (row := self._rows.get(topic)) is None:
            return None
        last, value = self._published.get(topic), row.value(self._machine)
        if last is not None:
            since = moment.t - last[0] + EARLY_S
            if since < (row.repeat_s if value == last[1] else row.least_s):
                return None
        self._published[topic] = moment.t, value
        return row.fields(value, moment)


def diagnostic_status(level: int, name: str, message: str, values: Mapping[str, str]) -> Fields:
    """A `diagnostic_msgs/msg/DiagnosticStatus`."""
    listed = [{"key": key, "value": value} for key, value in values.items()]
    return {"level": level, "name": name, "message": message, "hardware_id": name, "values": listed}


def log_fields(level: int, text: str, moment: Moment, node: str) -> Fields:
    """A line of the log of a node (`rcl_interfaces/msg/Log`)."""
    return {"stamp": stamp(moment), "level": level, "name": node, "msg": text, "file": f"{node}.py"}
