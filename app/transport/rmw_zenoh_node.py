"""The panel's own node among a robot's nodes: /web_ui, with its publishers, subscribers and clients as
ROS tools list them. Nodes on rmw_zenoh need none of these tokens to exchange messages."""

from collections.abc import Iterable, Iterator

from app.dialect.auto_dialect import AutoDialect
from app.dialect.endpoint import OwnEndpoint
from app.dialect.rmw_zenoh_dialect import RmwZenohDialect
from app.dialect.rmw_zenoh_tokens import PANEL_NODE, free_name, parse_token
from app.interfaces.names import ROSOUT, ROSOUT_TOPIC, Qos
from app.panel.widgets.parameter import DESCRIBE, GET, SET
from app.panel.widgets.service_action import Call
from app.transport.peer import RobotContext
from app.transport.rosout import LOG_TYPE


class PanelNode:
    """The node of one robot's panel."""

    def __init__(self, context: RobotContext) -> None:
        self._panel = context.panel
        self._robot = context.robot
        self._link = context.link
        self.name = PANEL_NODE

    def choose_name(self, tokens: Iterable[str]) -> frozenset[str]:
        """Takes the first free name: another panel on this robot may have the usual one. Returns the
        names of all nodes."""
        parsed = [token for token in map(parse_token, tokens) if token is not None]
        self.name = free_name(token for token in parsed if token.zid != self._link.zid)
        return frozenset(token.node for token in parsed)

    def published_keys(self) -> list[str]:
        """The keys of the topics that the panel publishes, without its log."""
        return [self._robot.key(topic) for topic in self._panel.publications()]

    def tokens(self) -> list[str]:
        """All tokens that the panel holds now. What has another type on the robot is left out."""
        dialect, graph = self._robot.dialect, self._robot.graph
        assert isinstance(dialect, RmwZenohDialect | AutoDialect)
        own = [
            end
            for end in self._endpoints()
            if (end.role != "MP" and end.role != "MS")
            or graph.mismatched_type(end.role, end.key, end.type) is None
        ]
        return dialect.node_tokens(self._link.zid, self.name, own)

    def _endpoints(self) -> Iterator[OwnEndpoint]:
        panel, key = self._panel, self._robot.key
        for topic, name in panel.publications().items():
            yield OwnEndpoint("MP", key(topic), name, panel.qos(topic).wire_qos)
        yield OwnEndpoint("MP", key(ROSOUT_TOPIC), LOG_TYPE, ROSOUT)
        for topic, name in panel.subscriptions().items():
            yield OwnEndpoint("MS", key(topic), name, self._subscription_qos(topic))
        for topic, name in panel.on_demand().items():
            if key(topic) in self._robot.camera_topics:
                yield OwnEndpoint("MS", key(topic), name, self._subscription_qos(topic))
        for action, name in panel.actions().items():
            yield OwnEndpoint("AC", key(action), name)
        for widget in panel.widgets():
            if isinstance(widget, Call):
                yield OwnEndpoint("SC", key(widget.service), widget.type)
        for node in {widget.node for widget in panel.parameters()}:
            for service, name in (GET, DESCRIBE, SET):
                yield OwnEndpoint("SC", key(f"{node}/{service}"), name)

    def _subscription_qos(self, topic: str) -> Qos:
        """The panel's, with what it takes from the publisher."""
        panel, graph, key = self._panel, self._robot.graph, self._robot.key(topic)
        qos = panel.qos(topic).wire_qos
        if panel.qos(topic).durability is None:
            qos = qos._replace(transient_local=graph.is_transient_local(key) or False)
        if topic in panel.adaptive_topics and graph.is_reliable(key) is False:
            qos = qos._replace(reliable=False)
        return qos
