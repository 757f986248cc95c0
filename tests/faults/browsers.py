"""Many browsers at the event stream, as bare sockets: one that reads nothing, two hundred that do."""

import selectors
import socket
import time

from tests.support.parts import Server

REQUEST = b"GET /events HTTP/1.1\r\nHost: 127.0.0.1\r\nAccept-Encoding: identity\r\n\r\n"


def asking(server: Server) -> socket.socket:
    """A connection that has asked for the events and not read yet."""
    one = socket.create_connection(("127.0.0.1", server.port), 10)
    one.sendall(REQUEST)
    return one


class Browsers:
    """So many streams, read by this thread whenever it is asked what they show."""

    def __init__(self, server: Server, count: int) -> None:
        self._texts: dict[socket.socket, bytes] = {}
        self._selector = selectors.DefaultSelector()
        for _ in range(count):
            one = asking(server)
            one.setblocking(False)
            self._texts[one] = b""
            self._selector.register(one, selectors.EVENT_READ)

    def showing(self, what: bytes) -> int:
        """How many have had this text since `forget`."""
        for key, _ in self._selector.select(0):
            one = key.fileobj
            assert isinstance(one, socket.socket)
            self._texts[one] += one.recv(65_536)
        return sum(what in text for text in self._texts.values())

    def forget(self) -> None:
        self._texts = dict.fromkeys(self._texts, b"")

    def close(self) -> None:
        self._selector.close()
        for one in self._texts:
            one.close()


def unread(one: socket.socket, idle_s: float = 1.0) -> bytes:
    """All that waited in the connection, up to a silence that is longer than the beat."""
    one.settimeout(idle_s)
    got = b""
    end = time.monotonic() + 5
    while time.monotonic() < end:
        got += one.recv(65_536)
    return got


def storm(server: Server, for_s: float) -> int:
    """Connects, asks and goes away, again and again; returns how often."""
    end = time.monotonic() + for_s
    times = 0
    while time.monotonic() < end:
        with asking(server) as one:
            if times % 2:
                one.recv(1)
        times += 1
    return times
