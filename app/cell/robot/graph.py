"""The robot's ROS graph, from its peers' liveliness tokens and admin space. A peer is a bridge, or a
Zenoh session of the robot's own nodes.

Endpoints are indexed by key, so that a query costs the same for any size of graph.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any, Final, Protocol, TypeVar, TypeVarTuple

from app.panel.model import Panel
from app.ros.dialects.dialect import (
    DEMO_NODE,
    DEMO_VERSION,
    Dialect,
    Direction,
    Endpoint,
    Role,
    ServerRole,
    TopicRole,
    within,
)
from app.ros.messages.names import Qos

# Results of queries of a graph that are kept until it changes.


class Caching(Protocol):
    """What has results to keep; it clears them when it changes."""

    cache: dict[Any, Any]


AnyCaching = TypeVar("AnyCaching", bound=Caching)
Arguments = TypeVarTuple("Arguments")
Result = TypeVar("Result")


def cached_until_change(
    query: Callable[[AnyCaching, *Arguments], Result],
) -> Callable[[AnyCaching, *Arguments], Result]:
    """Caches the results of a query until the graph changes: queries are far more frequent."""

    def cached(graph: AnyCaching, *arguments: *Arguments) -> Result:
        key = (query, arguments)
        result: Result
        try:
            result = graph.cache[key]
        except KeyError:
            result = graph.cache[key] = query(graph, *arguments)
        return result

    cached.__doc__ = query.__doc__
    return cached


# Why DDS would not match a publisher and a subscriber, by their QoS: the codes of sentences. Pure.


def reader_mismatch(publisher: Endpoint, qos: Qos) -> str | None:
    """Why a subscription with this QoS does not match a publisher."""
    if qos.reliable and publisher.reliable is False:
        return "qos_robot_best_effort"
    if qos.transient_local and not publisher.transient_local:
        return "qos_robot_volatile"
    return None


def writer_mismatch(subscriber: Endpoint, qos: Qos) -> str | None:
    """Why a subscriber does not match a publisher with this QoS."""
    if not qos.reliable and subscriber.reliable:
        return "qos_robot_requires_reliable"
    if not qos.transient_local and subscriber.transient_local:
        return "qos_robot_requires_transient_local"
    return None


# The endpoints whose type must equal the panel's, by the panel's role on a topic. A route of a bridge
# has one type: that of the endpoint that created it, of the robot or of another panel.
_COUNTERPARTS: Mapping[TopicRole, tuple[Role, Role, Direction]] = {
    # The panel subscribes: the robot's publishers, other panels' subscribers.
    "MS": ("MP", "MS", "pub"),
    # The panel publishes: the robot's subscribers, other panels' publishers.
    "MP": ("MS", "MP", "sub"),
}


@dataclass(frozen=True, slots=True)
class Route:
    """A peer's route for a topic, as a bridge has them; `has_reader` is False if its DDS reader is
    missing."""

    zid: str
    direction: Direction
    key: str
    type: str
    has_reader: bool = True


class LiveGraph:
    """The current ROS graph behind all peers. Changed on the event loop only, by `apply_token` and
    the `update_…` methods."""

    def __init__(
        self,
        dialect: Dialect,
        own_zid: str = "",
        namespace: str | None = None,
        keys: Collection[str] | None = None,
    ) -> None:
        """`namespace` distinguishes this robot's peers from others; None: all peers belong to it.
        Only tokens for `keys` are kept; None: all."""
        self.dialect = dialect
        self.own_zid = own_zid  # of the panel's session: its tokens are ignored
        self._relevant_names = None if keys is None else frozenset(map(dialect.in_token, keys))
        self.cache: dict[Any, Any] = {}  # see `cached_until_change`
        self._namespace = namespace
        self._peers: dict[str, set[str]] = {}  # their own tokens, by zid
        self._namespaces: dict[str, str] = {}  # of peers
        self.panels: dict[str, Endpoint] = {}  # the nodes of other panels, by token
        self._tokens: defaultdict[str, dict[str, Endpoint]] = defaultdict(dict)
        self._alive_since: dict[str, float] = {}  # of tokens
        self._routes: defaultdict[str, list[Route]] = defaultdict(list)
        self._nodes: defaultdict[str, list[Endpoint]] = defaultdict(list)
        self.nodes_read_at = -math.inf  # monotonic seconds: when the last query of the nodes began
        self._versions: Mapping[str, str] | None = None

    def is_relevant(self, token_key: str) -> bool:
        """Whether a token is a peer's own, or for one of the keys that are kept."""
        if self._relevant_names is None:
            return True
        name = self.dialect.name_in(token_key)
        return not name or name in self._relevant_names

    def has_token(self, token_key: str) -> bool:
        """Whether a token has been applied and has not ended."""
        endpoint = self.dialect.endpoint(token_key)
        return endpoint is not None and token_key in self._tokens.get(endpoint.key, {})

    def apply_token(self, token_key: str, alive: bool, now: float = -math.inf) -> str | None:
        """Applies a token's appearance (`now`, monotonic seconds) or end; returns the zid of a peer
        that appeared or was lost."""
        endpoint = self.dialect.endpoint(token_key) if self.is_relevant(token_key) else None
        if endpoint is None:
            self._apply_panel(token_key, alive)
            return None
        if endpoint.zid == self.own_zid:
            return None
        self.cache.clear()
        if endpoint.role is None:
            return self._apply_peer(endpoint.zid, token_key, alive)
        if alive:
            self._tokens[endpoint.key][token_key] = endpoint
            self._alive_since[token_key] = now
        else:
            self._remove_token(endpoint.key, token_key)
        return None

    def _apply_panel(self, token_key: str, alive: bool) -> None:
        panel = self.dialect.panel_node(token_key)
        if not alive:
            self.panels.pop(token_key, None)
        elif panel is not None and panel.zid != self.own_zid:
            self.panels[token_key] = panel

    def _remove_token(self, key: str, token_key: str) -> None:
        """Keeps nothing of an ended node: many nodes appear only once."""
        tokens = self._tokens.get(key, {})
        tokens.pop(token_key, None)
        if not tokens:
            self._tokens.pop(key, None)
        self._alive_since.pop(token_key, None)

    def _apply_peer(self, zid: str, token_key: str, alive: bool) -> str | None:
        """A session may have several tokens of its own: one for each of its nodes. It appears with the
        first of them and is lost with the last."""
        if alive:
            known = zid in self._peers
            self._peers.setdefault(zid, set()).add(token_key)
            if known:
                return None
            self._versions = None  # the new peer has not been queried yet
            return zid
        tokens = self._peers.get(zid, set())
        tokens.discard(token_key)
        if tokens or zid not in self._peers:
            return None
        del self._peers[zid]
        self._namespaces.pop(zid, None)
        return zid

    def update_routes(
        self, routes: Iterable[Route], nodes: Iterable[Endpoint] = (), read_at: float = -math.inf
    ) -> None:
        """Replaces the peers' routes, and the endpoints of the nodes behind them, whose types may
        differ from the route's. `read_at` (monotonic seconds) is when the query of the nodes began."""
        self.cache.clear()
        self.nodes_read_at = read_at
        self._routes.clear()
        self._nodes.clear()
        for route in routes:
            self._routes[route.key].append(route)
        for node in nodes:
            self._nodes[node.key].append(node)

    def update_versions(self, versions: Mapping[str, str]) -> None:
        """Replaces the versions of the peers that responded, by zid."""
        self.cache.clear()
        self._versions = versions

    def update_namespaces(self, namespaces: Mapping[str, str]) -> None:
        """Adds the namespaces of peers, by zid ("" for none)."""
        self.cache.clear()
        self._namespaces |= namespaces

    @property
    @cached_until_change
    def peers(self) -> frozenset[str]:
        """The zids of this robot's peers. If none has its namespace, those with an unknown
        namespace."""
        own = self._namespace
        known = ((zid, self._namespaces[zid]) for zid in self._peers.keys() & self._namespaces.keys())
        matching = {zid for zid, namespace in known if own is None or within(own, namespace)}
        return frozenset(matching or self._peers.keys() - self._namespaces.keys())

    @property
    def every_peer(self) -> Collection[str]:
        """The zids of all peers, also of other robots'."""
        return self._peers.keys()

    @property
    def namespaces(self) -> set[str]:
        """The namespaces of this robot's peers, as far as they are known."""
        return {namespace for zid, namespace in self._namespaces.items() if zid in self.peers}

    @property
    @cached_until_change
    def has_silent_peer(self) -> bool:
        """Whether a peer has a token but did not respond to the last query."""
        versions = self._versions
        return versions is not None and bool(self.peers - versions.keys())

    @property
    @cached_until_change
    def is_simulated(self) -> bool:
        """Whether a peer is that of the simulated robot."""
        versions = self._versions or {}
        return DEMO_NODE in self.nodes or any(versions.get(zid) == DEMO_VERSION for zid in self.peers)

    @property
    @cached_until_change
    def nodes(self) -> frozenset[str]:
        """The names of the nodes that have tokens of their own, such as "/arm/driver"."""
        ends = map(self.dialect.endpoint, self.peer_tokens)
        return frozenset(e.node for e in ends if e is not None and e.node)

    @property
    def peer_tokens(self) -> list[str]:
        """The tokens of peers themselves."""
        return [*chain.from_iterable(self._peers.values())]

    @cached_until_change
    def tokens_of(self, role: Role, key: str) -> Mapping[str, Endpoint]:
        """Token → endpoint of each one that is there now."""
        tokens = self._tokens.get(key, {}).items()
        return {token: e for token, e in tokens if e.role == role and e.zid in self._peers}

    def _endpoints(self, role: Role, key: str) -> Collection[Endpoint]:
        return self.tokens_of(role, key).values()

    def peers_with(self, role: Role, key: str) -> frozenset[str]:
        """The zids of the peers behind which a node publishes, subscribes or serves."""
        return frozenset(e.zid for e in self._endpoints(role, key))

    def announces(self, zid: str, role: Role, key: str) -> bool:
        """Whether a session, also one that is no peer, has a token of this endpoint."""
        return any(e.zid == zid and e.role == role for e in self._tokens.get(key, {}).values())

    def has_endpoint(self, role: Role, key: str) -> bool:
        """Whether a node behind a peer publishes, subscribes or serves."""
        return bool(self._endpoints(role, key))

    @cached_until_change
    def node_endpoints(self, role: Role, key: str) -> list[Endpoint]:
        """Those of the robot's nodes, as the peers knew them when they were queried last."""
        return [e for e in self._nodes.get(key, ()) if e.role == role and e.zid in self._peers]

    @cached_until_change
    def described_endpoints(self, role: Role, key: str) -> list[Endpoint]:
        """The endpoints of the robot whose QoS and hashes may be known. A bridge's token is of the
        first publisher or subscriber; it stays if that one ends and another is there. So it counts
        only until the nodes have been read."""
        nodes = [e for e in self.node_endpoints(role, key) if e.hashes or e.reliable is not None]
        is_read = self.since(role, key) <= self.nodes_read_at
        read = {e.zid for e in nodes} if is_read else set()
        return [*(e for e in self._endpoints(role, key) if e.zid not in read), *nodes]

    def server_type(self, role: ServerRole, key: str) -> str | None:
        """The type of the robot's service or action; None if there is no server now."""
        return next((e.type for e in self._endpoints(role, key)), None)

    @cached_until_change
    def since(self, role: Role | None, key: str) -> float:
        """When the newest endpoint of this name appeared (monotonic seconds); -inf without one."""
        tokens = self._tokens.get(key, {}).items()
        times = (self._alive_since[t] for t, e in tokens if e.role == role and e.zid in self._peers)
        return max(times, default=-math.inf)

    def is_transient_local(self, key: str) -> bool | None:
        """Whether the robot's publisher is TRANSIENT_LOCAL; None without a publisher."""
        return next((e.transient_local for e in self._endpoints("MP", key)), None)

    def is_reliable(self, key: str) -> bool | None:
        """Whether no publisher of the robot is best effort; None without a publisher."""
        if not self.has_endpoint("MP", key):
            return None
        return all(e.reliable is not False for e in self.described_endpoints("MP", key))

    def is_volatile(self, key: str) -> bool:
        """Whether the robot's publishers are known, and none is TRANSIENT_LOCAL."""
        known = self._endpoints("MP", key)
        return bool(known) and not any(e.transient_local for e in known)

    @cached_until_change
    def is_unrouted(self, key: str) -> bool:
        """Whether the robot publishes a topic that its peer does not forward to the panel."""
        publishing = {e.zid for e in self._endpoints("MP", key)}
        return any(
            r.direction == "pub" and not r.has_reader and r.zid in publishing
            for r in self._routes.get(key, [])
        )

    @cached_until_change
    def mismatched_type(self, role: TopicRole, key: str, type_name: str) -> str | None:
        """The type of a counterpart or route that differs from `type_name`; None if all are equal."""
        theirs, others, direction = _COUNTERPARTS[role]
        for endpoint in chain(self._tokens.get(key, {}).values(), self._nodes.get(key, [])):
            counts = endpoint.role == (theirs if endpoint.zid in self._peers else others)
            if counts and endpoint.type != type_name:
                return endpoint.type
        for route in self._routes.get(key, []):
            there = route.zid in self._peers and route.direction == direction
            if there and route.type != type_name:
                return route.type
        return None

    @cached_until_change
    def mismatched_qos(self, role: TopicRole, key: str, qos: Qos) -> str | None:
        """The code of the sentence about a QoS that does not match; None if it matches.

        All publishers must match: one that is not received may publish something else. One matching
        subscriber is enough.
        """
        theirs = self.described_endpoints(_COUNTERPARTS[role][0], key)
        mismatches = [
            reader_mismatch(e, qos) if role == "MS" else writer_mismatch(e, qos) for e in theirs
        ]
        if role == "MP" and None in mismatches:
            return None
        return next(filter(None, mismatches), None)


