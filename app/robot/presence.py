"""The endpoints of the robot (publishers, subscribers, servers) that a panel needs, and which of them
are missing while their peer is connected."""

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Final

from app.dialect.endpoint import Role
from app.panel.model import Panel
from app.robot.graph import LiveGraph, cached_until_change

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
