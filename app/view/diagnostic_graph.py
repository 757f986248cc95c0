"""What the page of diagnostics shows of a robot's ROS graph: its nodes and topics, as its peers report
them. Pure, from (graph, peers, panel's keys)."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Final

from app.interfaces.names import SHARED_TOPICS
from app.survey.forwarding import Forwarding, topic_forwarding
from app.survey.model import GraphSnapshot, RobotGraph, SurveyedTopic, TopicEndpoint

# Services that each node has: they are counted, and say nothing about it.
OF_EVERY_NODE: Final = (
    "describe_parameters", "get_parameter_types", "get_parameters", "list_parameters",
    "set_parameters", "set_parameters_atomically", "get_type_description",
)  # fmt: skip


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeRow:
    """A node: the names of what it publishes, subscribes to and serves, without what every node has."""

    name: str
    dds: str
    publishes: tuple[str, ...]
    subscribes: tuple[str, ...]
    services: tuple[str, ...]
    actions: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphTopicRow:
    """A topic of the graph: the nodes that publish and subscribe to it, with "?" for each end whose
    node is not known, and the QoS of each side. `used`: the panel subscribes to it or publishes it.
    `readers` is how many readers the bridges have of it, None for a robot without a bridge."""

    name: str
    key: str
    types: tuple[str, ...]
    publishers: tuple[str, ...]
    subscribers: tuple[str, ...]
    publisher_qos: tuple[str, ...]
    subscriber_qos: tuple[str, ...]
    forwarding: Forwarding
    used: bool
    readers: int | None


def robots_in(graph: GraphSnapshot, peers: Collection[str]) -> list[RobotGraph]:
    """The graphs behind these peers, by their zids; those without bridges count."""
    return [
        robot
        for robot in graph.robots
        if not robot.bridges or any(bridge.zid in peers for bridge in robot.bridges)
    ]


def node_rows(robots: Iterable[RobotGraph]) -> list[NodeRow]:
    """All nodes, by name; one that two bridges see, once."""
    rows = {
        f"{robot.namespace}{node.name}": NodeRow(
            name=f"{robot.namespace}{node.name}",
            dds=node.dds,
            publishes=_telling(node.publishers),
            subscribes=_telling(node.subscribers),
            services=tuple(s for s in node.services if s.rpartition("/")[2] not in OF_EVERY_NODE),
            actions=node.actions,
        )
        for robot in robots
        for node in robot.nodes
    }
    return [rows[name] for name in sorted(rows)]


def _telling(topics: Iterable[str]) -> tuple[str, ...]:
    return tuple(topic for topic in topics if topic not in SHARED_TOPICS)


def graph_topic_rows(
    robots: Iterable[RobotGraph], used: Collection[str], lost: Collection[str]
) -> list[GraphTopicRow]:
    """All topics, by name. `used` are the keys of the panel's own, `lost` of those that the bridge has
    lost."""
    rows = {
        topic.key: _row(robot, topic, topic.key in used, topic.key in lost)
        for robot in robots
        for topic in robot.topics
    }
    return sorted(rows.values(), key=lambda row: row.name)


def _row(robot: RobotGraph, topic: SurveyedTopic, used: bool, lost: bool) -> GraphTopicRow:
    forwarding = topic_forwarding(robot, topic)
    return GraphTopicRow(
        name=f"{robot.namespace}{topic.name}",
        key=topic.key,
        types=topic.types,
        publishers=_nodes(topic.publishers),
        subscribers=_nodes(topic.subscribers),
        publisher_qos=_qos(topic.publishers),
        subscriber_qos=_qos(topic.subscribers),
        forwarding="forwarded" if forwarding == "lost" and not lost else forwarding,
        used=used,
        readers=_readers(robot, topic.key) if robot.bridges else None,
    )


def _nodes(ends: Sequence[TopicEndpoint]) -> tuple[str, ...]:
    """One of several nodes of one process is written with all of them: which it is, is not known."""
    return tuple(" | ".join(end.nodes) or "?" for end in ends)


def _qos(ends: Iterable[TopicEndpoint]) -> tuple[str, ...]:
    return tuple(dict.fromkeys(str(end.qos) for end in ends))


def _readers(robot: RobotGraph, key: str) -> int:
    """The bridges' own readers of a topic: one for each route from the robot's nodes that is read."""
    return sum(
        route.kind == "topic" and route.direction == "pub" and route.key == key and bool(route.endpoint)
        for route in robot.routes
    )
