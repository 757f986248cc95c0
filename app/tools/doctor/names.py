"""The names that a panel uses of one robot, found in the ROS graph. Pure."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Literal

from app.panel.model import Panel, RobotEntry
from app.ros.dialects.dialect import DialectName, within
from app.ros.graph.model import (
    BridgeRoute,
    Forwarding,
    GraphSnapshot,
    Node,
    RobotGraph,
    Server,
    ServerList,
    SurveyedTopic,
    TopicEndpoint,
    TopicList,
    near,
    server_forwarding,
    topic_forwarding,
)
from app.ros.messages.names import GLOBAL, PARAMETER_EVENTS, SHARED_TOPICS, key_of, possible_keys
from app.system.texts import TextLike, say


@dataclass(frozen=True, slots=True)
class PanelRobot:
    """A panel, and one of its robots: `entry` is None where it has only one."""

    panel: Panel
    entry: RobotEntry | None = None

    @property
    def id(self) -> str:
        return self.entry.id if self.entry else ""

    @property
    def dialect(self) -> DialectName:
        return (self.entry or self.panel).dialect

    @property
    def domain(self) -> int:
        return (self.entry or self.panel).domain

    @property
    def namespace(self) -> str:
        return self.entry.namespace if self.entry else self.panel.namespace

    def key(self, name: str) -> str:
        return key_of(name, self.namespace)

    def possible_keys(self, name: str) -> tuple[str, ...]:
        """Several of a topic that nodes publish in any namespace, such as /rosout."""
        return possible_keys(name, self.namespace)

    def needed(self) -> set[str]:
        """The names of all topics, services, actions and nodes that the panel uses."""
        panel = self.panel
        servers = {name for widget in panel.widgets() for _, name in widget.endpoints()}
        nodes = {widget.node for widget in panel.parameters()}
        return {*panel.listened(), *panel.publications(), *servers, *nodes} - {PARAMETER_EVENTS}


@dataclass(frozen=True, slots=True)
class PanelNames:
    """Those graphs of a link that may be this robot's, queried by the panel's names."""

    robot: PanelRobot
    graphs: tuple[RobotGraph, ...]

    @classmethod
    def for_robot(cls, robot: PanelRobot, graph: GraphSnapshot) -> "PanelNames":
        elsewhere = [f"/{robot.key(name)}" for name in robot.needed() if name.startswith(GLOBAL)]
        names = (robot.namespace, *elsewhere)
        own = (
            robot_graph
            for robot_graph in graph.robots
            if any(within(name, robot_graph.namespace) for name in names)
        )
        return cls(robot, tuple(own))

    def places(self, name: str) -> Iterator[tuple[RobotGraph, str]]:
        """Each graph that can have a name, with the name as the robot has it there: without the
        bridge's namespace."""
        for graph in self.graphs:
            for key in self.robot.possible_keys(name):
                own = f"/{key}".removeprefix(graph.namespace)
                if within(f"/{key}", graph.namespace) and (own == name or name not in SHARED_TOPICS):
                    yield graph, own

    @property
    def has_dds_qos(self) -> bool:
        """Whether publishers and subscribers need a compatible QoS."""
        return any(graph.has_dds_qos for graph in self.graphs)

    def topics(self, name: str) -> list[SurveyedTopic]:
        return [topic for graph, own in self.places(name) if (topic := graph.topic(own)) is not None]

    def publishers(self, name: str) -> list[TopicEndpoint]:
        return [publisher for topic in self.topics(name) for publisher in topic.publishers]

    def subscribers(self, name: str) -> list[TopicEndpoint]:
        return [subscriber for topic in self.topics(name) for subscriber in topic.subscribers]

    def topic_forwarding(self, name: str, ends: TopicList) -> Forwarding | None:
        """Of the publishers or subscribers of a topic; None without any."""
        places = ((graph, graph.topic(own)) for graph, own in self.places(name))
        return _best(
            topic_forwarding(graph, topic, [ends])
            for graph, topic in places
            if topic and getattr(topic, ends)
        )

    def server_forwarding(self, name: str, kind: ServerList) -> Forwarding | None:
        """Of a service or an action; None if no node offers it."""
        return _best(server_forwarding(graph, kind, own) for graph, own in self.places(name))

    def services(self, name: str) -> list[Server]:
        return [
            service
            for graph, own in self.places(name)
            for service in graph.services
            if service.name == own
        ]

    def actions(self, name: str) -> list[Server]:
        return [
            action for graph, own in self.places(name) for action in graph.actions if action.name == own
        ]

    def nodes(self) -> list[Node]:
        return [node for graph in self.graphs for node in graph.nodes]

    def has_node(self, name: str) -> bool:
        return any(graph.node(own) is not None for graph, own in self.places(name))

    def offers(self, name: str) -> bool:
        """Whether a node has a service or an action of this name, announced by its bridge or not."""
        return any(
            own in node.services or own in node.actions
            for graph, own in self.places(name)
            for node in graph.nodes
        )

    def routes(self, name: str) -> list[BridgeRoute]:
        keys = self.robot.possible_keys(name)
        return [route for graph in self.graphs for route in graph.routes if route.key in keys]

    def hint(self, name: str, kind: Literal["topics", "services", "actions"]) -> TextLike:
        """A sentence with similar names in the graph; "" if there are none."""
        there = [
            f"{graph.namespace}{server.name}"
            for graph in self.graphs
            for server in _endpoints(graph, kind)
        ]
        own = self.robot.namespace
        similar = [self._written(near_name) for near_name in near(f"/{self.robot.key(name)}", there)]
        if own and f"/{name}" not in similar and name in there:
            similar = [f"/{name}", *similar]  # the same name, not below the namespace
        return say("finding_hint", names=tuple(similar)) if similar else ""

    def _written(self, whole: str) -> str:
        """A whole name as a panel file has it."""
        own = self.robot.namespace
        return whole.removeprefix(own) if within(whole, own) else f"/{whole}"

    def elsewhere(self, names: set[str]) -> Iterator[tuple[str, str]]:
        """(name, its namespace) of each name in the graph that ends with one of the panel's."""
        own = self.robot.namespace
        for graph in self.graphs:
            topics, servers = (t.name for t in graph.topics), (*graph.services, *graph.actions)
            for there in (f"{graph.namespace}{name}" for name in (*topics, *(s.name for s in servers))):
                for name in (name for name in names if not name.startswith(GLOBAL)):
                    if there.endswith(name) and there != f"{own}{name}":
                        yield there, there.removesuffix(name)


def _best(known: Iterable[Forwarding | None]) -> Forwarding | None:
    """That of the robot where it is forwarded, else lost, else denied."""
    order: tuple[Forwarding, ...] = ("forwarded", "lost", "denied")
    there = set(known)
    return next((key for key in order if key in there), None)


def _endpoints(graph: RobotGraph, kind: str) -> tuple[SurveyedTopic, ...] | tuple[Server, ...]:
    match kind:
        case "topics":
            return graph.topics
        case "services":
            return graph.services
    return graph.actions
