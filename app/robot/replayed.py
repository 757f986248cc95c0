"""Messages that may be latched ones, sent again: their age is unknown.

A publisher that is TRANSIENT_LOCAL keeps its last messages, and DDS sends them to every reader that is
new to it: when the bridge makes its reader, or discovers the publisher, which may take seconds. The
bridge stamps them with the time at which it passes them on, as it does any other message, so that
nothing in a message shows that it is sent again. Only what comes from a cache of the bridge's own is
known to be.

So the first message since a reader or a publisher was new, whenever it comes, shows the value, but not
since when; and so do all that come within `REPLAY_S` of it, as a publisher may keep several and DDS
sends them one after the other. The next message of a periodic publisher is believed.
"""

import math
from typing import Final

REPLAY_S: Final = 1.0  # from the first message of what is sent again to the last, at most


class ReplayedMessages:
    """Of one robot; times in monotonic seconds."""

    def __init__(self) -> None:
        self._first: dict[str, float] = {}  # by topic's key: when the first message came since
        self._last: dict[str, float] = {}

    def record_message(self, key: str, at: float, joined_at: float, cached: bool) -> None:
        """A message came at `at`; the graph was joined at `joined_at`."""
        first = self._first.get(key)
        if cached or first is None or first < joined_at <= at:
            self._first[key] = at
        self._last[key] = at

    def begin(self, key: str, at: float = math.inf) -> None:
        """A reader or a publisher is new since `at`: what comes from then on may be sent again. By
        default, what comes next."""
        if self._last.get(key, -math.inf) >= at:
            self._first[key] = self._last[
                key
            ]  # a later one than the first may have been: the safe side
        else:
            self._first.pop(key, None)

    def begin_all(self) -> None:
        """All readers are new."""
        self._first.clear()
        self._last.clear()

    def known_since(self, key: str) -> float:
        """From when on a message of this topic was surely published when it came; inf for never yet."""
        return self._first.get(key, math.inf) + REPLAY_S