# The endpoints of the robot (publishers, subscribers, servers) that a panel needs, and which of them
# are missing while their peer is connected.

RequiredEndpoint = tuple[Role, str]
ROLE_ORDER: Final[Mapping[Role, int]] = {"MP": 0, "MS": 1, "SS": 2, "AS": 2}


def required_endpoints(panel: Panel) -> Iterator[RequiredEndpoint]:
    """The endpoints that the panel needs, as (role, ROS name). Without the topic of parameter events,
    which every node publishes."""
    for condition in panel.named_conditions:
        yield "MP", condition.topic
    of_widgets = (end for widget in panel.widgets() for end in widget.endpoints())
    yield from sorted(of_widgets, key=lambda end: ROLE_ORDER[end[0]])


class EndpointPresence:
    """The peers behind which each required endpoint was last seen, and the nodes where tokens name
    them."""

    def __init__(self, needed: Iterable[RequiredEndpoint], key: Callable[[str], str]) -> None:
        """`key` returns the present key of a ROS name."""
        self.required = tuple(dict.fromkeys(needed))
        self._key = key
        self.last_peers: dict[RequiredEndpoint, frozenset[str]] = {}
        self.last_nodes: dict[RequiredEndpoint, frozenset[str]] = {}

    def update(self, graph: LiveGraph) -> None:
        """Updates the presence; call it after every change of the graph."""
        for end in self.required:
            if peers := graph.peers_with(*self.keyed(end)):
                self.last_peers[end] = peers
            if nodes := {e.node for e in graph.tokens_of(*self.keyed(end)).values()} - {""}:
                self.last_nodes[end] = frozenset(nodes)
        graph.cache.clear()  # results depend on `last_peers` too

    def keyed(self, end: RequiredEndpoint) -> RequiredEndpoint:
        """An endpoint as (role, key)."""
        return end[0], self._key(end[1])

    def clear(self) -> None:
        """Forgets all endpoints; call it when the link is lost."""
        self.last_peers.clear()
        self.last_nodes.clear()

    def any_present(self, graph: LiveGraph) -> bool:
        """Whether any required endpoint exists."""
        return _any_present(graph, self)

    def missing(self, graph: LiveGraph) -> list[str]:
        """The ROS names of endpoints that have disappeared while their peer is connected."""
        return _missing(graph, self)

    def ended_nodes(self, graph: LiveGraph) -> list[str]:
        """The names of nodes that had a required endpoint, which nothing else has now, and that are
        not there any more."""
        return _ended_nodes(graph, self)


@cached_until_change
def _any_present(graph: LiveGraph, presence: EndpointPresence) -> bool:
    return any(graph.has_endpoint(*presence.keyed(end)) for end in presence.required)


@cached_until_change
def _missing(graph: LiveGraph, presence: EndpointPresence) -> list[str]:
    return [
        end[1]
        for end, peers in presence.last_peers.items()
        if peers & graph.peers and not graph.has_endpoint(*presence.keyed(end))
    ]


@cached_until_change
def _ended_nodes(graph: LiveGraph, presence: EndpointPresence) -> list[str]:
    absent = (
        nodes
        for end, nodes in presence.last_nodes.items()
        if not graph.has_endpoint(*presence.keyed(end))
    )
    return sorted(frozenset().union(*absent) - graph.nodes)
