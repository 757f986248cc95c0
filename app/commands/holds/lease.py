"""The lease of a hold, extended only by the heartbeats of its browser.

Pure: times are arguments, in the server's monotonic seconds. The age of a heartbeat is computed without
the browser's clock: it contains the last `stamp` of the server that the browser received, and how long
ago that was. So the round trip counts as age.
"""

import math
from dataclasses import dataclass
from typing import Final

LEASE_S: Final = 0.25  # from the sending of the last heartbeat to the end of the lease
MAX_AHEAD_S: Final = 0.02  # drift between two clocks over the life of one stamp
STALLED_S: Final = 0.1  # a lease whose end is noticed this late means that the server stalled


def sent_at(opened_at: float, stamp_ms: float, after_ms: float, now: float) -> float:
    """The latest time at which a message can have been sent; -inf if it is in the future.

    `stamp_ms` is the last stamp that the browser received, in ms since `opened_at`; `after_ms` is how
    many ms later it sent this message.
    """
    sent = opened_at + (stamp_ms + after_ms) / 1000
    return min(sent, now) if sent <= now + MAX_AHEAD_S else -math.inf


@dataclass(slots=True)
class Lease:
    """A lease; `until` is its end, `next_at` the time of the next message, `last` the number of the
    newest heartbeat."""

    id: str
    period_s: float
    begun_at: float
    until: float
    next_at: float
    last: int = 0

    @classmethod
    def begun(cls, lease_id: str, period_s: float, sent: float, now: float) -> "Lease":
        return cls(lease_id, period_s, now, sent + LEASE_S, now)

    def end_code(self, now: float) -> str:
        """The code of the reason if the lease has ended, else ""."""
        if now < self.until:
            return ""
        return "hold_by_stall" if now >= self.until + STALLED_S else "hold_by_heartbeat"

    def beat(self, number: int, sent: float, now: float) -> bool:
        """Processes a heartbeat sent at `sent`; returns whether the lease continues. A late or repeated
        heartbeat extends nothing, and a lease that has ended stays ended."""
        if self.end_code(now):
            return False
        if number > self.last:
            self.last = number
            self.until = max(self.until, sent + LEASE_S)
        return True

    def take_due(self, now: float) -> bool:
        """Whether a message is due; if so, schedules the next one. Missed messages are skipped."""
        if self.end_code(now) or now < self.next_at:
            return False
        self.next_at += self.period_s
        if self.next_at <= now:
            self.next_at = now + self.period_s
        return True
