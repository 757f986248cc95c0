"""Publishers of the Zenoh session: plain ones, and latched ones, which keep their last message."""

from typing import Any, Final, Protocol

import zenoh
from zenoh.ext import CacheConfig, MissDetectionConfig, declare_advanced_publisher

# BLOCK and RELIABLE: what is put reaches the peer, or the link is cut. REMOTE: not this session's own
# subscribers.
SETTINGS: Final[dict[str, Any]] = {
    "congestion_control": zenoh.CongestionControl.BLOCK,
    "express": True,
    "reliability": zenoh.Reliability.RELIABLE,
    "allowed_destination": zenoh.Locality.REMOTE,
}


class Publisher(Protocol):
    """A publisher on one key expression."""

    def put(self, payload: bytes, *, attachment: bytes | None = None) -> Any: ...

    @property
    def matching_status(self) -> Any:
        """An object of Zenoh's, whose `matching` tells whether there is a subscriber."""


def declare_publisher(session: zenoh.Session, expression: str, *, kept: int) -> Publisher:
    """A publisher. A subscriber that comes late gets its last `kept` messages, also if none was there
    when they were put. What it keeps ends with the session: nothing is sent again after the
    connection was lost."""
    plain: Publisher = session.declare_publisher(expression, **SETTINGS)
    return _Latched(session, expression, plain, kept) if kept else plain


class _Latched:
    """Zenoh's publisher with a cache does not tell who listens: a plain one does."""

    def __init__(self, session: zenoh.Session, expression: str, plain: Publisher, kept: int) -> None:
        self._plain = plain
        self._cached = declare_advanced_publisher(
            session,
            expression,
            cache=CacheConfig(max_samples=kept),
            publisher_detection=True,
            # Orders by number: timestamps of one's own would replace those of clocks that are ahead.
            sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=None),
            **SETTINGS,
        )

    def put(self, payload: bytes, *, attachment: bytes | None = None) -> None:
        self._cached.put(payload, attachment=attachment)

    @property
    def matching_status(self) -> Any:
        return self._plain.matching_status
