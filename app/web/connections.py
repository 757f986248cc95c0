"""What uvicorn has no option for: how long a request's head may take, how large it may be, and how many
connections there may be, so that files are left for the log, the link and recordings."""

import asyncio
import logging
import math
import resource
from typing import ClassVar, Final, cast

from uvicorn.protocols.http.httptools_impl import HttpToolsProtocol

log = logging.getLogger("kiosk.connections")

HEAD_WITHIN_S: Final = 10.0  # from its first byte, or from the opening of the connection
HEAD_MOST: Final = 65_536  # bytes after those that came with its first one
CONNECTIONS_MOST: Final = 2000  # half of them from one address
FILES_WANTED: Final = 4096  # as the unit's LimitNOFILE
FILES_KEPT: Final = 200  # for all that is no connection
WARN_EVERY_S: Final = 60.0


class Connection(HttpToolsProtocol):
    """uvicorn's, which is closed when the head of a request takes too long or is too large, and at once
    when there are too many."""

    warned_at: ClassVar[float] = -math.inf

    _due: asyncio.TimerHandle | None = None  # while a head is waited for
    _head = 0

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(cast(asyncio.Transport, transport))
        if self._crowded():
            self._tell()
            transport.close()
        else:
            self._begin()

    def connection_lost(self, exc: Exception | None) -> None:
        self._end()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        before = self._due
        if before is None and (self.cycle is None or self.cycle.response_complete):
            self._begin()  # the next request, or a response that no client waits for
        super().data_received(data)
        if before is not None and before is self._due:
            self._head += len(data)
            if self._head > HEAD_MOST:
                self.transport.close()

    def on_message_begin(self) -> None:
        super().on_message_begin()
        if self._due is None:
            self._begin()

    def on_headers_complete(self) -> None:
        self._end()
        super().on_headers_complete()

    def _begin(self) -> None:
        self._head = 0
        self._due = self.loop.call_later(HEAD_WITHIN_S, self.transport.close)

    def _end(self) -> None:
        if self._due is not None:
            self._due.cancel()
            self._due = None

    def _crowded(self) -> bool:
        """Whether this one is too many: in all, or of its address, so that none takes all places."""
        most, client = connections_most(), self.client
        if len(self.connections) <= most // 2 or client is None:
            return len(self.connections) > most
        clients = (getattr(one, "client", None) for one in self.connections)
        own = sum(1 for one in clients if one and one[0] == client[0])
        return len(self.connections) > most or own > most // 2

    def _tell(self) -> None:
        now = self.loop.time()
        if now - Connection.warned_at >= WARN_EVERY_S:
            Connection.warned_at = now
            where = self.client[0] if self.client else "a local socket"
            log.warning("too many connections (%d): closed one from %s", len(self.connections), where)


def connections_most() -> int:
    """As many as leave `FILES_KEPT` files."""
    files = resource.getrlimit(resource.RLIMIT_NOFILE)[0]
    if files == resource.RLIM_INFINITY:
        return CONNECTIONS_MOST
    return max(1, min(CONNECTIONS_MOST, files - FILES_KEPT))


def want_files() -> None:
    """Takes as many open files as the system allows this process, up to `FILES_WANTED`."""
    files, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = FILES_WANTED if most == resource.RLIM_INFINITY else min(FILES_WANTED, most)
    if files != resource.RLIM_INFINITY and files < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))
