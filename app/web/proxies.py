"""The client behind a proxy: `X-Forwarded-For` and `X-Forwarded-Proto` count from the named proxies
only."""

from collections.abc import Sequence
from ipaddress import IPv4Network, IPv6Network, ip_network
from typing import Any, Final

from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware

from app.permission.clients import where

PEER: Final = "panel.peer"  # of the connection, in the scope


class NamedProxies:
    """Whether an address is that of a proxy: its connections are those of many clients."""

    def __init__(self) -> None:
        self._networks: list[IPv4Network | IPv6Network] = []

    def name(self, proxies: Sequence[str]) -> None:
        """Names the proxies, by addresses and networks."""
        self._networks = [ip_network(proxy) for proxy in proxies]

    def __call__(self, address: str) -> bool:
        if not self._networks:
            return False
        try:
            network = ip_network(address)  # of IPv6 it is a subnet
        except ValueError:
            return False
        return any(network.version == own.version and network.overlaps(own) for own in self._networks)


class Proxies:
    """An ASGI layer that replaces the address of a named proxy by the client's."""

    def __init__(self, app: ASGIApp, named: Sequence[str]) -> None:
        """`named` are addresses and networks."""
        self._app = app
        behind: Any = self._behind  # the same ASGI by other names
        self._believing: Any = ProxyHeadersMiddleware(behind, list(named))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        scope[PEER] = scope.get("client")
        await self._believing(scope, receive, send)

    async def _behind(self, scope: Scope, receive: Receive, send: Send) -> None:
        peer = scope.pop(PEER)
        # A loopback address is of the proxy's machine: only where that is this one it is the kiosk's.
        if peer and _local(scope["client"]) and not _local(peer):
            scope["client"] = peer
        await self._app(scope, receive, send)


def _local(client: tuple[str, int]) -> bool:
    return where(client[0])[1]
