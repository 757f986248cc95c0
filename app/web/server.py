"""The HTTP server: its limits, its connections, clients behind a proxy, and what it logs of its
clients."""

import asyncio
import logging
import os
import re
import resource
import socket
from collections.abc import AsyncIterator, Callable, Collection, Mapping, Sequence
from contextlib import asynccontextmanager, suppress
from ipaddress import IPv4Network, IPv6Network, ip_address, ip_network
from pathlib import Path, PurePath
from typing import Any, ClassVar, Final, cast

from starlette.types import ASGIApp, Receive, Scope, Send
from uvicorn import Config
from uvicorn._types import ASGI3Application, ASGISendEvent
from uvicorn.middleware.proxy_headers import ProxyHeadersMiddleware
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle
from uvicorn.protocols.utils import ClientDisconnected
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol

from app.cell.permission.client_limits import CONNECTIONS_MOST, PLACE_LIMITS
from app.cell.permission.client_places import KIOSK, ClientPlaces, client_key, shares
from app.records.principal import where
from app.system.concurrency import keep_running
from app.system.errors import SettingsError
from app.system.log import RepeatedRecords
from app.system.process.listen_sockets import check_port_free
from app.system.used_certificates import ServedCertificate
from app.web.requests import LONGEST

# The transport of a client's connection: it holds the client's place, and closes so that the client
# gets the last answer.
#
# The kernel resets a connection that is closed while bytes of the client wait unread, and a reset takes
# the answer away that was just sent. So the rest of a request is read and dropped for a moment.

DRAIN_WITHIN_S: Final = 5.0
MAX_DRAIN: Final = 16 << 20  # bytes of the rest of a request


class ClientTransport:
    """Delegates to a transport."""

    def __init__(self, transport: asyncio.Transport, has_rest: Callable[[], bool]) -> None:
        """`has_rest`: whether a part of a request has still to come."""
        self._transport = transport
        self._has_rest = has_rest
        self._release: Callable[[], None] | None = None
        self._draining: asyncio.TimerHandle | None = None

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)

    @property
    def draining(self) -> bool:
        """Whether all was sent, and what still comes is dropped."""
        return self._draining is not None

    def is_closing(self) -> bool:
        return self.draining or self._transport.is_closing()

    def write(self, data: bytes) -> None:
        if not self.draining:
            self._transport.write(data)

    def close(self) -> None:
        """Closes; while a request has not come wholly, at the latest after `DRAIN_WITHIN_S`."""
        if self.is_closing():
            return
        if not self._has_rest():
            self._transport.close()
            return
        self._draining = asyncio.get_running_loop().call_later(DRAIN_WITHIN_S, self.close_now)
        with suppress(OSError, RuntimeError):  # the client was faster
            if self._transport.can_write_eof():
                self._transport.write_eof()
            self._transport.resume_reading()

    def close_now(self) -> None:
        """Closes, whatever the client still sends."""
        if self._draining is not None:
            self._draining.cancel()
        self._transport.close()

    def occupy(self, release: Callable[[], None]) -> None:
        """Holds a place of the client, which `release` gives back."""
        self._release = release

    def release(self) -> None:
        """Gives the client's place back, if it holds one."""
        release, self._release = self._release, None
        if release is not None:
            release()


# The client behind a proxy: `X-Forwarded-For` and `X-Forwarded-Proto` count from the named proxies
# only.

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


# What uvicorn has no option for: how long a request's head may take, how large it may be, and how many
# connections each client may have, so that files are left for the log, the link and recordings, and
# places for the kiosk's own browser.

connection_log = logging.getLogger("kiosk.connections")

HEAD_WITHIN_S: Final = 10.0  # from its first byte, or from the opening of the connection
HEAD_MOST: Final = 65_536  # bytes after those that came with its first one
FILES_WANTED: Final = 4096  # as the unit's LimitNOFILE
FILES_KEPT: Final = 200  # for all that is no connection


