"""A slow connection between a browser and a server."""

import socket
import threading
import time
from collections.abc import Callable
from typing import Final, Self

TICK_S: Final = 0.1


class Line:
    """A relay to a server. While it is `slow`, it limits the speed of the server's data on each
    connection."""

    def __init__(self, port: int, bytes_per_s: int) -> None:
        self._server = port
        self._bytes_per_s = bytes_per_s
        self._listening = socket.create_server(("127.0.0.1", 0))
        self.port = int(self._listening.getsockname()[1])
        self.slow = False
        self.opened = 0
        self._thread = threading.Thread(target=self._accept, daemon=True)
        self._thread.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._listening.shutdown(socket.SHUT_RDWR)
        self._listening.close()
        self._thread.join(5)

    @property
    def url(self) -> str:
        return f"http://127.0.0.1:{self.port}"

    def _accept(self) -> None:
        while True:
            try:
                browser, _ = self._listening.accept()
            except OSError:
                return  # closed
            server = socket.create_connection(("127.0.0.1", self._server))
            self._start(self._carry, browser, server)
            self._start(self._crawl, server, browser)

    def _start(self, how: Callable[[socket.socket, socket.socket], None], *ends: socket.socket) -> None:
        threading.Thread(target=how, args=ends, daemon=True).start()

    def _carry(self, browser: socket.socket, server: socket.socket) -> None:
        try:
            while data := browser.recv(65_536):
                self.opened += data.startswith(b"GET /events?page=")
                server.sendall(data)
        except OSError:
            pass
        finally:
            server.close()

    def _crawl(self, server: socket.socket, browser: socket.socket) -> None:
        at_once = int(self._bytes_per_s * TICK_S)
        try:
            while data := server.recv(65_536):
                while data and self.slow:
                    browser.sendall(data[:at_once])
                    data = data[at_once:]
                    time.sleep(TICK_S)
                browser.sendall(data)
        except OSError:
            pass
        finally:
            browser.close()
