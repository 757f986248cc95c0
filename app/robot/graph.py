"""What the liveliness tokens and the bridges' admin space say: who is there, with which types.

Kept by topic key, so that asking costs the same however large the robot's graph is.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import dataclass
from itertools import chain
from typing import Any, TypeVar, TypeVarTuple

from app.dialect.dialect import Dialect
from app.dialect.endpoint import (
    DEMO_VERSION,
    Direction,
    Endpoint,
    Role,
    ServerRole,
    TopicRole,
    within,
)
from app.interfaces.names import Qos

# Whose type must equal the panel's, for what the panel does with a topic. A route of the bridge
# has one type for all: who created it first has fixed it, be it the robot or another panel.
_COUNTERPARTS: Mapping[TopicRole, tuple[Role, Role, Direction]] = {
    "MS": ("MP", "MS", "pub"),  # the panel listens: the robot's publisher, other panels' readers
    "MP": ("MS", "MP", "sub"),  # the panel publishes: the robot's subscriber, other panels' writers
}


@dataclass(frozen=True, slots=True)
class Route:
    """A bridge's route for a topic; `whole` is False where its DDS reader is missing."""

    zid: str
    direction: Direction
    key: str
    type: str
    whole: bool = True


Of = TypeVarTuple("Of")
Found = TypeVar("Found")


def remembered(look: Callable[["Graph", *Of], Found]) -> Callable[["Graph", *Of], Found]:
    """What is found is kept until the graph changes: it is asked far more often than that."""

    def asked(graph: "Graph", *of: *Of) -> Found:
        question = (look, of)
        found: Found
        try:
            found = graph.known[question]
        except KeyError:
            found = graph.known[question] = look(graph, *of)
        return found

    asked.__doc__ = look.__doc__
    return asked


