"""What uvicorn has no option for: how long a request's head may take, how large it may be, and how many
connections each client may have, so that files are left for the log, the link and recordings, and
places for the kiosk's own browser."""

import asyncio
import logging
import resource
from typing import ClassVar, Final, cast

from uvicorn._types import ASGI3Application
from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol, RequestResponseCycle

from app.permission.client_places import KIOSK, ClientPlaces, client_key, shares
from app.web.client_transport import DRAIN_MOST, DRAIN_WITHIN_S, ClientTransport
from app.web.proxies import NamedProxies

log = logging.getLogger("kiosk.connections")

HEAD_WITHIN_S: Final = 10.0  # from its first byte, or from the opening of the connection
HEAD_MOST: Final = 65_536  # bytes after those that came with its first one
CONNECTIONS_MOST: Final = 2000
FILES_WANTED: Final = 4096  # as the unit's LimitNOFILE
FILES_KEPT: Final = 200  # for all that is no connection


class Connection(HttpToolsProtocol):
    """uvicorn's, which is closed when the head of a request takes too long or is too large.

    When there are too many, one that has not sent a head yet is closed: of the same client if that has
    its share, else of any client but the kiosk's own. Without such a one the new connection is closed.
    """

    proxies: ClassVar = NamedProxies()
    places: ClassVar = ClientPlaces(shares(CONNECTIONS_MOST), proxies)
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
            log.warning("too many connections: one closed for one from %s", where)
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
            self._count(data, DRAIN_MOST)
            return
        before, answered = self._due, self.cycle is None or self.cycle.response_complete
        if before is None and answered:  # the next request, or the rest of one that was answered
            self._begin(DRAIN_WITHIN_S if self._in_body else HEAD_WITHIN_S)
        in_body = self._in_body
        super().data_received(data)
        if before is not None and before is self._due:
            self._count(data, DRAIN_MOST if in_body else HEAD_MOST)

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