class Connection(HttpToolsProtocol):
    """uvicorn's, which is closed when the head of a request takes too long or is too large.

    When there are too many, one that has not sent a head yet is closed: of the same client if that has
    its share, else of any client but the kiosk's own. Without such a one the new connection is closed.
    """

    proxies: ClassVar = NamedProxies()
    places: ClassVar = ClientPlaces(PLACE_LIMITS["connections"].places, proxies)
    waiting: ClassVar[dict["Connection", None]] = {}  # for their first head, the oldest first

    client_transport: ClientTransport
    client_id: str
    _due: asyncio.TimerHandle | None = None  # while a head, or a body that no one needs, is waited for
    _received = 0  # bytes of it
    _in_body = False
    _handled: RequestResponseCycle | None = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        own = ClientTransport(cast(asyncio.Transport, transport), lambda: self._in_body)
        self.client_transport = own
        super().connection_made(cast(asyncio.Transport, own))
        self.client_id = client_key(self.client[0] if self.client else "")
        if not self.places.has_place(self.client_id):
            where = self.client[0] if self.client else "a local socket"
            connection_log.warning("too many connections: one closed for one from %s", where)
            if not self._displace():
                own.close_now()
                return
        self.places.take(self.client_id)
        own.occupy(lambda: self.places.release(self.client_id))
        self.waiting[self] = None
        self._begin(HEAD_WITHIN_S)

    def connection_lost(self, exc: Exception | None) -> None:
        self._end()
        self.client_transport.release()
        # uvicorn tells the last request only, which is not the one that runs if others wait.
        self.pipeline.clear()
        if self._handled is not None:
            self._handled.disconnected = True
            self._handled.message_event.set()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        if self.client_transport.draining:
            self._count(data, MAX_DRAIN)
            return
        before, answered = self._due, self.cycle is None or self.cycle.response_complete
        if before is None and answered:  # the next request, or the rest of one that was answered
            self._begin(DRAIN_WITHIN_S if self._in_body else HEAD_WITHIN_S)
        in_body = self._in_body
        super().data_received(data)
        if before is not None and before is self._due:
            self._count(data, MAX_DRAIN if in_body else HEAD_MOST)

    def eof_received(self) -> None:
        if self.client_transport.draining:
            self.client_transport.close_now()

    def send_400_response(self, msg: str) -> None:
        self._in_body = True  # as long as it goes on
        super().send_400_response(msg)

    def on_message_begin(self) -> None:
        super().on_message_begin()
        if self._due is None:
            self._begin(HEAD_WITHIN_S)

    def on_headers_complete(self) -> None:
        self._end()
        self._in_body = True
        super().on_headers_complete()

    def on_message_complete(self) -> None:
        self._in_body = False
        if self.cycle is not None and self.cycle.response_complete:
            self._end()
            self._begin(HEAD_WITHIN_S)  # uvicorn has ended its own timer
        super().on_message_complete()

    def handle_websocket_upgrade(self) -> None:
        self._in_body = False
        super().handle_websocket_upgrade()

    def _start_asgi_task(self, cycle: RequestResponseCycle, app: ASGI3Application) -> None:
        self._handled = cycle
        super()._start_asgi_task(cycle, app)

    def _begin(self, within_s: float) -> None:
        self._received = 0
        self._due = self.loop.call_later(within_s, self.client_transport.close_now)

    def _count(self, data: bytes, most: int) -> None:
        self._received += len(data)
        if self._received > most:
            self.client_transport.close_now()

    def _end(self) -> None:
        self.waiting.pop(self, None)
        if self._due is not None:
            self._due.cancel()
            self._due = None

    def _displace(self) -> bool:
        """Closes a connection that waits for its first head; False if there is none."""
        own_share = self.places.client_full(self.client_id)
        for other in self.waiting:
            if other.client_id == self.client_id if own_share else other.client_id not in KIOSK:
                other._end()
                other.client_transport.release()
                other.client_transport.close_now()
                return True
        return False


def connections_most() -> int:
    """As many as leave `FILES_KEPT` files."""
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if files == resource.RLIM_INFINITY:
        return CONNECTIONS_MOST
    return max(1, min(CONNECTIONS_MOST, files - FILES_KEPT))


def raise_file_limit() -> None:
    """Takes as many open files as the system allows this process, up to `FILES_WANTED`."""
    files, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = FILES_WANTED if most == resource.RLIM_INFINITY else min(FILES_WANTED, most)
    if files != resource.RLIM_INFINITY and files < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))


