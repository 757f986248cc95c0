"""Publishers of an interlock's topic that have appeared and have not said anything yet.

What a Fast DDS publisher says right after it appeared may never reach the bridge, which discovers it up
to seconds later. So a publisher that appears makes the last value a doubt, until a newer one comes.

The bridge tells of a publisher after it has discovered its node: a message that got through comes
before the token of its publisher, mostly by 5 to 100 ms, now and then by 3 s (measured, see
docs/permissions.md). So the first message since the publishers before were gone counts as said by the
one that appears, if it is not older than `BEFORE_S`. A publisher that is TRANSIENT_LOCAL loses nothing
and says nothing twice: it has `BEFORE_LATCHED_S`.
"""

from collections.abc import Collection
from dataclasses import dataclass
from typing import Final

from app.dialect.endpoint import Endpoint

TOKEN_DELAY_S: Final = 0.5  # from a message to the token of its publisher, at most
TOKEN_DELAY_LATCHED_S: Final = 5.0


@dataclass(frozen=True, slots=True)
class _LastMessage:
    """The newest message of a bridge: its number, and when it came (monotonic seconds)."""

    seq: int
    at: float


class SilentPublishers:
    """Of one robot; sequence numbers order messages and tokens as the session saw them."""

    def __init__(self, topics: Collection[str]) -> None:
        """`topics` are the key expressions of the interlocks' topics; all others are passed over."""
        self._topics = frozenset(topics)
        self._last_messages: dict[tuple[str, str | None], _LastMessage] = {}
        self._last_changes: dict[tuple[str, str], int] = {}  # the last appearance or loss of a token
        self._silent: dict[str, dict[str | None, int]] = {key: {} for key in self._topics}

    def record_message(self, key: str, source: str | None, seq: int, at: float) -> None:
        """A message came by the bridge `source`, which is None where that is not known."""
        if key not in self._topics:
            return
        self._last_messages[key, source] = _LastMessage(seq, at)
        silent = self._silent[key]
        for bridge in [b for b, since in silent.items() if since < seq]:
            if source is None or bridge in (source, None):
                del silent[bridge]

    def add_publisher(self, endpoint: Endpoint, seq: int, at: float, lost_before: int = 0) -> None:
        """A publisher's token appeared; `lost_before` is the number of the loss before it, if it was
        lost and came again."""
        if endpoint.role != "MP" or endpoint.key not in self._topics:
            return
        key, bridge = endpoint.key, endpoint.zid
        since = max(self._last_changes.get((key, bridge), 0), lost_before)
        self._last_changes[key, bridge] = max(seq, since)
        before_s = TOKEN_DELAY_LATCHED_S if endpoint.transient_local else TOKEN_DELAY_S
        for source in (bridge, None):
            said = self._last_messages.get((key, source))
            if said and (said.seq > seq or (said.seq > since and at - said.at <= before_s)):
                return
        self._silent[key][bridge] = seq

    def remove_publisher(self, endpoint: Endpoint, seq: int) -> None:
        """A publisher's token ended. If it never said anything, that stays a doubt."""
        if endpoint.role == "MP" and endpoint.key in self._topics:
            place = endpoint.key, endpoint.zid
            self._last_changes[place] = max(seq, self._last_changes.get(place, 0))

    def remove_bridge(self, bridge: str) -> None:
        """A bridge went. Of what it left open, any newer message is the answer."""
        for silent in self._silent.values():
            if bridge in silent:
                silent[None] = max(silent.pop(bridge), silent.get(None, 0))
        for place in [p for p in self._last_changes if p[1] == bridge]:
            del self._last_changes[place]
        for said in [s for s in self._last_messages if s[1] == bridge]:
            del self._last_messages[said]

    def has_silent(self, key: str, bridges: Collection[str]) -> bool:
        """Whether a publisher behind one of these bridges has not said anything, or one behind a
        bridge that went."""
        return any(bridge is None or bridge in bridges for bridge in self._silent.get(key, ()))
