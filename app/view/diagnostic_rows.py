"""What the page of diagnostics shows of a panel's own topics, services, actions and parameters: pure,
from (panel, robot, time)."""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from app.dialect.endpoint import Endpoint, TopicRole
from app.i18n import TextLike
from app.panel.base import TopicQos
from app.panel.model import Panel
from app.panel.widgets.families import TopicSource
from app.panel.widgets.parameter import Parameter
from app.panel.widgets.service_action import ServerCommand
from app.permission.mismatches import topic_mismatch
from app.permission.servers import call_blocked, parameters_offered, unsettable
from app.permission.verdict import Verdict
from app.robot.command_status import IDLE, OutcomeCode
from app.robot.parameter_state import UNKNOWN
from app.robot.state import RobotState
from app.robot.traffic import TopicTraffic, Undecodable
from app.view.parameter_values import parameter

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
    """The services and actions of the panel, in the order of its pages."""
    return [
        _server(widget, robot, now) for widget in panel.widgets() if isinstance(widget, ServerCommand)
    ]


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


def _judged(verdict: Verdict | None) -> tuple[RowState, TextLike]:
    """A server that works on a call is well."""
    if verdict is None or verdict.code in BUSY:
        return "ok", ""
    return "problem", verdict.reason or ""


def parameter_rows(panel: Panel, robot: RobotState) -> list[ParameterRow]:
    """The parameters of the panel, in the order of its pages."""
    return [*_parameters(panel, robot)]


def _parameters(panel: Panel, robot: RobotState) -> Iterator[ParameterRow]:
    timeout_hint = robot.traits.sentences.timeout_hint
    for widget in panel.parameters():
        known = robot.parameters.get(widget.id, UNKNOWN)
        status = robot.command_status.get(widget.id, IDLE)
        blocked = parameters_offered(widget.node, robot) or unsettable(widget, known, timeout_hint)
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
