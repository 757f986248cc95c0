"""Many bare clients in one process: each keeps a stream open and records the arrival of numbered texts.

Controlled by JSON lines, see `tests/ros_nodes/commands.py`. Uses plain sockets, so that hundreds of
clients take little CPU time from the measured server.
"""

import base64
import contextlib
import http.client
import os
import re
import selectors
import socket
import threading
import time
from typing import Any, Final

from tests.ros_nodes.commands import obey

NUMBER: Final = re.compile(rb"#(\d{9})#")
WAKE_S: Final = 0.05
CONNECT_S: Final = 10.0
RECEIVE: Final = 1 << 18


def request(kind: str, host: str, path: str) -> bytes:
    lines = [f"GET {path} HTTP/1.1", f"Host: {host}"]
    if kind == "events":
        lines += ["Accept: text/event-stream"]
    else:
        key = base64.b64encode(os.urandom(16)).decode()
        lines += ["Connection: Upgrade", "Upgrade: websocket", "Sec-WebSocket-Version: 13"]
        lines += [f"Sec-WebSocket-Key: {key}", f"Origin: http://{host}"]
    return "\r\n".join([*lines, "", ""]).encode()


def frame(said: str | bytes) -> bytes:
    """A client's text or binary frame; masked with zeros, which RFC 6455 permits."""
    kind, data = (0x81, said.encode()) if isinstance(said, str) else (0x82, said)
    length = len(data)
    head = (
        bytes([kind, 0x80 | length])
        if length < 126
        else bytes([kind, 0xFE]) + length.to_bytes(2, "big")
    )
    return head + bytes(4) + data


def found_in_page(port: int, pattern: str) -> str:
    """The match of a pattern in a newly requested page."""
    with contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=CONNECT_S)) as server:
        server.request("GET", "/")
        page = server.getresponse().read().decode()
    match = re.search(pattern, page)
    if match is None:
        raise ValueError(f"the page has no {pattern}")
    return match.group(1)


class Crowd:
    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._selector = selectors.DefaultSelector()
        self._sockets: list[socket.socket] = []
        self._came: list[tuple[int, int]] = []  # (number, monotonic ns)
        self._bytes = 0
        self._lost = 0
        self._query = self._answer = b""
        threading.Thread(target=self._run, daemon=True).start()

    def join(
        self,
        count: int,
        port: int,
        kind: str,
        path: str,
        say: list[str],
        say_bytes: list[str],
        id_pattern: str,
        answers: list[str] | None,
    ) -> int:
        """Connects clients until there are `count`. For the other arguments see `bench.peer.Bare`;
        `say_bytes` is in hex."""
        if answers is not None:
            query, answer = answers
            self._query, self._answer = bytes([0x81, len(query)]) + query.encode(), frame(answer)
        frames = [*map(frame, say), *(frame(bytes.fromhex(said)) for said in say_bytes)]
        while len(self._sockets) < count:
            own = path.format(id=found_in_page(port, id_pattern)) if id_pattern else path
            client = socket.create_connection(("127.0.0.1", port), CONNECT_S)
            client.sendall(request(kind, f"127.0.0.1:{port}", own))
            head = client.recv(RECEIVE)
            ok = b" 101 " if kind == "websocket" else b" 200 "
            if ok not in head.split(b"\r\n", 1)[0]:
                raise ConnectionError(head[:200].decode(errors="replace"))
            client.sendall(b"".join(frames))
            client.setblocking(False)
            with self._lock:
                self._sockets.append(client)
                self._selector.register(client, selectors.EVENT_READ, [-1])
        return len(self._sockets)

    def _run(self) -> None:
        while True:
            ready = self._selector.select(WAKE_S)
            with self._lock:
                for key, _ in ready:
                    if key.fd in self._selector.get_map():
                        self._read(key)

    def _read(self, key: selectors.SelectorKey) -> None:
        client: Any = key.fileobj
        try:
            data = client.recv(RECEIVE)
        except OSError:
            data = b""
        at = time.monotonic_ns()
        if not data:
            self._lost += 1
            self._selector.unregister(client)
            return
        self._bytes += len(data)
        if self._query and self._query in data:
            client.sendall(self._answer)
        last = key.data
        for digits in NUMBER.findall(data):
            number = int(digits)
            if number > last[0]:
                last[0] = number
                self._came.append((number, at))

    def forget(self) -> None:
        """Clears the recorded arrivals and numbers."""
        with self._lock:
            for key in self._selector.get_map().values():
                key.data[0] = -1
            self._came, self._bytes = [], 0

    def came(self) -> dict[str, Any]:
        """(number, monotonic ns) of all arrivals at any client, the bytes received, and the number of
        clients that were disconnected."""
        return {"came": self._came, "bytes": self._bytes, "lost": self._lost}

    def leave(self) -> None:
        with self._lock:
            for client in self._sockets:
                if client in self._selector.get_map():
                    self._selector.unregister(client)
                client.close()
            self._sockets = []
        self._lost = 0
        self.forget()


if __name__ == "__main__":
    obey(Crowd())
