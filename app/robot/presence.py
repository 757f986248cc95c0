"""Which ends of the robot's nodes (publishers, subscribers, servers) a panel needs, and which of them
went though their bridge stayed."""

from collections.abc import Iterator, Mapping
from typing import Final

from app.dialect.endpoint import Role
from app.panel.model import Panel
from app.robot.graph import Graph, remembered

End = tuple[Role, str]
ORDER: Final[Mapping[Role, int]] = {"MP": 0, "MS": 1, "SS": 2, "AS": 2}


def required_endpoints(panel: Panel) -> Iterator[End]:
    """What the panel talks with, as (role, ROS name). Every node publishes its parameters' events:
    they show none of the panel's."""
    for interlock in panel.interlocks:
        yield "MP", interlock.topic
    of_widgets = (end for widget in panel.widgets() for end in widget.endpoints())
    yield from sorted(of_widgets, key=lambda end: ORDER[end[0]])


class EndpointPresence:
    """Remembers behind which bridges each end was seen last: one entry for each that is needed."""

    def __init__(self, needed: Mapping[End, End]) -> None:
        """`needed`: (role, ROS name) → (role, key expression)."""
        self.needed = needed
        self.behind: dict[End, frozenset[str]] = {}

    def follow(self, graph: Graph) -> None:
        """After every change of the graph."""
        for end, (role, key) in self.needed.items():
            if bridges := graph.behind(role, key):
                self.behind[end] = bridges
        graph.known.clear()  # what was found with what was behind them before

    def forget(self) -> None:
        """The link was lost: what is seen after it is seen for the first time."""
        self.behind.clear()

    def any(self, graph: Graph) -> bool:
        """Whether a node is there that the panel talks with."""
        return _any(graph, self)

    def gone(self, graph: Graph) -> list[str]:
        """The ROS names of what was there and is not, while its bridge is."""
        return _gone(graph, self)


@remembered
def _any(graph: Graph, seen: EndpointPresence) -> bool:
    return any(graph.on_robot(role, key) for role, key in seen.needed.values())


@remembered
def _gone(graph: Graph, seen: EndpointPresence) -> list[str]:
    return [
        end[1]
        for end, bridges in seen.behind.items()
        if bridges & graph.bridges and not graph.on_robot(*seen.needed[end])
    ]
