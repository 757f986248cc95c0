"""What the page of diagnostics shows: a panel's own topics, services, actions and parameters, and the
ROS graph."""

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple

from app.cell.permission.robot_options import options_now
from app.cell.permission.verdict import (
    Verdict,
    call_blocked,
    parameters_offered,
    topic_mismatch,
    unsettable,
)
from app.cell.robot.parameter_state import UNKNOWN
from app.cell.robot.state import RobotState
from app.cell.robot.traffic import TopicTraffic, Undecodable
from app.cell.view.parameter_values import parameter
from app.panel.base import TopicQos
from app.panel.model import Panel
from app.panel.widgets.families import TopicSource
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.service_action import ServerCommand
from app.records.entry import IDLE, OutcomeCode
from app.ros.dialects.dialect import Endpoint, TopicRole
from app.ros.graph.model import (
    Forwarding,
    GraphSnapshot,
    RobotGraph,
    SurveyedTopic,
    TopicEndpoint,
    topic_forwarding,
)
from app.ros.messages.names import SHARED_TOPICS
from app.system.texts import TextLike

# What the page of diagnostics shows of a panel's own topics, services, actions and parameters: pure,
# from (panel, robot, time).

RowState = Literal["ok", "problem", "unknown"]
TopicUse = Literal["subscribed", "on_demand", "published"]
BUSY: Mapping[str, str] = {"press_in_progress": "running", "goal_may_be_running": "running"}
PEER_ROLE: Mapping[TopicRole, TopicRole] = {"MS": "MP", "MP": "MS"}


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicRow:
    """A topic of the panel. `rate_hz`, `size` (bytes) and `age_s` are None where nothing arrived, or
    where it is published by the panel. `robot_qos` are those of its publishers, or of the subscribers
    to what the panel publishes; none without one. `reason` is why `state` is a problem."""

    name: str
    key: str
    expression: str
    type: str
    use: TopicUse
    state: RowState
    reason: TextLike
    own_qos: str
    robot_qos: tuple[str, ...]
    count: int = 0
    rate_hz: float | None = None
    size: int | None = None
    age_s: float | None = None
    undecodable_count: int = 0
    undecodable: Undecodable | None = None


class _Known(NamedTuple):
    """The panel's side of a topic."""

    topic: str
    type: str
    qos: TopicQos


@dataclass(frozen=True, slots=True, kw_only=True)
class ServerRow:
    """A service or an action, of one control: `result` is its last, "" before the first."""

    kind: Literal["service", "action"]
    widget: str
    label: TextLike
    name: str
    type: str
    state: RowState
    reason: TextLike
    running: bool
    outcome: OutcomeCode | Literal[""]
    result: TextLike


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterRow:
    """A parameter of one control: `value` as its node reported it, `read_wall` when (seconds since the
    epoch; 0: never)."""

    widget: str
    label: TextLike
    node: str
    name: str
    type: str
    state: RowState
    reason: TextLike
    value: TextLike
    read_wall: float
    running: bool
    outcome: OutcomeCode | Literal[""]
    result: TextLike


def topic_rows(panel: Panel, robot: RobotState, now: float) -> list[TopicRow]:
    """All topics of the panel, by name: those that it subscribes to, then those that it publishes."""
    on_demand = panel.on_demand().keys() - panel.subscriptions().keys()
    rows = [
        _heard(_known(panel, name, type_name), robot, now, name in on_demand)
        for name, type_name in sorted(panel.listened().items())
    ]
    published = sorted(panel.publications().items())
    return rows + [_published(_known(panel, name, type_name), robot) for name, type_name in published]


def _known(panel: Panel, name: str, type_name: str) -> _Known:
    return _Known(name, type_name, panel.qos(name))


def _heard(topic: _Known, robot: RobotState, now: float, on_demand: bool) -> TopicRow:
    key = robot.key(topic.topic)
    if not on_demand:
        robot.reading_by_key(key)  # decodes the newest message, which no page may show
    traffic = robot.traffic.topics.get(key) or TopicTraffic()
    mismatch = _mismatch("MS", topic, robot)
    there, arrived = robot.graph.has_endpoint("MP", key), traffic.size > 0
    state: RowState = "ok" if there and (arrived or on_demand) else "unknown"
    if mismatch or robot.traffic.undecodable[key]:
        state = "problem"
    return TopicRow(
        name=topic.topic,
        key=key,
        expression=robot.dialect.topic(key, topic.type),
        type=topic.type,
        use="on_demand" if on_demand else "subscribed",
        state=state,
        reason=(mismatch.reason or "") if mismatch else "",
        own_qos=_subscription_qos(topic.qos, adapts=robot.adapts_reliability(key)),
        robot_qos=_robot_qos(robot.graph.described_endpoints("MP", key)),
        count=traffic.count,
        rate_hz=traffic.rate(now),
        size=traffic.size if arrived else None,
        age_s=max(now - traffic.at, 0.0) if arrived else None,
        undecodable_count=robot.traffic.undecodable[key],
        undecodable=traffic.undecodable,
    )


