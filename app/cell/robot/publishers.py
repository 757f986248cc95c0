"""The publishers of a robot's topics: how many an interlock's topic has, which of them are silent, and
messages that may be replayed."""

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

from app.cell.robot.graph import LiveGraph
from app.ros.dialects.dialect import Endpoint
from app.ros.dialects.peer_traits import PeerTraits
from app.system.texts import TextLike, say

# The publishers of the interlocks' topics, as their peers know them.
#
# A bridge announces a topic once, however many nodes publish it, and its messages do not say whose they
# are. Only its admin space has each publisher.

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

    def sentence(self, subject: TextLike) -> TextLike:
        """Which nodes publish a topic, which sentences call `subject`; "" if that is not known."""
        if not self.nodes:
            return ""
        more = len(self.nodes) - MAX_NAMES
        names = self.nodes[:MAX_NAMES]
        shown = say("and_more", names=names, number=more) if more > 0 else names
        return say("interlock_published_by", topic=subject, names=shown)


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


# Publishers of an interlock's topic that have appeared and have not published yet.
#
# The first message of a publisher may be lost, if it is sent before the peer or the panel has
# discovered the publisher: through a bridge that is up to seconds later. So a publisher that appears
# makes the last value unknown, until a newer one arrives.
#
# A message that is delivered may arrive before the token of its publisher: a bridge announces a
# publisher after it has discovered its node, mostly 5 to 100 ms later, sometimes 3 s (measured, see
# docs/permissions.md). So the first message since the previous publishers ended counts as that of the
# new one, if it is not older than `PeerTraits.token_delay_s`. If it is not older than
# `token_delay_single_s`, it counts as soon as the nodes are known, if only one of them publishes the
# topic. A TRANSIENT_LOCAL publisher loses nothing and does not repeat itself: its limit is
# `token_delay_latched_s`.


@dataclass(frozen=True, slots=True)
class _LastMessage:
    """The newest message of a peer: its sequence number, and when it arrived (monotonic seconds)."""

    seq: int
    at: float


class SilentPublishers:
    """The silent publishers of one robot. Sequence numbers order messages and tokens as the session
    received them."""

    def __init__(self, topics: Collection[str], traits: PeerTraits) -> None:
        """`topics` are the keys of the interlocks' topics; all others are ignored."""
        self._topics = frozenset(topics)
        self._traits = traits
        self._last_messages: dict[tuple[str, str | None], _LastMessage] = {}
        self._last_changes: dict[
            tuple[str, str], int
        ] = {}  # sequence numbers of the last appearance or loss of a token
        self._silent: dict[str, dict[str | None, int]] = {key: {} for key in self._topics}
        self._late: set[tuple[str, str]] = set()  # silent ones that may have sent the last message

    def record_message(self, key: str, source: str | None, seq: int, at: float) -> None:
        """A message arrived from the peer `source`, None if unknown."""
        if key not in self._topics:
            return
        self._last_messages[key, source] = _LastMessage(seq, at)
        silent = self._silent[key]
        for peer in [b for b, appeared in silent.items() if appeared < seq]:
            if source is None or peer in (source, None):
                del silent[peer]

    def add_publisher(self, endpoint: Endpoint, seq: int, at: float, lost_before: int = 0) -> None:
        """A publisher's token appeared. `lost_before` is the sequence number of its previous loss, if
        it was lost and appeared again."""
        if endpoint.role != "MP" or endpoint.key not in self._topics:
            return
        key, peer = endpoint.key, endpoint.zid
        self._late.discard((key, peer))
        last_change = max(self._last_changes.get((key, peer), 0), lost_before)
        self._last_changes[key, peer] = max(seq, last_change)
        traits = self._traits
        delay_s = traits.token_delay_latched_s if endpoint.transient_local else traits.token_delay_s
        for source in (peer, None):
            last = self._last_messages.get((key, source))
            if last and (last.seq > seq or (last.seq > last_change and at - last.at <= delay_s)):
                return
            if last and last.seq > last_change and at - last.at <= traits.token_delay_single_s:
                self._late.add((key, peer))
        self._silent[key][peer] = seq

    def remove_publisher(self, endpoint: Endpoint, seq: int) -> None:
        """A publisher's token ended. If it never published, its topic stays silent."""
        if endpoint.role == "MP" and endpoint.key in self._topics:
            place = endpoint.key, endpoint.zid
            self._late.discard(place)
            self._last_changes[place] = max(seq, self._last_changes.get(place, 0))

    def mark_single(self, key: str) -> None:
        """One node publishes the topic: the message shortly before its token was its own."""
        for peer in [peer for late, peer in self._late if late == key]:
            self._late.discard((key, peer))
            self._silent[key].pop(peer, None)

    def remove_peer(self, peer: str) -> None:
        """A peer was lost. Its silent publishers count until any newer message arrives."""
        self._late = {late for late in self._late if late[1] != peer}
        for silent in self._silent.values():
            if peer in silent:
                silent[None] = max(silent.pop(peer), silent.get(None, 0))
        for place in [p for p in self._last_changes if p[1] == peer]:
            del self._last_changes[place]
        for source in [s for s in self._last_messages if s[1] == peer]:
            del self._last_messages[source]

    def has_silent(self, key: str, peers: Collection[str]) -> bool:
        """Whether a publisher behind one of these peers, or behind a lost peer, has not
        published."""
        return any(peer is None or peer in peers for peer in self._silent.get(key, ()))