class Graph:
    """The ROS graph behind all bridges; changed by `apply`, `learn` and `answered` only, on the
    event loop."""

    def __init__(
        self,
        dialect: Dialect,
        own_zid: str = "",
        namespace: str | None = None,
        keys: Collection[str] | None = None,
    ) -> None:
        """`namespace` tells this robot's bridges from those of others; None: all are its. Of tokens for
        other keys than `keys` nothing is kept; None: all are."""
        self._dialect = dialect
        self.own_zid = own_zid  # whose tokens are not the robot's
        self._names = None if keys is None else frozenset(map(dialect.in_token, keys))
        self.known: dict[Any, Any] = {}  # see `remembered`
        self._namespace = namespace
        self._bridges: set[str] = set()
        self._fits: dict[str, bool] = {}  # whether a bridge's namespace is the robot's
        self._tokens: defaultdict[str, dict[str, Endpoint]] = defaultdict(dict)
        self._since: dict[str, float] = {}  # of servers' tokens
        self._routes: defaultdict[str, list[Route]] = defaultdict(list)
        self._nodes: defaultdict[str, list[Endpoint]] = defaultdict(list)
        self._answered: Mapping[str, str] | None = None

    def concerns(self, token_key: str) -> bool:
        """Whether a token is a bridge's own, or about one of the keys that count."""
        if self._names is None:
            return True
        name = self._dialect.name_in(token_key)
        return not name or name in self._names

    def has(self, token_key: str) -> bool:
        """Whether a token is there by all that was taken."""
        endpoint = self._dialect.endpoint(token_key)
        return endpoint is not None and token_key in self._tokens.get(endpoint.key, {})

    def apply(self, token_key: str, alive: bool, now: float = -math.inf) -> str | None:
        """Takes one token's appearance (`now`, monotonic seconds) or end; returns the zid of a
        bridge that came or went."""
        endpoint = self._dialect.endpoint(token_key) if self.concerns(token_key) else None
        if endpoint is None or endpoint.zid == self.own_zid:
            return None
        self.known.clear()
        if endpoint.role is None:
            return self._bridge(endpoint.zid, alive)
        if alive:
            self._tokens[endpoint.key][token_key] = endpoint
            if endpoint.role in ("SS", "AS"):
                self._since[token_key] = now
        else:
            self._end(endpoint.key, token_key)
        return None

    def _end(self, key: str, token_key: str) -> None:
        """Of a node that went nothing is kept: many come once and never again."""
        tokens = self._tokens.get(key, {})
        tokens.pop(token_key, None)
        if not tokens:
            self._tokens.pop(key, None)
        self._since.pop(token_key, None)

    def _bridge(self, zid: str, alive: bool) -> str:
        if alive:
            self._bridges.add(zid)
            self._answered = None  # it was not asked yet
        else:
            self._bridges.discard(zid)
            self._fits.pop(zid, None)
        return zid

    def learn(self, routes: Iterable[Route], nodes: Iterable[Endpoint] = ()) -> None:
        """Takes what the bridges said of their routes, and of the publishers and subscribers of
        the nodes behind them: a route has one type, whatever they have."""
        self.known.clear()
        self._routes.clear()
        self._nodes.clear()
        for route in routes:
            self._routes[route.key].append(route)
        for node in nodes:
            self._nodes[node.key].append(node)

    def answered(self, versions: Mapping[str, str]) -> None:
        """Takes which bridges answered when they were asked, and with which version."""
        self.known.clear()
        self._answered = versions

    def configured(self, namespaces: Mapping[str, str]) -> None:
        """Takes the namespace of each bridge that told it ("" for none)."""
        self.known.clear()
        for zid, namespace in namespaces.items():
            self._fits[zid] = self._namespace is None or within(self._namespace, namespace)

    @property
    @remembered
    def bridges(self) -> frozenset[str]:
        """Those of this robot; one that has not told its namespace may be, if no other is."""
        told = {zid for zid in self._bridges if self._fits.get(zid)}
        return frozenset(told or self._bridges - self._fits.keys())

    @property
    @remembered
    def silent(self) -> bool:
        """A bridge is there by its token, but did not answer when all were asked."""
        asked = self._answered
        return asked is not None and bool(self.bridges - asked.keys())

    @property
    @remembered
    def simulated(self) -> bool:
        """A bridge that answered is a demo robot's."""
        asked = self._answered or {}
        return any(asked.get(zid) == DEMO_VERSION for zid in self.bridges)

    @remembered
    def _on_robot(self, role: Role, key: str) -> list[Endpoint]:
        tokens = self._tokens.get(key, {}).values()
        return [e for e in tokens if e.role == role and e.zid in self._bridges]

    def behind(self, role: Role, key: str) -> frozenset[str]:
        """The bridges behind which a node publishes, subscribes or serves."""
        return frozenset(e.zid for e in self._on_robot(role, key))

    def on_robot(self, role: Role, key: str) -> bool:
        """Whether a node behind a bridge publishes, subscribes or serves."""
        return bool(self._on_robot(role, key))

    def server_type(self, role: ServerRole, key: str) -> str | None:
        """The type of the robot's service or action; None if it offers none of this name now."""
        return next((e.type for e in self._on_robot(role, key)), None)

    @remembered
    def served_since(self, role: ServerRole, key: str) -> float:
        """When (monotonic seconds) the last server of this name came; -inf where there is none."""
        tokens = self._tokens.get(key, {}).items()
        here = (self._since[t] for t, e in tokens if e.role == role and e.zid in self._bridges)
        return max(here, default=-math.inf)

    def latched(self, key: str) -> bool | None:
        """Whether the robot's publisher is TRANSIENT_LOCAL; None if it has none now."""
        return next((e.transient_local for e in self._on_robot("MP", key)), None)

    def volatile(self, key: str) -> bool:
        """Whether the robot's publishers are known, and none is TRANSIENT_LOCAL."""
        known = self._on_robot("MP", key)
        return bool(known) and not any(e.transient_local for e in known)

    @remembered
    def unheard(self, key: str) -> bool:
        """Whether the robot publishes a topic that its bridge does not read for the panel."""
        publishing = {e.zid for e in self._on_robot("MP", key)}
        return any(
            r.direction == "pub" and not r.whole and r.zid in publishing
            for r in self._routes.get(key, [])
        )

    @remembered
    def wrong_type(self, role: TopicRole, key: str, type_name: str) -> str | None:
        """The other type that this topic has, if it is not what the panel needs for `role`."""
        theirs, others, direction = _COUNTERPARTS[role]
        for endpoint in chain(self._tokens.get(key, {}).values(), self._nodes.get(key, [])):
            counts = endpoint.role == (theirs if endpoint.zid in self._bridges else others)
            if counts and endpoint.type != type_name:
                return endpoint.type
        for route in self._routes.get(key, []):
            there = route.zid in self._bridges and route.direction == direction
            if there and route.type != type_name:
                return route.type
        return None

    @remembered
    def wrong_qos(self, role: TopicRole, key: str, qos: Qos) -> str | None:
        """The code of the sentence that says what DDS would not match, for what the panel does.

        Of several publishers each counts: one that is not heard may say something else. Of several
        subscribers one that hears is enough.
        """
        theirs = self._on_robot(_COUNTERPARTS[role][0], key)
        doubts = [_unheard(e, qos) if role == "MS" else _unheard_by(e, qos) for e in theirs]
        if role == "MP" and None in doubts:
            return None
        return next(filter(None, doubts), None)


def _unheard(publisher: Endpoint, qos: Qos) -> str | None:
    """Why a reader of this QoS would not hear a publisher."""
    if qos.reliable and publisher.reliable is False:
        return "publishes_best_effort"
    if qos.transient_local and not publisher.transient_local:
        return "publishes_volatile"
    return None


def _unheard_by(subscriber: Endpoint, qos: Qos) -> str | None:
    """Why a subscriber would not hear a writer of this QoS."""
    if not qos.reliable and subscriber.reliable:
        return "asks_for_reliable"
    if not qos.transient_local and subscriber.transient_local:
        return "asks_for_transient_local"
    return None
