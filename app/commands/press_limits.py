"""Rate limits of presses, for all robots together. A press over a limit is not checked, sent or
recorded.

A client is a browser with a cookie; programs without one are one client per address. Addresses have
their own limit, because cookies are easily invented, and all addresses share a total limit. The kiosk's
own machine is exempt from the total: a flood from the network must not block the panel at the cell.
"""

import time
from collections.abc import Callable, Hashable
from typing import Final

from app.audit import Origin
from app.audit.press_record import origin_of
from app.permission.principal import Principal
from app.rate_limit import Quota, TokenBuckets

# A finger taps ten times a second at most; a program that follows a control loop presses 50 times.
CLIENT_QUOTA: Final = Quota(100, 50)
ADDRESS_QUOTA: Final = Quota(200, 100)
TOTAL_QUOTA: Final = Quota(400, 200)
CANCEL_QUOTA: Final = Quota(20, 5)  # of one goal, by all clients together
RETRY_AFTER_S: Final = 1  # every bucket refills sooner; Retry-After is in whole seconds


class PressLimits:
    """The rate limits of one server. Used on the event loop only."""

    def __init__(
        self, leave_out: Callable[[Origin], None], monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        """`leave_out` counts a refused press for the operator's log, which has no entry of it."""
        self._count_unlogged = leave_out
        self._clients = TokenBuckets(CLIENT_QUOTA, monotonic)
        self._addresses = TokenBuckets(ADDRESS_QUOTA, monotonic)
        self._all = TokenBuckets(TOTAL_QUOTA, monotonic)
        self._cancels = TokenBuckets(CANCEL_QUOTA, monotonic)
        self.refused = 0

    def admit(self, who: Principal) -> bool:
        """Whether a client may press now. Counts refused presses, here and for the log."""
        needed: list[tuple[TokenBuckets, Hashable]] = [
            (self._clients, (who.client.address, who.client.id)),
            (self._addresses, who.client.address),
        ]
        if not who.client.local:
            needed.append((self._all, ""))
        if not all(buckets.has_token(key) for buckets, key in needed):
            return self._refuse(who)
        for buckets, key in needed:
            buckets.take_token(key)
        return True

    def admit_cancel(self, who: Principal, *goal: str) -> bool:
        """Whether a goal may be canceled now. The limit is per goal, so that presses and other goals
        never block a cancel."""
        if not self._cancels.has_token(goal):
            return self._refuse(who)
        self._cancels.take_token(goal)
        return True

    def _refuse(self, who: Principal) -> bool:
        self.refused += 1
        self._count_unlogged(origin_of(who))
        return False
