"""A lease: one browser's right to keep a hold going, prolonged by its heartbeats and nothing else.

Pure: times are monotonic seconds of the server and come from outside. How old a heartbeat is shows
without trust in the browser's clock: it says which stamp of the server's it had last and how long
before, so that it can't have been sent earlier than that. The way back and forth counts as age.
"""

import math
from dataclasses import dataclass
from typing import Final

LEASE_S: Final = 0.25  # from the sending of a heartbeat to the end, if no newer one comes
MAX_AHEAD_S: Final = 0.02  # by so much two clocks may differ over the life of one stamp
STALLED_S: Final = 0.1  # who comes so late to see a lease's end has stood still


def sent_at(opened_at: float, stamp_ms: float, after_ms: float, now: float) -> float:
    """When a message was sent, at the latest; -inf for one that claims to be from the future.

    `stamp_ms` is the server's last stamp that the browser has, in ms since `opened_at`; `after_ms`
    how long it had it when it sent this.
    """
    sent = opened_at + (stamp_ms + after_ms) / 1000
    return min(sent, now) if sent <= now + MAX_AHEAD_S else -math.inf


@dataclass(slots=True)
class Lease:
    """`until` is its end, `next_at` when the next message is due."""

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
        """The code of why it is over; "" while it is not."""
        if now < self.until:
            return ""
        return "hold_by_stall" if now >= self.until + STALLED_S else "hold_by_heartbeat"

    def beat(self, number: int, sent: float, now: float) -> bool:
        """A heartbeat, sent at `sent`; whether the lease goes on. One that is late or was there
        already prolongs nothing, and none revives a lease that is over."""
        if self.end_code(now):
            return False
        if number > self.last:
            self.last = number
            self.until = max(self.until, sent + LEASE_S)
        return True

    def take_due(self, now: float) -> bool:
        """Whether a message is due; those that were missed are passed over."""
        if self.end_code(now) or now < self.next_at:
            return False
        self.next_at += self.period_s
        if self.next_at <= now:
            self.next_at = now + self.period_s
        return True
