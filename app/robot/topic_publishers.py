"""The publishers of the interlocks' topics, as their peers know them.

A bridge announces a topic once, however many nodes publish it, and its messages do not say whose they
are. Only its admin space has each publisher.
"""

from collections.abc import Collection
from typing import Final, NamedTuple

from app.i18n import TextLike, say
from app.robot.graph import LiveGraph

MAX_NAMES: Final = 4


class Publisher(NamedTuple):
    """A publisher behind a peer (a bridge's DDS writer), with the nodes that it may belong to."""

    peer: str
    guid: str
    nodes: tuple[str, ...] = ()


class Publishers(NamedTuple):
    """The publishers of a topic: how many, and the names of their nodes as far as they are known."""

    number: int
    nodes: tuple[str, ...] = ()

    def sentence(self, topic: str) -> TextLike:
        """Which nodes publish the topic; "" if that is not known."""
        if not self.nodes:
            return ""
        more = len(self.nodes) - MAX_NAMES
        names = self.nodes[:MAX_NAMES]
        shown = say("and_more", names=names, number=more) if more > 0 else names
        return say("interlock_published_by", topic=topic, names=shown)


class TopicPublishers:
    """The publishers of one robot's interlocks, by the keys of their topics."""

    def __init__(self) -> None:
        self._known: dict[str, frozenset[Publisher]] = {}

    def update(self, key: str, publishers: Collection[Publisher]) -> bool:
        """Replaces the publishers of a topic; returns whether they have changed."""
        before = self._known.get(key, frozenset())
        self._known[key] = frozenset(publishers)
        return before != self._known[key]

    def of_topic(self, key: str, graph: LiveGraph) -> Publishers:
        """The publishers behind the present peers. Two bridges of one domain know the same ones; a
        peer that does not know them has those that it announces."""
        known = [publisher for publisher in self._known.get(key, ()) if publisher.peer in graph.peers]
        nodes = {publisher.guid: publisher.nodes for publisher in sorted(known)}
        others = graph.peers_with("MP", key) - {publisher.peer for publisher in known}
        names = sorted(name for several in nodes.values() for name in several)
        return Publishers(len(nodes) + len(others), tuple(names))
