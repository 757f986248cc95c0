"""How much clients may ask for: the one table of their limits, and the guard that applies its rates.

What the documentation says of them is generated from this table. Sizes and times of one request are
limits of the server (`app/web/requests.py`, `app/web/server.py`).
"""

import time
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from typing import Final

from app.cell.permission.client_places import PlaceLimits, shares
from app.system.errors import TooMany
from app.system.limits import Quota, TokenBuckets
from app.system.texts import say


@dataclass(frozen=True, slots=True, kw_only=True)
class RateLimit:
    """`quota` of what `about` names. `sentence` is the code of what a client over it is told, and
    `retry_after_s` when it may try again. `exempts_kiosk`: the kiosk's own machine has no such limit,
    so that no flood from the network blocks the panel at the cell."""

    about: str
    quota: Quota
    sentence: str
    retry_after_s: int = 1
    exempts_kiosk: bool = False

    @property
    def error(self) -> TooMany:
        return TooMany(say(self.sentence), self.retry_after_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class PlaceLimit:
    """How many of what `about` names are open at once."""

    about: str
    places: PlaceLimits
    refused: str


# A client is a browser with a cookie; programs without one are one client per address. Addresses have
# a limit of presses too, because cookies are easily invented, and all addresses share a total one. For
# requests and places a client is an address. Every bucket refills before `retry_after_s`.
RATE_LIMITS: Final[Mapping[str, RateLimit]] = {
    # A finger taps ten times a second at most; a program that follows a control loop presses 50 times.
    "presses": RateLimit(
        about="presses of one client", quota=Quota(100, 50), sentence="press_too_often"
    ),
    "address_presses": RateLimit(
        about="presses of one address", quota=Quota(200, 100), sentence="press_too_often"
    ),
    "other_presses": RateLimit(
        about="presses of all other machines",
        quota=Quota(400, 200),
        sentence="press_too_often",
        exempts_kiosk=True,
    ),
    "cancels": RateLimit(
        about="cancels of one goal, by all clients", quota=Quota(20, 5), sentence="cancel_too_often"
    ),
    # A first page loads 30 files; presses have limits of their own, above.
    "reads": RateLimit(
        about="requests that read something, of one other machine",
        quota=Quota(600, 60),
        sentence="too_many_requests",
        exempts_kiosk=True,
    ),
    "commands": RateLimit(
        about="other requests, of one other machine",
        quota=Quota(400, 200),
        sentence="too_many_requests",
        exempts_kiosk=True,
    ),
    "token_requests": RateLimit(
        about="requests with one token", quota=Quota(100, 50), sentence="token_too_often"
    ),
    "sign_ins": RateLimit(
        about="PINs, passwords and badges from all other machines",
        quota=Quota(10, 1),
        sentence="sign_in_busy",
        retry_after_s=2,
        exempts_kiosk=True,
    ),
    "provider_sign_ins": RateLimit(
        about="sign-ins at the plant's provider that one other machine begins",
        quota=Quota(10, 0.5),
        sentence="sign_in_busy",
        retry_after_s=2,
        exempts_kiosk=True,
    ),
}
CONNECTIONS_MOST: Final = 2000
PLACE_LIMITS: Final[Mapping[str, PlaceLimit]] = {
    "connections": PlaceLimit(
        about="connections",
        places=shares(CONNECTIONS_MOST),
        refused="one that has not sent a request yet is closed: of the same client, or of any other"
        " machine where all places are taken",
    ),
    "viewers": PlaceLimit(
        about="viewers of one camera's topic",
        places=PlaceLimits(total=32, others=28, client=12, kiosk=16),
        refused="429 with `Retry-After: 5`; a WebSocket closes with 4429",
    ),
}
VIEWERS: Final = PLACE_LIMITS["viewers"].places


class RateGuard:
    """Applies rows of the table. Used on the event loop only."""

    def __init__(self, *names: str, monotonic: Callable[[], float] = time.monotonic) -> None:
        """`names` are those of the rows."""
        self._limits = {name: RATE_LIMITS[name] for name in names}
        self._buckets = {
            name: TokenBuckets(limit.quota, monotonic) for name, limit in self._limits.items()
        }

    def exceeded(self, of_kiosk: bool, **keys: Hashable) -> RateLimit | None:
        """Counts something for the keys of each row; returns the row that it is over, if it is: then
        nothing is counted. `of_kiosk`: the kiosk's own machine asks."""
        counted = {
            name: key
            for name, key in keys.items()
            if not (of_kiosk and self._limits[name].exempts_kiosk)
        }
        for name, key in counted.items():
            if not self._buckets[name].has_token(key):
                return self._limits[name]
        for name, key in counted.items():
            self._buckets[name].take_token(key)
        return None
