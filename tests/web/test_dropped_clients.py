"""Clients that break the rules or go away: no traceback, one line for each kind, then a count."""

import base64
import json
import logging
import os
import random
import socket
import struct
from collections.abc import Callable, Iterator
from contextlib import suppress
from typing import Final

import pytest

from app.system.log import COUNTED_FOR_S, RepeatedRecords
from app.web.server import CLIENT_FAULTS, ClientFaults
from tests.support.holds import PANEL
from tests.support.parts import ROOT, Server
from tests.support.servers import demo_server, ready

LOOKS: Final = """
[[page.widget]]
id = "view"
kind = "camera"
label = "View"
topic = "/view"
type = "sensor_msgs/msg/CompressedImage"
"""
HOST: Final = b"Host: 127.0.0.1\r\n"
PRESS: Final = json.dumps({"inputs": {"speed": 0.5}}).encode()
POST: Final = (
    b"POST /widgets/jog HTTP/1.1\r\n"
    + HOST
    + b"Content-Type: application/json\r\nContent-Length: %d\r\n\r\n" % len(PRESS)
    + PRESS
)
PATHS: Final = ("", "log", "log.csv", "events", "metrics", "openapi.json", "widgets/view/frame", "none")
SOCKETS: Final = ("presses", "widgets/jog/hold", "widgets/view/frames")


