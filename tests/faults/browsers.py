"""Many clients of the event stream, as plain sockets: one that does not read, two hundred that do."""

import selectors
import socket
import time
from contextlib import suppress

from tests.support.parts import Server

REQUEST = b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept-Encoding: identity\r\n\r\n"


def asking(server: Server) -> socket.socket:
    """A connection that has requested the events and has not read yet."""
    client = socket.create_connection(("127.0.0.1", server.port), 10)
    client.sendall(REQUEST)
    return client


class Browsers:
    """A number of event streams, read by this thread in `showing`."""

    def __init__(self, server: Server, count: int) -> None:
        self._texts: dict[socket.socket, bytes] = {}
        self._selector = selectors.DefaultSelector()
        for _ in range(count):
            client = asking(server)
            client.setblocking(False)
            self._texts[client] = b""
            self._selector.register(client, selectors.EVENT_READ)

    def showing(self, expected: bytes) -> int:
        """How many have received this text since `forget`."""
        for key, _ in self._selector.select(0):
            client = key.fileobj
            assert isinstance(client, socket.socket)
            self._texts[client] += client.recv(65_536)
        return sum(expected in text for text in self._texts.values())

    def forget(self) -> None:
        self._texts = dict.fromkeys(self._texts, b"")

    def close(self) -> None:
        self._selector.close()
        for client in self._texts:
            client.close()


def unread(client: socket.socket, idle_s: float = 1.0) -> bytes:
    """Everything that was buffered in the connection, read for 5 s."""
    client.settimeout(idle_s)
    got = b""
    end = time.monotonic() + 5
    while time.monotonic() < end:
        with suppress(TimeoutError):  # a server that stood still for a moment
            got += client.recv(65_536)
    return got


def storm(server: Server, for_s: float) -> int:
    """Connects, requests the events and disconnects, repeatedly; returns how often."""
    end = time.monotonic() + for_s
    times = 0
    while time.monotonic() < end:
        with asking(server) as client:
            if times % 2:
                client.recv(1)
        times += 1
    return times
