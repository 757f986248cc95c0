"""The panel's own node among a robot's nodes: /web_ui, with its publishers, subscribers and clients as
ROS tools list them. Nodes on rmw_zenoh need none of these tokens to exchange messages."""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace

from app.dialect.auto_dialect import AutoDialect
from app.dialect.endpoint import OwnEndpoint
from app.dialect.rmw_zenoh_dialect import RmwZenohDialect
from app.dialect.rmw_zenoh_tokens import PANEL_NODE, free_name, parse_token
from app.interfaces.names import ROSOUT, ROSOUT_TOPIC, Qos
from app.panel.model import Panel
from app.panel.widgets.parameter import DESCRIBE, GET, SET
from app.panel.widgets.service_action import Call
from app.transport.peer import RobotContext
from app.transport.rosout import LOG_TYPE


def panel_endpoints(panel: Panel, key: Callable[[str], str]) -> Iterator[OwnEndpoint]:
    """All that the node of a panel can have, with the QoS of the panel file. `key` makes the key of a
    name."""
    for topic, name in panel.publications().items():
        yield OwnEndpoint("MP", key(topic), name, panel.qos(topic).wire_qos)
    yield OwnEndpoint("MP", key(ROSOUT_TOPIC), LOG_TYPE, ROSOUT)
    for topic, name in panel.listened().items():
        yield OwnEndpoint("MS", key(topic), name, panel.qos(topic).wire_qos)
    for action, name in panel.actions().items():
        yield OwnEndpoint("AC", key(action), name)
    for widget in panel.senders():
        if isinstance(widget, Call):
            yield OwnEndpoint("SC", key(widget.service), widget.type)
    for node in {widget.node for widget in panel.parameters()}:
        for service, name in (GET, DESCRIBE, SET):
            yield OwnEndpoint("SC", key(f"{node}/{service}"), name)


class PanelNode:
    """The node of one robot's panel."""

    def __init__(self, context: RobotContext) -> None:
        self._panel = context.panel
        self._robot = context.robot
        self._link = context.link
        self.name = PANEL_NODE
        panel, key = context.panel, context.robot.key
        listened = panel.listened()
        self._any_durability = {key(topic) for topic in listened if panel.qos(topic).durability is None}
        self._adaptive = {key(topic) for topic in panel.adaptive_topics}

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
        panel = self._panel
        shown = panel.on_demand().keys() - panel.subscriptions().keys()
        on_demand = {self._robot.key(topic) for topic in shown}
        for end in panel_endpoints(panel, self._robot.key):
            if end.role != "MS":
                yield end
            elif end.key not in on_demand or end.key in self._robot.camera_topics:
                yield replace(end, qos=self._subscription_qos(end))

    def _subscription_qos(self, end: OwnEndpoint) -> Qos:
        """The panel's, with what it takes from the publisher."""
        graph, key, qos = self._robot.graph, end.key, end.qos
        if key in self._any_durability:
            qos = qos._replace(transient_local=graph.is_transient_local(key) or False)
        if key in self._adaptive and graph.is_reliable(key) is False:
            qos = qos._replace(reliable=False)
        return qos
