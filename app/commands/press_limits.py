"""How often a client may press, on all robots together: what is more is not judged, sent or recorded.

A client is a browser by its cookie; programs without one are one client for each address. An address
has a limit of its own, for a cookie is made up easily, and all addresses together have one. The kiosk's
own machine does not count among these: no one in the network keeps the panel at the cell from pressing.
"""

import time
from collections.abc import Callable, Hashable
from typing import Final

from app.audit import Origin
from app.audit.press_record import origin_of
from app.permission.principal import Principal
from app.rate_limit import Quota, TokenBuckets

# A finger taps ten times a second at most; a program that follows a control loop presses 50 times.
OF_CLIENT: Final = Quota(100, 50)
OF_ADDRESS: Final = Quota(200, 100)
OF_ALL: Final = Quota(400, 200)
OF_CANCELS: Final = Quota(20, 5)  # of one goal, by whomever: each of them has asked the robot
RETRY_AFTER_S: Final = 1  # each has room again much sooner; HTTP knows whole seconds


class PressLimits:
    """Used on the event loop only."""

    def __init__(
        self, leave_out: Callable[[Origin], None], monotonic: Callable[[], float] = time.monotonic
    ) -> None:
        """`leave_out` tells the operator's log of a press that is not one of its entries."""
        self._leave_out = leave_out
        self._clients = TokenBuckets(OF_CLIENT, monotonic)
        self._addresses = TokenBuckets(OF_ADDRESS, monotonic)
        self._all = TokenBuckets(OF_ALL, monotonic)
        self._cancels = TokenBuckets(OF_CANCELS, monotonic)
        self.refused = 0

    def admit(self, who: Principal) -> bool:
        """Whether it may press once more now; what may not is counted, here and for the log."""
        asked: list[tuple[TokenBuckets, Hashable]] = [
            (self._clients, (who.client.address, who.client.id)),
            (self._addresses, who.client.address),
        ]
        if not who.client.local:
            asked.append((self._all, ""))
        if not all(buckets.has_token(key) for buckets, key in asked):
            return self._refuse(who)
        for buckets, key in asked:
            buckets.take_token(key)
        return True

    def admit_cancel(self, who: Principal, *goal: str) -> bool:
        """The same for a cancel: it is one too many only if this very goal's was asked for that often
        just now, so that no one is kept from stopping a robot."""
        if not self._cancels.has_token(goal):
            return self._refuse(who)
        self._cancels.take_token(goal)
        return True

    def _refuse(self, who: Principal) -> bool:
        self.refused += 1
        self._leave_out(origin_of(who))
        return False
