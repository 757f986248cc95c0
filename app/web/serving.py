"""The limits of the HTTP server: one set, however it was started.

`OPTIONS` are uvicorn's own, for `uvicorn.run`: `operator-panel run` passes them. A uvicorn that was
started without them gets them as the application starts, before it listens.
"""

import asyncio
import os
import socket
from collections.abc import AsyncIterator, Collection, Sequence
from contextlib import asynccontextmanager
from ipaddress import ip_address
from pathlib import Path
from typing import Any, Final

from starlette.types import Receive
from uvicorn import Config
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

from app.certificates.served import ServedCertificate
from app.errors import SettingsError
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


@asynccontextmanager
async def served_certificate(server: Config | None) -> AsyncIterator[ServedCertificate | None]:
    """The certificate of a server with TLS, loaded again when its files change until the end."""
    if server is None or server.ssl is None or not server.ssl_certfile:
        yield None
        return
    key = Path(server.ssl_keyfile) if server.ssl_keyfile else None
    file, password = Path(server.ssl_certfile), server.ssl_keyfile_password
    served = ServedCertificate(file, key, password, server.ssl)
    watching = asyncio.create_task(served.watch())
    try:
        yield served
    finally:
        watching.cancel()


def check_protected(server: Config | None, has_users: bool, without: Collection[str]) -> None:
    """SettingsError if the server will listen beyond this machine and lacks TLS or users, and the
    setting does not say that it goes without."""
    if server is None or not _beyond_loopback(server):
        return
    missing = [
        (name, remedy)
        for name, is_there, remedy in (
            ("tls", server.is_ssl, "TLS (--ssl-certfile and --ssl-keyfile)"),
            ("users", has_users, "users (`operator-panel users`)"),
        )
        if not is_there and name not in without
    ]
    if missing:
        lacks = " and ".join(remedy for _, remedy in missing)
        names = ",".join((*without, *(name for name, _ in missing)))
        raise SettingsError(
            f"to listen on {server.host}, beyond this machine, the panel needs {lacks}: everybody on"
            " the network could press. Listen on 127.0.0.1, or set KIOSK_WITHOUT="
            f"{names} if a proxy of your own protects it"
        )


def _beyond_loopback(server: Config) -> bool:
    """Whether other machines can reach it. A socket that it was given is asked itself."""
    if server.fd is not None:
        with socket.socket(fileno=os.dup(server.fd)) as accepted:
            is_local = accepted.family == socket.AF_UNIX
            hosts = [] if is_local else [accepted.getsockname()[0]]
    elif server.uds:
        return False
    else:
        infos = socket.getaddrinfo(
            server.host or None, server.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
        )
        hosts = [str(info[4][0]) for info in infos]
    return any(not ip_address(host.partition("%")[0]).is_loopback for host in hosts)


def check_port(server: Config | None) -> None:
    """SettingsError if the server will not be able to listen; uvicorn would find that out only at the
    end of the startup.

    A socket that it was given, or that its reloader has opened, is open already.
    """
    if server and not (server.uds or server.fd is not None or server.use_subprocess):
        check_port_free(server.host, server.port)
