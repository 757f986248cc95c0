"""One topic of a robot, found by its name: its type, how to decode it, its messages as they arrive."""

import sys
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any, Final

from app.cell.link.observer import RobotObserver
from app.ros.dialects.dialect import PanelEndpoint
from app.ros.graph.model import GraphSnapshot, RobotGraph, SurveyedTopic, topic_forwarding
from app.ros.graph.node_services import NodeServices
from app.ros.messages import Interfaces, load_interfaces
from app.ros.messages.definitions import attribute_name
from app.ros.messages.field_path import Key, field_call, path_steps
from app.ros.messages.names import Qos
from app.ros.zenoh.sample import Sample
from app.system.errors import InterfaceError, LinkError
from app.tools.robot.link import Place, full_name, lost_text, settled_graph, shown_topics, topic_named

DEPTH: Final = 100  # of the bridge's reader: no message of a burst is lost
HOW: Final = "give the folder of its package with --interfaces (a workspace's install/, or its source)"


def endpoint_for(topic: SurveyedTopic, type_name: str) -> PanelEndpoint:
    """A subscription with the QoS of the topic's publishers."""
    hashes = [publisher.type_hash for publisher in topic.publishers if publisher.type_hash]
    qos = Qos(topic.reliable, topic.latched, DEPTH)
    return PanelEndpoint("MS", topic.key, type_name, qos, next(iter(hashes), ""))


@dataclass(frozen=True, slots=True)
class TopicReader:
    """A topic that is there, with its one type."""

    observer: RobotObserver
    robot: RobotGraph
    topic: SurveyedTopic
    type: str

    @classmethod
    async def find(
        cls,
        observer: RobotObserver,
        graph: GraphSnapshot,
        place: Place,
        name: str,
        type_name: str = "",
    ) -> "TopicReader":
        """LinkError for a topic that is not there or not forwarded, and for one of several types. It is
        waited for while a bridge may still announce it."""

        def is_forwarded(graph: GraphSnapshot) -> bool:
            shown = shown_topics(graph, place.namespace).get(f"/{name.lstrip('/')}")
            return shown is not None and shown[1].announced

        graph = await settled_graph(observer, graph, place, is_forwarded)
        robot, topic = topic_named(graph, place, name)
        match topic_forwarding(robot, topic):
            case "denied":
                raise LinkError(
                    f"the bridge does not forward {topic.name}: see `allow` and `deny` in its"
                    " configuration"
                )
            case "lost":
                raise LinkError(lost_text(full_name(robot, topic.name)))
        if type_name and type_name not in topic.types:
            raise LinkError(
                f"{topic.name} is {' and '.join(topic.types)} on the robot, not {type_name}"
            )
        if len(topic.types) > 1 and not type_name:
            raise LinkError(f"{topic.name} has several types, name one: {', '.join(topic.types)}")
        return cls(observer, robot, topic, type_name or topic.type)

    async def interfaces(self, place: Place) -> Interfaces:
        """With the topic's type as the robot has it. InterfaceError says how to give its definition."""
        known = load_interfaces(place.distro, place.interfaces)
        hashes = {
            publisher.type_hash for publisher in self.topic.publishers if publisher.type == self.type
        } - {""}
        try:
            known.require(self.type)
            if not hashes or known.type_hash(self.type) in hashes:
                return known
            differs = True
        except InterfaceError as error:
            differs, why = False, error
        described = await NodeServices(self.robot, known, self.observer).definitions(self.topic)
        if described is not None and self.type in described.structures:
            return Interfaces(place.distro, place.interfaces, described)
        if not differs:
            raise InterfaceError(f"{why}; {HOW}") from why
        print(
            f"warning: the robot's {self.type} has another definition than the one known here: {HOW}",
            file=sys.stderr,
        )
        return known

    async def samples(self) -> AsyncIterator[Sample]:
        """Each sample, that which a latched publisher has kept first."""
        if not self.topic.publishers:
            print(f"no node publishes {self.topic.name} now; waiting", file=sys.stderr, flush=True)
        own = endpoint_for(self.topic, self.type)
        async for _, sample in self.observer.listen([own], hold=bool(self.topic.publishers)):
            yield sample


def value_in(data: bytes, interfaces: Interfaces, type_name: str, path: str) -> Any:
    """The value at a path in a message, from its bytes; the whole message for "". None where a list has
    no such element. DecodeError if the bytes are no such message."""
    if path and field_call(path) is not None:
        return interfaces.field_reader(type_name, [path]).read(data, time.time()).get(path)
    steps = path_steps(path) if path else ()
    if any(isinstance(step, Key) for step in steps):
        return interfaces.field_reader(type_name, [path]).read(data).get(path)
    value = interfaces.decode_whole(type_name, data)
    for step in steps:
        if isinstance(step, str):
            value = getattr(value, attribute_name(step))
        elif isinstance(step, int) and step < len(value):
            value = value[step]
        else:
            return None
    return value