@pytest.fixture(scope="module")
def cell(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    with demo_server(tmp_path_factory.mktemp("cell"), PANEL + LOOKS) as mine:
        yield mine


def get(path: str) -> bytes:
    return f"GET /{path} HTTP/1.1\r\n".encode() + HOST + b"\r\n"


def handshake(path: str, host: bytes = HOST, more: bytes = b"") -> bytes:
    key = base64.b64encode(os.urandom(16))
    upgrade = b"Connection: Upgrade\r\nUpgrade: websocket\r\nSec-WebSocket-Version: 13\r\n"
    head = f"GET /{path} HTTP/1.1\r\n".encode() + host + upgrade
    return head + more + b"Sec-WebSocket-Key: " + key + b"\r\n\r\n"


def frame(first: int, data: bytes) -> bytes:
    """A masked frame; `first` is its first byte."""
    return struct.pack(">BB4x", first, 0x80 | len(data)) + data


def connected(server: Server) -> socket.socket:
    return socket.create_connection(("127.0.0.1", server.port), 10)


def drop(client: socket.socket) -> None:
    """Closes with a reset, as a machine does that was switched off and on."""
    client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    client.close()


def lines_after(server: Server, act: Callable[[], None]) -> list[str]:
    """The lines of the log that are not about presses and holds, up to an answer after the act."""
    before = len(server.process.lines)
    act()
    assert server.http.get("/healthz").status_code == 200
    # What is logged in order, by the same thread, has come when this has.
    server.press("none", "a mark")
    return [
        line for line in server.process.lines[before:] if "press " not in line and "hold " not in line
    ]


def test_clients_that_drop_pipelined_requests_leave_nothing_in_the_log(cell: Server) -> None:
    def act() -> None:
        for number in range(20):
            client = connected(cell)
            client.sendall(POST * 200)
            (drop if number % 2 else socket.socket.close)(client)
        for path in PATHS:
            client = connected(cell)
            client.sendall(get(path) * 20)
            drop(client)

    assert lines_after(cell, act) == []


def test_clients_that_drop_sockets_at_any_moment_leave_nothing_in_the_log(cell: Server) -> None:
    chance = random.Random(1)
    said = (b'{"next": true}', b'{"do": "begin"}', b"{}", b"")

    def act() -> None:
        for _ in range(60):
            with connected(cell) as client, suppress(OSError):
                client.settimeout(chance.choice((0.001, 0.02, 0.2)))
                client.sendall(handshake(chance.choice(SOCKETS)))
                for _ in range(chance.randrange(4)):
                    client.recv(65_536)
                    client.sendall(frame(0x81, chance.choice(said)))
                if chance.random() < 0.5:
                    drop(client)

    assert lines_after(cell, act) == []


REFUSED: Final = {
    "another host": handshake("presses", b"Host: evil.example\r\n"),
    "another site": handshake("presses", more=b"Origin: http://evil.example\r\n"),
    "no such widget": handshake("widgets/none/hold"),
    "no such path": handshake("none"),
    "no key": handshake("presses").replace(b"Sec-WebSocket-Key", b"X-Key"),
    "another version": handshake("presses").replace(b"Version: 13", b"Version: 9"),
}


@pytest.mark.parametrize("request_", REFUSED.values(), ids=REFUSED)
def test_a_refused_socket_is_answered_and_not_logged(cell: Server, request_: bytes) -> None:
    def act() -> None:
        for _ in range(10):
            with connected(cell) as client:
                client.sendall(request_)
                assert client.recv(65_536).startswith(b"HTTP/1.1 4")

    assert lines_after(cell, act) == []


NOT_TEXT: Final = frame(0x81, b"\xff\xfe\xff")
BROKEN_FRAMES: Final = {
    "no such opcode": frame(0x83, b"x"),
    "not masked": b"\x81\x01x",
    "reserved bits": frame(0xF1, b""),
    "a ping that is too long": struct.pack(">BBH4x", 0x89, 0xFE, 200) + bytes(200),
    "half a close code": frame(0x88, b"\x03"),
    "no such close code": frame(0x88, struct.pack(">H", 9999)),
    "nothing to continue": frame(0x80, b"x"),
    "a close reason that is not text": frame(0x88, b"\x03\xe8\xff"),
}


@pytest.mark.parametrize("data", BROKEN_FRAMES.values(), ids=BROKEN_FRAMES)
@pytest.mark.parametrize("path", SOCKETS)
def test_a_broken_frame_closes_the_socket_and_is_not_logged(
    cell: Server, path: str, data: bytes
) -> None:
    def act() -> None:
        with connected(cell) as client:
            client.sendall(handshake(path))
            assert b" 101 " in client.recv(65_536)
            client.sendall(data)
            while client.recv(65_536):
                pass

    assert lines_after(cell, act) == []


NO_REQUESTS: Final = (b"\x16\x03\x01\x02\x00\x01", b"GET /\xff HTTP/1.1\r\n\r\n", b"a b c\r\n\r\n")


def test_invalid_request_and_invalid_text_are_one_log_line_each(cell: Server) -> None:
    def act() -> None:
        for data in NO_REQUESTS * 10:
            with connected(cell) as client:
                client.sendall(data)
                assert client.recv(65_536).startswith(b"HTTP/1.1 400 ")
        for path in SOCKETS * 5:
            with connected(cell) as client:
                client.sendall(handshake(path))
                client.recv(65_536)
                client.sendall(NOT_TEXT)
                while client.recv(65_536):
                    pass

    lines = lines_after(cell, act)
    assert len(lines) == 2, lines
    for words in ("Invalid HTTP request received.", "Invalid UTF-8 sequence received from client."):
        assert sum(CLIENT_FAULTS[words] in line for line in lines) == 1


class Lines(logging.Handler):
    def __init__(self) -> None:
        super().__init__()
        self.lines: list[str] = []

    def emit(self, record: logging.LogRecord) -> None:
        self.lines.append(logging.Formatter().format(record))


def test_repeated_records_are_counted_and_the_first_traceback_stays() -> None:
    now = 0.0
    repeated = RepeatedRecords(lambda: now)
    log, lines = logging.Logger("test"), Lines()
    log.addHandler(lines)
    log.addFilter(repeated)

    def fail(number: int) -> None:
        try:
            raise ValueError(number)
        except ValueError:
            log.exception("request %d broke off", number)

    for number in range(167):
        fail(number)
        log.warning("another kind")
        log.info("not counted")
    assert sum("Traceback" in line for line in lines.lines) == 1
    assert lines.lines.count("another kind") == 1
    assert lines.lines.count("not counted") == 167
    repeated.write_counts(log)
    assert len(lines.lines) == 169  # not yet
    now = COUNTED_FOR_S
    repeated.write_counts(log)
    assert lines.lines[169:] == [
        "request 0 broke off: 166 more in the last minute",
        "another kind: 166 more in the last minute",
    ]
    fail(1)
    assert "Traceback" in lines.lines[-1]


def test_a_fault_of_the_server_keeps_its_traceback() -> None:
    record = logging.makeLogRecord({"msg": "Exception in ASGI application\n", "levelno": logging.ERROR})
    record.exc_info = (ValueError, ValueError("x"), None)
    assert ClientFaults().filter(record)
    assert record.exc_info is not None


def test_the_count_is_written_by_the_server() -> None:
    words = CLIENT_FAULTS["Unsupported upgrade request."]
    with ready(Server(ROOT, app="tests.support.apps.hasty:app")) as hasty:
        for _ in range(3):
            with connected(hasty) as client:
                client.sendall(handshake("presses").replace(b"Upgrade: websocket", b"Upgrade: h2c"))
                client.recv(65_536)
        assert hasty.process.count(f"{words}: 2 more in the last minute") == 1
