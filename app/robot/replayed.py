"""Messages that may be replayed latched messages of unknown age.

A TRANSIENT_LOCAL publisher keeps its last messages, and ROS 2 sends them to every new reader: when a
bridge creates its reader, or discovers the publisher, which may take seconds. A bridge stamps them with
the time of forwarding, as any message, so a replayed message looks like a new one. Only messages from a
peer's own cache are known to be replayed.

So the age of the first message after a new reader or publisher is unknown, whenever it arrives. The
same holds for all messages within `REPLAY_S` of it, as a publisher may keep several. Later messages of
a periodic publisher count as new.
"""

import math
from typing import Final

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
