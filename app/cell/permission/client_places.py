"""Places for clients: how many things of a kind, such as connections, each client may have open.

A client is an address here, since cookies are easily invented. Some places are kept for the kiosk's own
machine, so that no number of other clients shuts it out.
"""

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from ipaddress import IPv6Address, ip_address, ip_network
from typing import Final

KIOSK: Final = frozenset({"127.0.0.1", "::1"})
CLIENTS_KEPT: Final = 1000
SUBNET_BITS: Final = 64  # of IPv6: one machine has as many addresses as it likes there


@dataclass(frozen=True, slots=True)
class PlaceLimits:
    """`total` places, of which other machines together have `others`, and one of them `client`. The
    kiosk's own machine has `kiosk`."""

    total: int
    others: int
    client: int
    kiosk: int


def shares(total: int) -> PlaceLimits:
    """The limits that keep a tenth for the kiosk and give one client an eighth, at least one."""
    kept = max(1, total // 10)
    others = max(1, total - kept)
    return PlaceLimits(total, others, max(1, total // 8), max(1, total // 2))


class ClientPlaces:
    """The taken places by client. Used on the event loop only."""

    __slots__ = ("_shared", "_taken", "_total", "limits")

    def __init__(self, limits: PlaceLimits, shared: Callable[[str], bool] = lambda _: False) -> None:
        """`shared`: whether a client is many, as a proxy is. It may take what all others may."""
        self.limits = limits
        self._shared = shared
        self._taken: Counter[str] = Counter()
        self._total = 0

    @property
    def empty(self) -> bool:
        """Whether no place is taken."""
        return not self._total

    def most(self, client: str) -> int:
        """How many places the client may have: its own share where it has that, else that of all."""
        limits, kiosk = self.limits, client in KIOSK
        if self.client_full(client):
            return self._share(client)
        return limits.total if kiosk else limits.others

    def client_full(self, client: str) -> bool:
        """Whether the client has all places that it may have."""
        return self._taken[client] >= self._share(client)

    def _share(self, client: str) -> int:
        if client in KIOSK:
            return self.limits.kiosk
        return self.limits.others if self._shared(client) else self.limits.client

    def full(self, client: str) -> bool:
        """Whether all places are taken that a client like this may have."""
        limits, kiosk = self.limits, client in KIOSK
        own = sum(self._taken[place] for place in KIOSK)
        return self._total >= limits.total or (not kiosk and self._total - own >= limits.others)

    def has_place(self, client: str) -> bool:
        """Whether the client may have one more."""
        return not self.client_full(client) and not self.full(client)

    def take(self, client: str) -> None:
        """Takes a place."""
        self._taken[client] += 1
        self._total += 1

    def release(self, client: str) -> None:
        """Gives a place back that was taken."""
        self._total -= 1
        self._taken[client] -= 1
        if not self._taken[client]:
            del self._taken[client]


@lru_cache(CLIENTS_KEPT)
def client_key(address: str) -> str:
    """The client of an address: of IPv6 its subnet, as a machine chooses its addresses there. A local
    socket, which has no address, is the kiosk's own."""
    if not address:
        return "127.0.0.1"
    try:
        parsed = ip_address(address.partition("%")[0])
    except ValueError:
        return address[:64]
    if not isinstance(parsed, IPv6Address):
        return str(parsed)
    if parsed.ipv4_mapped:
        return str(parsed.ipv4_mapped)
    if parsed.is_link_local or parsed.is_loopback:
        return str(parsed)
    return str(ip_network((parsed, SUBNET_BITS), strict=False))
