"""Descriptions of nodes, topics, services and actions, and of bridges if there are some. Frozen.

Names are as on the robot ("/speed"). A bridge may put its namespace before them, that is
`RobotGraph.namespace`, "" for none. A `key` is the name behind that namespace without its first slash
("robot1/speed"). The fields `bridge` are the ids of bridges; of a robot that is reached without one,
those of its nodes' Zenoh sessions.
"""

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from difflib import get_close_matches
from typing import Annotated, Any, Final, Literal, Protocol, TypeVar

from app.ros.messages.names import MAX_NAME, key_of
from app.system.printable import one_line
from app.system.public import Public, PublicHash, PublicName, PublicNumber, PublicType

CYCLONE_DDS: Final = "Cyclone DDS"
CALLABLE: Final = ("", CYCLONE_DDS)  # of a server; "": its DDS is not known
NEAR_MOST: Final = 3
COMPARED_MOST: Final = 1000  # names whose spelling is compared with one

# What other programs announce is public in the form of what it should be.
PublicVersion = Annotated[str, Public(r"(?a:v?\d[\w.+\-]{0,60})?")]
PublicTypeHash = Annotated[str, Public(r"(?:RIHS01_[0-9a-f]{64})?")]
PublicVendor = Annotated[
    str, Public(rf"|{CYCLONE_DDS}|Fast DDS|Connext|OpenSplice|OpenDDS|GurumDDS|CoreDX DDS")
]