def _published(topic: _Known, robot: RobotState) -> TopicRow:
    key = robot.key(topic.topic)
    mismatch = _mismatch("MP", topic, robot)
    state: RowState = "problem" if mismatch else "ok"
    return TopicRow(
        name=topic.topic,
        key=key,
        expression=robot.dialect.topic(key, topic.type),
        type=topic.type,
        use="published",
        state=state if robot.graph.has_endpoint("MS", key) else "unknown",
        reason=(mismatch.reason or "") if mismatch else "",
        own_qos=qos_text(topic.qos.wire_qos.reliable, topic.qos.wire_qos.transient_local),
        robot_qos=_robot_qos(robot.graph.described_endpoints("MS", key)),
    )


def _mismatch(role: TopicRole, topic: _Known, robot: RobotState) -> Verdict | None:
    source = TopicSource(topic.topic, topic.type, topic.qos, ())
    return topic_mismatch(role, source, robot)


def _subscription_qos(qos: TopicQos, *, adapts: bool) -> str:
    """`adapts`: the reliability is the publisher's. So is a durability that the panel file leaves
    out."""
    known = qos.wire_qos
    durability = None if qos.durability is None else known.transient_local
    return qos_text(None if adapts else known.reliable, durability)


def _robot_qos(endpoints: Iterable[Endpoint]) -> tuple[str, ...]:
    texts = (qos_text(endpoint.reliable, endpoint.transient_local) for endpoint in endpoints)
    return tuple(dict.fromkeys(texts))


def qos_text(reliable: bool | None, transient_local: bool | None) -> str:
    """By the names of ROS 2's policies; one that is not known, or left to the other side, is left
    out."""
    reliability = {True: "reliable", False: "best effort", None: ""}[reliable]
    durability = {True: "transient local", False: "volatile", None: ""}[transient_local]
    return ", ".join(filter(None, (reliability, durability)))


def server_rows(panel: Panel, robot: RobotState, now: float) -> list[ServerRow]:
    """The services and actions of the panel, in the order of its pages; then the services that list
    options."""
    servers = [widget for widget in panel.widgets() if isinstance(widget, ServerCommand)]
    rows = [_server(widget, robot, now) for widget in servers]
    return rows + [row for select in panel.listed_selects if (row := _listing(select, robot, now))]


def _server(widget: ServerCommand, robot: RobotState, now: float) -> ServerRow:
    status = robot.command_status.get(widget.id, IDLE)
    state, reason = _judged(call_blocked(widget, robot, now))
    return ServerRow(
        kind="service" if widget.server_role == "SS" else "action",
        widget=widget.id,
        label=widget.label,
        name=widget.server_name,
        type=widget.type,
        state=state,
        reason=reason,
        running=status.busy,
        outcome=status.outcome,
        result=status.text,
    )


def _listing(select: SelectInput, robot: RobotState, now: float) -> ServerRow | None:
    """The service that lists a select's options; None where something else does."""
    source = select.options_from
    if source is None or (service := source.listing) is None:
        return None
    verdict = options_now(select, source, robot, now).verdict
    state, reason = _judged(None if verdict.permitted else verdict)
    return ServerRow(
        kind="service",
        widget=select.id,
        label=select.label,
        name=service.name,
        type=service.type,
        state=state,
        reason=reason,
        running=False,
        outcome="",
        result="",
    )


def _judged(verdict: Verdict | None) -> tuple[RowState, TextLike]:
    """A server that works on a call is well."""
    if verdict is None or verdict.code in BUSY:
        return "ok", ""
    return "problem", verdict.reason or ""


def parameter_rows(panel: Panel, robot: RobotState) -> list[ParameterRow]:
    """The parameters of the panel, in the order of its pages."""
    return [*_parameters(panel, robot)]


def _parameters(panel: Panel, robot: RobotState) -> Iterator[ParameterRow]:
    for widget in panel.parameters():
        known = robot.parameters.get(widget.id, UNKNOWN)
        status = robot.command_status.get(widget.id, IDLE)
        blocked = parameters_offered(widget.node, robot) or unsettable(widget, known, robot)
        state, reason = _judged(None if _is_read_only(widget, blocked) else blocked)
        yield ParameterRow(
            widget=widget.id,
            label=widget.label,
            node=widget.node,
            name=widget.parameter,
            type=widget.type,
            state=state,
            reason=reason,
            value=parameter(widget, robot)["text"],
            read_wall=known.wall,
            running=status.busy,
            outcome=status.outcome,
            result=status.text,
        )


def _is_read_only(widget: Parameter, verdict: Verdict | None) -> bool:
    """A parameter that can only be read is well."""
    return verdict is not None and verdict.code == "parameter_read_only"


# What the page of diagnostics shows of a robot's ROS graph: its nodes and topics, as its peers report
# them. Pure, from (graph, peers, panel's keys).

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
