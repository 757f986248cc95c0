"""Publishers of an interlock's topic that have appeared and have not published yet.

The first message of a publisher may be lost, if it is sent before the peer or the panel has discovered
the publisher: through a bridge that is up to seconds later. So a publisher that appears makes the last
value unknown, until a newer one arrives.

A message that is delivered may arrive before the token of its publisher: a bridge announces a publisher
after it has discovered its node, mostly 5 to 100 ms later, sometimes 3 s (measured, see
docs/permissions.md). So the first message since the previous publishers ended counts as that of the new
one, if it is not older than `PeerTraits.token_delay_s`. If it is not older than `token_delay_single_s`,
it counts as soon as the nodes are known, if only one of them publishes the topic. A TRANSIENT_LOCAL
publisher loses nothing and does not repeat itself: its limit is `token_delay_latched_s`.
"""

from collections.abc import Collection
from dataclasses import dataclass

from app.dialect.endpoint import Endpoint
from app.dialect.peer_traits import PeerTraits


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
