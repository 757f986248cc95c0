"""What the liveliness tokens and the bridges' admin space say: who is there, with which types."""

from collections.abc import Mapping

from app.keys import DEMO_VERSION, Direction, Endpoint, Qos, Role, parsed

# Whose type must equal the panel's, for what the panel does with a topic. A route of the bridge
# has one type for all: who created it first has fixed it, be it the robot or another panel.
_COUNTERPARTS: Mapping[Role, tuple[Role, Role, Direction]] = {
    "MS": ("MP", "MS", "pub"),  # the panel listens: the robot's publisher, other panels' readers
    "MP": ("MS", "MP", "sub"),  # the panel publishes: the robot's subscriber, other panels' writers
}


class Graph:
    """The ROS graph behind all bridges; changed by `apply` only, on the event loop."""

    def __init__(self, own_zid: str = "") -> None:
        self._own = own_zid
        self._tokens: dict[str, Endpoint] = {}
        self._routes: Mapping[tuple[str, Direction, str], str] = {}
        self._nodes: frozenset[Endpoint] = frozenset()
        self._answered: Mapping[str, str] | None = None

    def apply(self, token_key: str, alive: bool) -> str | None:
        """Takes one token's appearance or end; returns the zid of a bridge that came or went."""
        endpoint = parsed(token_key)
        if endpoint is None or endpoint.zid == self._own:
            return None
        if alive:
            self._tokens[token_key] = endpoint
            if endpoint.role is None:
                self._answered = None  # it was not asked yet
        else:
            self._tokens.pop(token_key, None)
        return endpoint.zid if endpoint.role is None else None

    def learn(
        self,
        routes: Mapping[tuple[str, Direction, str], str],
        nodes: frozenset[Endpoint] = frozenset(),
    ) -> None:
        """Takes what the bridges said of their routes, (bridge, direction, key) → type, and of the
        publishers and subscribers of the nodes behind them: a route has one type, whatever they
        have."""
        self._routes = routes
        self._nodes = nodes

    def answered(self, versions: Mapping[str, str]) -> None:
        """Takes which bridges answered when they were asked, and with which version."""
        self._answered = versions

    @property
    def bridges(self) -> frozenset[str]:
        return frozenset(e.zid for e in self._tokens.values() if e.role is None)

    @property
    def silent(self) -> bool:
        """A bridge is there by its token, but not one answered when asked."""
        asked = self._answered
        return asked is not None and bool(self.bridges) and not self.bridges & asked.keys()

    @property
    def simulated(self) -> bool:
        """A bridge that answered is a demo robot's."""
        asked = self._answered or {}
        return any(asked.get(zid) == DEMO_VERSION for zid in self.bridges)

    def on_robot(self, role: Role, key: str) -> bool:
        """Whether a node behind a bridge publishes ("MP") or subscribes ("MS")."""
        bridges = self.bridges
        return any(e.role == role and e.key == key and e.zid in bridges for e in self._tokens.values())

    def latched(self, key: str) -> bool | None:
        """Whether the robot's publisher is TRANSIENT_LOCAL; None if it has none now."""
        bridges = self.bridges
        for e in self._tokens.values():
            if e.role == "MP" and e.key == key and e.zid in bridges:
                return e.transient_local
        return None

    def wrong_type(self, role: Role, key: str, type_name: str) -> str | None:
        """The other type that this topic has, if it is not what the panel needs for `role`."""
        theirs, others, direction = _COUNTERPARTS[role]
        bridges = self.bridges
        for endpoint in (*self._tokens.values(), *self._nodes):
            counts = endpoint.role == (theirs if endpoint.zid in bridges else others)
            if counts and endpoint.key == key and endpoint.type != type_name:
                return endpoint.type
        for (zid, way, route_key), found in self._routes.items():
            if zid in bridges and way == direction and route_key == key and found != type_name:
                return found
        return None

    def wrong_qos(self, role: Role, key: str, qos: Qos) -> str | None:
        """The code of the sentence that says what DDS would not match, for what the panel does.

        Of several publishers each counts: one that is not heard may say something else. Of several
        subscribers one that hears is enough.
        """
        bridges, theirs = self.bridges, _COUNTERPARTS[role][0]
        doubts = [
            _unheard(e, qos) if role == "MS" else _unheard_by(e, qos)
            for e in self._tokens.values()
            if e.role == theirs and e.key == key and e.zid in bridges
        ]
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
