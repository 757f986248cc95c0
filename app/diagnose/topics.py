"""The panel's topics, services, actions and parameters in the robot's graph: there, of the right type,
definition, QoS and DDS. Pure."""

from collections.abc import Iterable, Sequence
from typing import Final

from app.diagnose.findings import Report
from app.diagnose.names import PanelNames
from app.i18n import TextLike, say
from app.interfaces import Interfaces
from app.interfaces.names import Qos
from app.panel.widgets.parameter import DESCRIBE, EVENTS, GET, SET
from app.panel.widgets.service_action import Call
from app.robot.definitions import differs, own_hash
from app.survey.forwarding import Forwarding, ServerList, TopicList
from app.survey.model import Server, TopicEndpoint

BEST_EFFORT: Final = say("finding_best_effort")
VOLATILE: Final = say("finding_volatile")
WANTS_RELIABLE: Final = say("finding_wants_reliable")
WANTS_LATCHED: Final = say("finding_wants_latched")


class TopicChecks:
    """Everything but permissions, which are judged by what they say too."""

    def __init__(
        self,
        report: Report,
        behind: PanelNames,
        interfaces: Interfaces,
        earlier: PanelNames | None = None,
    ) -> None:
        """`earlier` is what was there some seconds before: a bridge announces a new publisher late."""
        self._report = report
        self._earlier = earlier or behind
        self._behind = behind
        self._interfaces = interfaces
        self._panel = behind.robot.panel
        self._robot = behind.robot.id
        self._permissions = {interlock.topic for interlock in self._panel.interlocks}

    def check(self) -> None:
        for topic, wanted in self._panel.listened().items():
            if topic != EVENTS:
                self._check_listened(topic, wanted)
        for topic, wanted in self._panel.publications().items():
            self._check_published(topic, wanted)
        calls = {w.service: w.type for w in self._panel.senders() if isinstance(w, Call)}
        for name, wanted in calls.items():
            self._check_server("service", name, wanted, self._behind.services(name))
        for name, wanted in self._panel.actions().items():
            self._check_server("action", name, wanted, self._behind.actions(name))
        for node in dict.fromkeys(widget.node for widget in self._panel.parameters()):
            self._check_parameters(node)

    def _find(self, code: str, about: str, **details: object) -> None:
        self._report.find(code, about, robot=self._robot, **details)

    def _check_listened(self, topic: str, wanted: str) -> None:
        publishers = self._behind.publishers(topic)
        if not publishers:
            if topic not in self._permissions:
                hint = self._behind.hint(topic, "topics")
                self._find("topic_no_publisher", topic, hint=hint)
            return
        if not self._is_let_through("publishers", topic):
            return
        self._check_types(topic, wanted, publishers)
        qos = self._panel.qos(topic).wire_qos
        adapts = topic in self._panel.adaptive_topics
        if (
            qos.reliable
            and not adapts
            and any(publisher.qos.reliable is False for publisher in publishers)
        ):
            self._find("topic_qos", topic, detail=BEST_EFFORT)
        if qos.transient_local and not all(publisher.qos.transient_local for publisher in publishers):
            self._find("topic_qos", topic, detail=VOLATILE)
        routes = self._behind.routes(topic)
        if any(r.direction == "pub" and r.remote and not r.endpoint for r in routes):
            self._find("topic_unrouted", topic)

    def _check_published(self, topic: str, wanted: str) -> None:
        subscribers = self._behind.subscribers(topic)
        if not subscribers:
            hint = self._behind.hint(topic, "topics")
            self._find("topic_no_subscriber", topic, hint=hint)
            return
        if not self._is_let_through("subscribers", topic):
            return
        self._check_types(topic, wanted, subscribers)
        misfits = [_misfit(subscriber, self._panel.qos(topic).wire_qos) for subscriber in subscribers]
        if all(misfits):  # one that gets it is enough
            self._find("topic_qos", topic, detail=misfits[0])

    def _is_let_through(self, ends: TopicList, topic: str) -> bool:
        """Whether a bridge forwards a topic that is there. It finds why not, unless that is new."""
        known = [
            robots_behind.topic_forwarding(topic, ends)
            for robots_behind in (self._earlier, self._behind)
        ]
        return self._is_found("topic_unrouted", topic, known)

    def _is_served(self, name: str, kind: ServerList) -> bool:
        """The same, of a service or an action; True as well if no node offers it."""
        known = [
            robots_behind.server_forwarding(name, kind)
            for robots_behind in (self._earlier, self._behind)
        ]
        return self._is_found("server_unrouted", name, known)

    def _is_found(self, lost: str, name: str, known: Sequence[Forwarding | None]) -> bool:
        if known[-1] == "denied":
            self._find("bridge_denies", name)
        elif set(known) == {"lost"}:
            self._find(lost, name)
        else:
            return True
        return False

    def _check_types(self, topic: str, wanted: str, ends: Iterable[TopicEndpoint]) -> None:
        for end in ends:
            if end.type != wanted:
                self._find("topic_type", topic, found=end.type, wanted=wanted)
            elif self._differs(end.type_hash, wanted):
                self._find("definition_differs", topic, type=wanted)

    def _differs(self, theirs: str, type_name: str) -> bool:
        """Whether the robot's definition is known to be another one."""
        return differs(theirs, own_hash(type_name, self._interfaces))

    def _check_server(self, role: str, name: str, wanted: str, servers: Sequence[Server]) -> None:
        """`role` is "service" or "action"."""
        if not servers:
            if self._is_served(name, "service_servers" if role == "service" else "action_servers"):
                hint = self._behind.hint(name, "services" if role == "service" else "actions")
                self._find(f"{role}_absent", name, hint=hint)
            return
        for server in servers:
            if server.type != wanted:
                self._find(f"{role}_type", name, found=server.type, wanted=wanted)
            elif not server.can_be_called:
                self._find("wrong_rmw", name, vendor=server.dds)
            else:
                differing = (
                    type_name for type_name, theirs in server.hashes if self._differs(theirs, type_name)
                )
                if (part := next(differing, None)) is not None:
                    self._find("definition_differs", name, type=part)

    def _check_parameters(self, node: str) -> None:
        names = [f"{node}/{service}" for service, _ in (GET, DESCRIBE, SET)]
        served = [server for name in names for server in self._behind.services(name)]
        if all(self._is_served(name, "service_servers") for name in names) and not served:
            self._find("parameters_absent", node)
        for server in served:
            if not server.can_be_called:
                self._find("wrong_rmw", node, vendor=server.dds)


def _misfit(subscriber: TopicEndpoint, qos: Qos) -> TextLike:
    """Why a subscriber does not get what is published with this QoS; "" where it does."""
    if subscriber.qos.reliable and not qos.reliable:
        return WANTS_RELIABLE
    if subscriber.qos.transient_local and not qos.transient_local:
        return WANTS_LATCHED
    return ""