RouteKind = Literal["topic", "service", "action"]
# pub and srv: from the robot's nodes to Zenoh; sub and cli: from Zenoh to the robot's nodes.
RouteDirection = Literal["pub", "sub", "srv", "cli"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Bridge:
    """A bridge that announced itself. `version` is "" if it did not answer. `config` is the
    configuration of its ROS plugin, empty if it did not answer."""

    zid: PublicHash
    version: PublicVersion = ""
    config: Mapping[str, Any] = field(default_factory=dict)

    @property
    def answers(self) -> bool:
        return bool(self.version)

    @property
    def namespace(self) -> str:
        """Like "/robot1"; "" for none. One that can't be a namespace is in escapes."""
        namespace = self.config.get("namespace")
        return one_line(namespace.rstrip("/"), MAX_NAME) if isinstance(namespace, str) else ""

    @property
    def domain(self) -> int | None:
        """The ROS_DOMAIN_ID that it joined; None if unknown."""
        domain = self.config.get("domain")
        return domain if isinstance(domain, int) else None

    @property
    def node(self) -> str:
        """Its own node's name in ROS; "" if unknown."""
        name = self.config.get("nodename")
        return f"/{name}" if isinstance(name, str) else ""


@dataclass(frozen=True, slots=True, kw_only=True)
class EndpointQos:
    """The QoS of one publisher or subscriber. None: not known. Fast DDS does not announce its depth."""

    reliable: bool | None = None
    transient_local: bool = False
    keep_all: bool = False
    depth: PublicNumber | None = None

    def __str__(self) -> str:
        known = {True: "reliable", False: "best effort", None: "reliability unknown"}
        words = [known[self.reliable], "transient local" if self.transient_local else "volatile"]
        if self.keep_all:
            words.append("keep all")
        elif self.depth is not None:
            words.append(f"depth {self.depth}")
        return ", ".join(words)


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicEndpoint:
    """A publisher or a subscriber of a topic.

    `bridge` is the one behind which it is, "" without one. `nodes` are the nodes that it may belong to:
    one, or several of one process, or none if unknown.
    `dds` is the vendor of its DDS ("Fast DDS", "Cyclone DDS", another, or "" if unknown).
    """

    type: PublicType
    qos: EndpointQos
    bridge: PublicHash = ""
    nodes: tuple[PublicName, ...] = ()
    dds: PublicVendor = ""
    type_hash: PublicTypeHash = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class SurveyedTopic:
    """A topic of a robot. `announced`: its bridge passes it on; else the bridge's `allow` or `deny`
    holds it back."""

    name: PublicName
    key: PublicName
    publishers: tuple[TopicEndpoint, ...] = ()
    subscribers: tuple[TopicEndpoint, ...] = ()
    announced: bool = True

    @property
    def types(self) -> tuple[str, ...]:
        """Each type once, the publishers' first: one, unless two nodes disagree."""
        return tuple(dict.fromkeys(e.type for e in (*self.publishers, *self.subscribers)))

    @property
    def type(self) -> str:
        return next(iter(self.types), "")

    @property
    def latched(self) -> bool:
        """Whether all its publishers keep their last message for late subscribers."""
        return bool(self.publishers) and all(e.qos.transient_local for e in self.publishers)

    @property
    def reliable(self) -> bool:
        """Whether none of its publishers is best effort."""
        return all(e.qos.reliable is not False for e in self.publishers)


@dataclass(frozen=True, slots=True, kw_only=True)
class Server:
    """A service or an action of a robot. `nodes` serve it; `dds` is their DDS, "" if unknown. Through
    the bridge only servers on Cyclone DDS can be called. `hashes` are (message type, type hash) of its
    requests and responses, as far as known."""

    name: PublicName
    key: PublicName
    type: PublicType
    bridge: PublicHash = ""
    nodes: tuple[PublicName, ...] = ()
    dds: PublicVendor = ""
    hashes: tuple[tuple[str, str], ...] = ()

    @property
    def can_be_called(self) -> bool:
        """False for a server on another DDS: it would not answer, and may misread the request."""
        return self.dds in CALLABLE


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A node; the names of what it publishes, subscribes to, serves and uses."""

    name: PublicName
    bridge: PublicHash = ""
    dds: PublicVendor = ""
    publishers: tuple[PublicName, ...] = ()
    subscribers: tuple[PublicName, ...] = ()
    services: tuple[PublicName, ...] = ()
    clients: tuple[PublicName, ...] = ()
    actions: tuple[PublicName, ...] = ()
    action_clients: tuple[PublicName, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class BridgeRoute:
    """A route of a bridge. `local_nodes` are of the robot, `remote` the Zenoh peers ("<zid>:<key>")
    that use it. `active`: None if the bridge does not report it. `endpoint` is the bridge's own DDS
    reader or writer for it, "" for none."""

    bridge: PublicHash
    kind: RouteKind
    direction: RouteDirection
    name: PublicName
    key: PublicName
    type: PublicType
    active: bool | None = None
    local_nodes: tuple[PublicName, ...] = ()
    remote: tuple[str, ...] = ()
    endpoint: PublicHash = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class PeerEndpoint:
    """A publisher (role "MP") or subscriber ("MS") of a peer that is no bridge, such as a panel."""

    zid: PublicHash
    role: str
    key: PublicName
    type: PublicType
    qos: EndpointQos


class _Named(Protocol):
    @property
    def name(self) -> str: ...


NamedItem = TypeVar("NamedItem", bound=_Named)


@dataclass(frozen=True, slots=True, kw_only=True)
class RobotGraph:
    """What is on one robot: all that is behind the bridges of one namespace, or that is reached without
    a bridge. `bridges` and `routes` are empty for a robot without one. Each list is sorted by name."""

    namespace: PublicName = ""
    bridges: tuple[Bridge, ...] = ()
    nodes: tuple[Node, ...] = ()
    topics: tuple[SurveyedTopic, ...] = ()
    services: tuple[Server, ...] = ()
    actions: tuple[Server, ...] = ()
    routes: tuple[BridgeRoute, ...] = ()

    @property
    def answers(self) -> bool:
        """False if it is behind bridges of which none answers."""
        return not self.bridges or any(bridge.answers for bridge in self.bridges)

    @property
    def has_dds_qos(self) -> bool:
        """Whether publishers and subscribers need a compatible QoS: without a bridge there is no
        DDS."""
        return bool(self.bridges)

    def topic(self, name: str) -> SurveyedTopic | None:
        return find(self.topics, name)

    def node(self, name: str) -> Node | None:
        return find(self.nodes, name)

    def service(self, name: str) -> Server | None:
        return find(self.services, name)

    def action(self, name: str) -> Server | None:
        return find(self.actions, name)

    def key(self, name: str) -> str:
        """The key of a topic or service by its name on the robot; ValueError for a malformed name."""
        return key_of(name, self.namespace)


@dataclass(frozen=True, slots=True, kw_only=True)
class GraphSnapshot:
    """The ROS graph of all robots on one link at one moment, by namespace. Bridges of one namespace are
    one robot's. `peers` are the endpoints of panels and tools, as far as the router reports them: to
    peers it reports only clients. `BridgeRoute.remote` has all peers that use a route."""

    robots: tuple[RobotGraph, ...] = ()
    peers: tuple[PeerEndpoint, ...] = ()

    @property
    def bridges(self) -> tuple[Bridge, ...]:
        return tuple(bridge for robot in self.robots for bridge in robot.bridges)

    def silent_since(self, earlier: "GraphSnapshot") -> list[str]:
        """The ids of the bridges that answered for an earlier graph and not for this one."""
        answering = {bridge.zid for bridge in self.bridges if bridge.answers}
        return sorted({bridge.zid for bridge in earlier.bridges if bridge.answers} - answering)

    def robot(self, namespace: str) -> RobotGraph | None:
        """The robot whose bridges have this namespace ("" for none)."""
        return next((robot for robot in self.robots if robot.namespace == namespace.rstrip("/")), None)


def find(entries: Sequence[NamedItem], name: str) -> NamedItem | None:
    return next((entry for entry in entries if entry.name == name), None)


def near(name: str, known: Iterable[str]) -> list[str]:
    """Known names that are similar to one that does not exist: typing errors first, then the same last
    part in other namespaces."""
    names = list(known)
    last = name.rpartition("/")[2].lower()
    same = [candidate for candidate in names if candidate.rpartition("/")[2].lower() == last]
    return list(dict.fromkeys([*same, *get_close_matches(name, names[:COMPARED_MOST], NEAR_MOST)]))[
        :NEAR_MOST
    ]


# Whether a robot's bridges forward a topic, service or action that its nodes have. Pure.
#
# "denied": the `allow` or `deny` of the bridge's file holds it back. "lost": the file lets it through,
# and the bridge does not announce it all the same. It may be new: a bridge knows a name some time
# before it announces it. If it stays so, the bridge has lost it: this happens about 20 s after a node
# was killed and restarted at once (its issue 702).

Forwarding = Literal["forwarded", "denied", "lost"]
# The lists of a bridge's `allow` and `deny`.
TopicList = Literal["publishers", "subscribers"]
ServerList = Literal["service_servers", "action_servers"]
BOTH: Final[tuple[TopicList, ...]] = ("publishers", "subscribers")
MOST_PATTERN: Final = 100_000  # characters
MOST_REPEATS: Final = 3  # in one alternative
_REPEAT: Final = re.compile(r"[*+{]")
_REPEATED: Final = re.compile(r"\)[*+{]")  # of a group
OF_ACTIONS: Final = "/_action/"  # the services that an action is made of


def topic_forwarding(
    robot: RobotGraph, topic: SurveyedTopic, lists: Sequence[TopicList] = BOTH
) -> Forwarding:
    """Of a topic's publishers, its subscribers, or both."""
    if topic.announced:
        return "forwarded"
    ends = {"publishers": topic.publishers, "subscribers": topic.subscribers}
    held = [_is_denied(robot, end.bridge, key, topic.name) for key in lists for end in ends[key]]
    return "denied" if all(held) else "lost"


def server_forwarding(robot: RobotGraph, kind: ServerList, name: str) -> Forwarding | None:
    """Of a service or an action; None if no node offers it."""
    servers = robot.services if kind == "service_servers" else robot.actions
    if any(server.name == name for server in servers):
        return "forwarded"
    held = [_is_denied(robot, n.bridge, kind, name) for n in robot.nodes if name in _offers(n, kind)]
    return ("denied" if all(held) else "lost") if held else None


def lost_topics(robot: RobotGraph) -> Iterator[SurveyedTopic]:
    """The topics that the bridge has lost."""
    return (topic for topic in robot.topics if topic_forwarding(robot, topic) == "lost")


def lost_servers(robot: RobotGraph) -> Iterator[str]:
    """The names of the services and actions that the bridge has lost, each once."""
    kinds: tuple[ServerList, ...] = ("service_servers", "action_servers")
    names = {
        (kind, name): None for node in robot.nodes for kind in kinds for name in _offers(node, kind)
    }
    for kind, name in sorted(names):
        if OF_ACTIONS not in name and server_forwarding(robot, kind, name) == "lost":
            yield name


def _offers(node: Node, kind: ServerList) -> tuple[str, ...]:
    return node.services if kind == "service_servers" else node.actions


def _is_denied(robot: RobotGraph, zid: str, kind: str, name: str) -> bool:
    return denies([bridge for bridge in robot.bridges if bridge.zid == zid], kind, name)


def denies(bridges: Sequence[Bridge], kind: str, name: str) -> bool:
    """Whether a bridge's file holds a name back: `kind` is "publishers", "service_servers" or another
    of its lists. The bridge gives each list as one regular expression."""
    return any(_denied(bridge.config, kind, name) for bridge in bridges)


def _denied(config: Mapping[str, Any], kind: str, name: str) -> bool:
    for key, is_denied in _lists(config):
        if not isinstance(key, dict):
            continue
        pattern = key.get(kind)
        listed = isinstance(pattern, str) and _matches(pattern, name)
        return listed if is_denied else not listed
    return False


def _lists(config: Mapping[str, Any]) -> Iterator[tuple[Any, bool]]:
    yield config.get("allow"), False
    yield config.get("deny"), True


def _matches(pattern: str, name: str) -> bool:
    if not _is_quick(pattern):
        return True
    try:
        return re.search(pattern, name) is not None
    except re.error:  # Rust knows some that Python does not: then it is not known
        return True


def _is_quick(pattern: str) -> bool:
    """Whether Python decides it in a short time: unlike Rust's, its expressions may take for ever. The
    others are not tried."""
    repeats = (len(_REPEAT.findall(alternative)) for alternative in pattern.split("|"))
    return (
        len(pattern) <= MOST_PATTERN and not _REPEATED.search(pattern) and max(repeats) <= MOST_REPEATS
    )