# uvicorn's WebSocket, which gives the place of its connection back, and knows that it was answered.


class Socket(WebSocketsSansIOProtocol):
    """A WebSocket that was a `Connection` before. It is closed when its handshake takes too long."""

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        self.loop.call_later(HEAD_WITHIN_S, self._check_handshake)

    def connection_lost(self, exc: Exception | None) -> None:
        cast(ClientTransport, self.transport).release()
        super().connection_lost(exc)

    async def send(self, message: ASGISendEvent) -> None:
        if self.close_sent and message["type"] == "websocket.send":
            raise ClientDisconnected  # uvicorn takes it for a fault of the application
        if message["type"] == "websocket.accept" and self.transport.is_closing():
            raise ClientDisconnected  # uvicorn would accept nothing, and refuse the first message
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body", False):
            self.handshake_complete = True  # uvicorn would take the answer for none

    def _check_handshake(self) -> None:
        if not self.handshake_complete:
            self.transport.close()


# The limits of the HTTP server: one set, however it was started.
#
# `OPTIONS` are uvicorn's own, for `uvicorn.run`: `operator-panel run` passes them. A uvicorn that was
# started without them gets them as the application starts, before it listens.

log = logging.getLogger("kiosk")

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
    watching = keep_running(served.watch, log, "watching the certificate failed")
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
            f"to listen on {server.host}, beyond this machine, the panel needs {lacks}: everyone on"
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


# What the HTTP server logs of its clients: one line for a fault, without a traceback where the fault is
# the client's, and the number of those that follow.

# asyncio logs what fails below a connection, such as a TLS handshake.
LOGGERS: Final = ("uvicorn.error", "asyncio", "kiosk.connections", "kiosk.web", "kiosk.zenoh")
TOKEN_PATH: Final = re.compile(r"(/recordings/shared/)[^/?\s]+")
COUNT_EVERY_S: Final = 5.0
# uvicorn's and websockets' words → ours, for faults of a client.
CLIENT_FAULTS: Final[Mapping[str, str]] = {
    "Invalid HTTP request received.": "A client sent something that is not an HTTP request",
    "Invalid UTF-8 sequence received from client.": "A client sent a WebSocket message that is no text",
    "Unsupported upgrade request.": "A client asked for another protocol than HTTP and WebSocket",
}


class ClientFaults(logging.Filter):
    """Rewords faults of a client, and drops what is logged of each WebSocket."""

    def filter(self, record: logging.LogRecord) -> bool:
        words = CLIENT_FAULTS.get(str(record.msg).strip())
        if words is not None:
            record.msg, record.args, record.exc_info, record.exc_text = words, (), None, None
        path = PurePath(record.pathname)
        about_client = "protocols" in path.parts or path.parent.name == "websockets"
        return record.levelno >= logging.WARNING or not about_client


class MaskedTokens(logging.Filter):
    """Masks the tokens of shared recordings in the lines of requests."""

    def filter(self, record: logging.LogRecord) -> bool:
        if isinstance(record.args, tuple):
            record.args = tuple(
                TOKEN_PATH.sub(r"\1***", value) if isinstance(value, str) else value
                for value in record.args
            )
        return True


def limit_server_log(debug: bool) -> RepeatedRecords:
    """Puts the filters on the server's loggers; with `debug` each WebSocket is logged."""
    repeated = RepeatedRecords()
    for name in LOGGERS:
        logger = logging.getLogger(name)
        for before in [
            log_filter
            for log_filter in logger.filters
            if isinstance(log_filter, (ClientFaults, RepeatedRecords))
        ]:
            logger.removeFilter(before)
        if not debug:
            logger.addFilter(ClientFaults())
        logger.addFilter(repeated)
    requests = logging.getLogger("uvicorn.access")
    if not any(isinstance(log_filter, MaskedTokens) for log_filter in requests.filters):
        requests.addFilter(MaskedTokens())
    return repeated


async def count_repeated(repeated: RepeatedRecords) -> None:
    """Writes the counts, for ever."""
    while True:
        await asyncio.sleep(COUNT_EVERY_S)
        repeated.write_counts(logging.getLogger("kiosk.connections"))
