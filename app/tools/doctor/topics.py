"""The panel's topics, services, actions and parameters in the robot's graph, and its interlocks.
Pure."""

from collections import Counter
from collections.abc import Iterable, Sequence
from typing import Any, Final

from app.cell.permission.conditions import permits, refusal
from app.cell.robot.clocks import RobotClock
from app.cell.robot.definitions import differs, own_hash
from app.panel.condition import Interlock
from app.panel.widgets.map_layers import UPDATE_TYPE
from app.panel.widgets.parameter import EVENTS, SERVICES
from app.ros.cdr.stamped import begins_with_stamp
from app.ros.graph.model import Forwarding, Server, ServerList, TopicEndpoint, TopicList
from app.ros.messages import Interfaces, has_key
from app.ros.messages.names import Qos
from app.ros.zenoh.sample import Sample
from app.system.errors import DecodeError
from app.system.texts import TextLike, render, say
from app.tools.doctor.findings import Report
from app.tools.doctor.names import PanelNames
from app.tools.doctor.received import ReceivedSamples

# The panel's topics, services, actions and parameters in the robot's graph: there, of the right type,
# definition, QoS and DDS. Pure.

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
        for name, wanted in self._panel.called_services().items():
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
            if topic not in self._permissions and wanted != UPDATE_TYPE:  # few robots publish these
                hint = self._behind.hint(topic, "topics")
                self._find("topic_no_publisher", topic, hint=hint)
            return
        if not self._is_let_through("publishers", topic):
            return
        self._check_types(topic, wanted, publishers)
        routes = self._behind.routes(topic)
        if any(r.direction == "pub" and r.remote and not r.endpoint for r in routes):
            self._find("topic_unrouted", topic)
        if not self._behind.has_dds_qos:
            return
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

    def _check_published(self, topic: str, wanted: str) -> None:
        subscribers = self._behind.subscribers(topic)
        if not subscribers:
            hint = self._behind.hint(topic, "topics")
            self._find("topic_no_subscriber", topic, hint=hint)
            return
        if not self._is_let_through("subscribers", topic):
            return
        self._check_types(topic, wanted, subscribers)
        offered = self._panel.qos(topic).wire_qos
        mismatches = [_qos_mismatch(subscriber, offered) for subscriber in subscribers]
        if all(mismatches) and self._behind.has_dds_qos:  # one that gets it is enough
            self._find("topic_qos", topic, detail=mismatches[0])

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
        names = [f"{node}/{service}" for service, _ in SERVICES]
        served = [server for name in names for server in self._behind.services(name)]
        if all(self._is_served(name, "service_servers") for name in names) and not served:
            self._find("parameters_absent", node)
        for server in served:
            if not server.can_be_called:
                self._find("wrong_rmw", node, vendor=server.dds)


def _qos_mismatch(subscriber: TopicEndpoint, qos: Qos) -> TextLike:
    """Why a subscriber does not get what is published with this QoS; "" where it does."""
    if subscriber.qos.reliable and not qos.reliable:
        return WANTS_RELIABLE
    if subscriber.qos.transient_local and not qos.transient_local:
        return WANTS_LATCHED
    return ""


# The panel's interlocks: whether their publishers stay, repeat themselves and permit now. Pure.

REGULAR: Final = 2  # messages while one listens


def check_permissions(
    report: Report, behind: PanelNames, observed: ReceivedSamples, interfaces: Interfaces
) -> None:
    for topic in dict.fromkeys(interlock.topic for interlock in behind.robot.panel.interlocks):
        _check_topic(report, behind, observed, topic)
    for interlock in behind.robot.panel.interlocks:
        _check_value(report, behind, observed, interlock, interfaces)


def _check_topic(report: Report, behind: PanelNames, observed: ReceivedSamples, topic: str) -> None:
    """Whether its publisher stays, and a panel that starts later would get a permission."""
    using = [interlock for interlock in behind.robot.panel.interlocks if interlock.topic == topic]
    key, ids = behind.robot.key(topic), ", ".join(interlock.id for interlock in using)
    count, window = len(observed.live(key)), f"{observed.window_s:.1f}"
    publishers = behind.publishers(topic)
    robot = behind.robot.id
    if not publishers:
        if observed.samples[key] or key in observed.lost:
            report.find("permission_ends", topic, robot=robot, ids=ids)
        else:
            hint = behind.hint(topic, "topics")
            report.find("permission_no_publisher", topic, robot=robot, ids=ids, hint=hint)
        return
    _check_publishers(report, publishers, using, robot)
    if behind.topic_forwarding(topic, "publishers") != "forwarded":
        return  # it is found as a topic
    limits = [interlock.max_age_s for interlock in using if interlock.max_age_s is not None]
    if limits and observed.longest_gap(key) > min(limits):
        report.find(
            "permission_stale",
            topic,
            robot=robot,
            ids=ids,
            count=count,
            window=window,
            limit=f"{min(limits):g}",
        )
    elif count < REGULAR and not any(publisher.qos.transient_local for publisher in publishers):
        report.find("permission_not_latched", topic, robot=robot, ids=ids, count=count, window=window)
    else:
        report.fact(f"permission {topic} came {len(observed.samples[key])} times in {window} s")


def _check_publishers(
    report: Report, publishers: Sequence[TopicEndpoint], using: Sequence[Interlock], robot: str
) -> None:
    """Whether several nodes publish a value of which the last one counts. Two bridges of one domain
    know the same publishers."""
    number = max(Counter(publisher.bridge for publisher in publishers).values())
    whole = [interlock.id for interlock in using if not has_key(interlock.field)]
    if number > 1 and whole:
        nodes = ", ".join(sorted({node for publisher in publishers for node in publisher.nodes})) or "?"
        ids, topic = ", ".join(whole), using[0].topic
        report.find("permission_publishers", topic, robot=robot, ids=ids, count=number, nodes=nodes)


def _check_value(
    report: Report,
    behind: PanelNames,
    observed: ReceivedSamples,
    interlock: Interlock,
    interfaces: Interfaces,
) -> None:
    """Whether the last value permits; nothing is said of one that is unknown."""
    key = behind.robot.key(interlock.topic)
    samples = observed.samples[key]
    if not samples:
        return
    try:
        clock = observed.clock(key, is_stamped=begins_with_stamp(interlock.type, interfaces.structures))
        value = _last_value(samples, interlock, interfaces, clock)
    except DecodeError:  # another type, which is said of the topic
        return
    if permits(interlock, value):
        return
    reason = refusal(interlock, value).reason or ""
    report.find("permission_refused", interlock.topic, robot=behind.robot.id, detail=render(reason))


def _last_value(
    samples: Sequence[Sample], interlock: Interlock, interfaces: Interfaces, clock: RobotClock
) -> Any:
    """The newest value; of a field with a key, that of the newest message which has it."""
    reader = interfaces.field_reader(interlock.type, [interlock.field])
    newest = samples[::-1] if has_key(interlock.field) else samples[-1:]
    fields = (reader.read(bytes(each.payload), clock.time_at(each.wall)) for each in newest)
    values = (each.get(interlock.field) for each in fields)
    return next((value for value in values if value is not None), None)
