"""The limits of the HTTP server: one set, however it was started.

`OPTIONS` are uvicorn's own, for `uvicorn.run`: `operator-panel run` passes them. A uvicorn that was
started without them gets them as the application starts, before it listens.
"""

from collections.abc import Sequence
from typing import Any, Final

from starlette.types import Receive
from uvicorn import Config
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from app.permission.client_places import ClientPlaces, shares
from app.process.listen_sockets import check_port_free
from app.web.connections import Connection, connections_most, raise_file_limit
from app.web.request_body import LONGEST
from app.web.sockets import Socket

# Presses are short: to compress them costs time, and 30 kB of memory for each browser. Which proxies
# are believed is a setting of the application's.
OPTIONS: Final[dict[str, Any]] = {
    "ws_max_size": LONGEST,
    "ws_max_queue": 2,
    "ws_per_message_deflate": False,
    "proxy_headers": False,
}


def bounded(receive: Receive) -> Config | None:
    """Applies the limits to the server that starts the application, and returns its configuration,
    found by the lifespan's `receive`; None if it is not uvicorn."""
    server = getattr(getattr(receive, "__self__", None), "config", None)
    if not isinstance(server, Config):
        return None
    bound(server)
    return server


def bound(server: Config) -> None:
    """Limits a server that does not listen yet to `OPTIONS`; a tighter limit stays."""
    server.ws_max_size = min(server.ws_max_size, OPTIONS["ws_max_size"])
    server.ws_max_queue = min(server.ws_max_queue, OPTIONS["ws_max_queue"])
    server.ws_per_message_deflate = OPTIONS["ws_per_message_deflate"]
    if isinstance(server.loaded_app, ProxyHeadersMiddleware):
        server.loaded_app = server.loaded_app.app
    raise_file_limit()
    if server.http_protocol_class is HttpToolsProtocol:
        server.http_protocol_class = Connection
        Connection.places = ClientPlaces(shares(connections_most()), Connection.proxies)
    if server.ws_protocol_class is not None:
        server.ws_protocol_class = Socket


def urls(
    server: Config | None, listening: Sequence[tuple[str, int]], hosts: Sequence[str]
) -> list[str]:
    """Where a browser finds the panel; `hosts` are the names that it answers to, of which any may be
    meant where the server listens on all addresses."""
    scheme = "https" if server is not None and server.is_ssl else "http"
    sockets = []
    for host, port in listening:
        names = hosts if host in ("0.0.0.0", "::") else [f"[{host}]" if ":" in host else host]
        sockets += [f"{scheme}://{name}:{port}" for name in names]
    return sockets


def check_port(server: Config | None) -> None:
    """SettingsError if the server will not be able to listen; uvicorn would find that out only at the
    end of the startup.

    A socket that it was given, or that its reloader has opened, is open already.
    """
    if server and not (server.uds or server.fd is not None or server.use_subprocess):
        check_port_free(server.host, server.port)