# Messages that may be replayed latched messages of unknown age.
#
# A TRANSIENT_LOCAL publisher keeps its last messages, and ROS 2 sends them to every new reader: when a
# bridge creates its reader, or discovers the publisher, which may take seconds. A bridge stamps them
# with the time of forwarding, as any message, so a replayed message looks like a new one. Only messages
# from a peer's own cache are known to be replayed.
#
# So the age of the first message after a new reader or publisher is unknown, whenever it arrives. The
# same holds for all messages within `REPLAY_S` of it, as a publisher may keep several. Later messages
# of a periodic publisher count as new.

REPLAY_S: Final = 1.0  # at most, from the first replayed message to the last


class ReplayedMessages:
    """The replayed messages of one robot; times in monotonic seconds."""

    def __init__(self) -> None:
        self._first: dict[str, float] = {}  # by key: the arrival of the first message
        self._last: dict[str, float] = {}

    def record_message(self, key: str, at: float, joined_at: float, cached: bool) -> None:
        """A message arrived at `at`; the graph was joined at `joined_at`."""
        first = self._first.get(key)
        if cached or first is None or first < joined_at <= at:
            self._first[key] = at
        self._last[key] = at

    def begin(self, key: str, at: float = math.inf) -> None:
        """A new reader or publisher appeared at `at`: messages from then on may be replayed. By
        default, the next messages."""
        if self._last.get(key, -math.inf) >= at:
            self._first[key] = self._last[
                key
            ]  # the first one may have been earlier: this is the safe side
        else:
            self._first.pop(key, None)

    def begin_all(self) -> None:
        """All readers are new."""
        self._first.clear()
        self._last.clear()

    def known_since(self, key: str) -> float:
        """The time from which messages of this topic are surely new; inf before the first one."""
        return self._first.get(key, math.inf) + REPLAY_S


# Topics that nodes publish by their absolute names in whatever namespace they are: /rosout and
# /parameter_events. They are behind the namespace of a peer, if it has one.


def present_key(graph: LiveGraph, topic: str, keys: Sequence[str]) -> str:
    """The key under which the peers have a topic, of those that it can have: that of a publisher,
    else the one behind a peer's namespace, else the first."""
    published = (key for key in keys if graph.has_endpoint("MP", key))
    behind = {f"{namespace}{topic}"[1:] for namespace in graph.namespaces}
    return next(published, None) or next((key for key in keys if key in behind), keys[0])
