"""What the HTTP server takes from its clients: started as users start it, without any flag."""

import asyncio
import base64
import os
import re
import socket
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import httpx
import pytest
from starlette.types import Receive, Scope, Send
from uvicorn import Config
from websockets.exceptions import ConnectionClosed

from app.cell.permission.client_places import shares
from app.web.server import FILES_WANTED, MAX_DRAIN, Proxies, bounded, urls
from tests.support.apps.small import CONNECTIONS
from tests.support.parts import ENOUGH_S, REFERENCE, ROOT, Server, free_port, http_client, until
from tests.support.servers import ready

HEAD = b"GET /healthz HTTP/1.1\r\nHost: 127.0.0.1\r\n"
UPGRADE = HEAD.replace(b"healthz", b"presses") + b"Connection: Upgrade\r\nUpgrade: websocket\r\n"
ELSEWHERE = "127.0.0.2"  # another address of this machine
MB = 1_000_000


@pytest.fixture(scope="module")
def plain() -> Iterator[Server]:
    with ready(Server(ROOT)) as mine:
        yield mine


@pytest.fixture(scope="module")
def hasty() -> Iterator[Server]:
    with ready(Server(ROOT, app="tests.support.apps.hasty:app")) as mine:
        yield mine


@contextmanager
def short_heads(within_s: float) -> Iterator[Server]:
    """A server that closes a connection when the head of a request takes longer, and for nothing
    else."""
    app, options = "tests.support.apps.short_heads:app", ["--timeout-keep-alive=60"]
    with Server(ROOT, app=app, options=options, HEAD_WITHIN_S=str(within_s)) as mine:
        yield mine


@pytest.fixture(scope="module")
def shortest_heads() -> Iterator[Server]:
    with short_heads(0.5) as mine:
        yield mine


def opened(server: Server, address: str = "127.0.0.1") -> socket.socket:
    client = socket.create_connection(("127.0.0.1", server.port), 10, (address, 0))
    client.settimeout(10)
    return client


def is_closed(client: socket.socket) -> bool:
    """Whether the server has closed it; what it said before is read."""
    client.setblocking(False)
    try:
        while client.recv(65_536):
            pass
        return True
    except BlockingIOError:
        return False
    except OSError:
        return True


def pushed(client: socket.socket, piece: bytes, most: int) -> int:
    """How many bytes the server took until it closed the connection."""
    sent = 0
    with suppress(OSError):
        while sent < most:
            client.sendall(piece)
            sent += len(piece)
    return sent


def memory(server: Server) -> int:
    """The most that the server ever had, in bytes."""
    status = Path(f"/proc/{server.process.pid}/status").read_text()
    match = re.search(r"VmHWM:\s+(\d+) kB", status)
    assert match
    return int(match[1]) * 1024


def upgraded(client: socket.socket) -> str:
    """The answer to who wants a socket for presses, with compression."""
    key = base64.b64encode(os.urandom(16)).decode()
    client.sendall(
        b"GET /presses HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
        b"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Extensions: permessage-deflate\r\n"
        b"Sec-WebSocket-Key: " + key.encode() + b"\r\n\r\n"
    )
    answer = b""
    while b"\r\n\r\n" not in answer:
        answer += client.recv(4096)
    return answer.decode()


def test_a_socket_that_sends_too_much_is_closed_at_once_and_nothing_is_unpacked(plain: Server) -> None:
    before = memory(plain)
    for _ in range(6):
        with opened(plain) as client:
            answer = upgraded(client)
            assert answer.startswith("HTTP/1.1 101 ")
            assert "permessage-deflate" not in answer
            client.sendall(struct.pack(">BBQ4s", 0x81, 0xFF, 16 * MB, bytes(4)))
            assert pushed(client, bytes(65_536), 16 * MB) < 12 * MB  # the rest waits in no kernel
    assert memory(plain) - before < 8 * MB


def test_a_message_in_pieces_is_bounded_as_a_whole(plain: Server) -> None:
    with plain.socket() as press_socket:
        with suppress(ConnectionClosed):  # before the last piece has left
            press_socket.say(["9" * 60_000, "9" * 6_000])
        assert press_socket.closed() == 1009


@pytest.mark.long("table")
@pytest.mark.parametrize(
    "said",
    [
        pytest.param([], id="nothing"),
        pytest.param([HEAD], id="half a head"),
        pytest.param([HEAD, *[b"X-A: b\r\n"] * 1000], id="a head that never ends"),
        pytest.param([b"\r\n"] * 1000, id="empty lines"),
        pytest.param([HEAD + b"\r\n", *[b"\r\n"] * 1000], id="empty lines after a request"),
        pytest.param([HEAD + b"\r\n" + HEAD, *[b"X-A: b\r\n"] * 1000], id="a second head"),
        pytest.param(
            [UPGRADE + b"X-A: " + bytes(10_000).replace(b"\0", b"b") + b"\r\n\r\n"], id="a handshake"
        ),
    ],
)
def test_a_head_has_its_time(shortest_heads: Server, said: list[bytes]) -> None:
    with opened(shortest_heads) as client:
        left = iter(said)

        def closed() -> bool:
            if is_closed(client):
                return True
            with suppress(OSError, StopIteration):
                client.send(next(left))
            return False

        until(closed, "it is closed", every_s=0.1)


@pytest.mark.parametrize("piece", [b"X-A: " + b"b" * 1000 + b"\r\n", b"b" * 1000], ids=["many", "long"])
def test_a_head_has_its_size(plain: Server, piece: bytes) -> None:
    before = memory(plain)
    with opened(plain) as client:
        client.sendall(HEAD + b"X: ")
        assert pushed(client, piece, 64 * MB) < 12 * MB
    assert memory(plain) - before < 8 * MB


def test_streams_sockets_and_kept_connections_have_no_such_time() -> None:
    with (
        short_heads(2.0) as mine,
        http_client(mine.url, limits=httpx.Limits(keepalive_expiry=ENOUGH_S)) as kept,
        mine.stream() as stream,
        mine.socket() as press_socket,
    ):
        assert kept.get("/healthz").status_code == 200
        for _ in range(6):  # three seconds
            stream.next("beat")
        assert press_socket.press(widget="nothing", inputs={}).status_code == 404
        assert kept.get("/healthz").status_code == 200


@pytest.mark.parametrize("path", ["/widgets/operation", "/widgets/operation/cancel"])
def test_a_body_has_its_time(hasty: Server, path: str) -> None:
    head = f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    with opened(hasty) as client:
        client.sendall(f"{head}Content-Length: 100\r\n\r\n{{".encode())
        answer = b"".join(iter(lambda: client.recv(65_536), b"")).decode()  # until it is closed
        assert answer.startswith("HTTP/1.1 408 ")
        assert "the body took longer than 0.5 s" in answer


@pytest.mark.parametrize("more", ["", "Connection: close\r\n"], ids=["kept", "closed"])
@pytest.mark.parametrize(
    "path", ["/widgets/operation", "/widgets/operation/cancel", "/display", "/none"]
)
def test_oversized_body_gets_its_response(plain: Server, path: str, more: str) -> None:
    head = f"POST {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n{more}"
    with opened(plain) as client:
        client.sendall(f"{head}Content-Length: {5 * MB}\r\n\r\n".encode())
        for _ in range(50):
            client.sendall(bytes(MB // 10))  # a client that reads only when it has sent all
        assert client.recv(65_536).startswith(b"HTTP/1.1 413 ")
        if not more:  # the connection goes on
            client.sendall(HEAD + b"\r\n")
            until(lambda: b"HTTP/1.1 200 OK" in client.recv(65_536), "the next answer")


def test_the_rest_of_a_body_is_not_read_for_ever(plain: Server) -> None:
    head = "POST /none HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n"
    before = memory(plain)
    with opened(plain) as client:
        client.sendall(f"{head}Content-Length: {500 * MB}\r\n\r\n".encode())
        assert pushed(client, bytes(65_536), 500 * MB) < MAX_DRAIN + 12 * MB
    assert memory(plain) - before < 8 * MB


def test_dropped_request_body_leaves_no_traceback(plain: Server) -> None:
    lines = len(plain.process.lines)
    head = "POST /widgets/operation HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Type: application/json\r\n"
    for _ in range(20):
        with opened(plain) as client:
            client.sendall(f"{head}Content-Length: 100\r\n\r\n{{".encode())
    assert plain.press("operation", "after them").status_code == 200
    said = plain.process.lines[lines:]
    until(lambda: any("press " in line for line in plain.process.lines[lines:]), "what came after")
    assert [line for line in said if "press " not in line] == []


def test_other_machines_leave_places_for_the_kiosk(hasty: Server) -> None:
    """An address has an eighth of the places, and all others together leave a tenth."""
    limits = shares(CONNECTIONS)
    with ExitStack() as stack:
        streams = []
        for address in (f"127.0.0.{number}" for number in range(2, 2 + CONNECTIONS)):
            for _ in range(2 * limits.client):
                client = stack.enter_context(opened(hasty, address))
                streams.append(client)
                with suppress(OSError):
                    client.sendall(HEAD.replace(b"healthz", b"events") + b"\r\n")
        until(
            lambda: sum(map(is_closed, streams)) == len(streams) - limits.others,
            "others have their places",
        )
        with opened(hasty) as kiosk:
            kiosk.sendall(HEAD + b"\r\n")
            assert kiosk.recv(65_536).startswith(b"HTTP/1.1 200 ")
    assert hasty.process.count("too many connections: one closed for one from 127.0.0.")


@pytest.mark.parametrize("address", ["127.0.0.1", ELSEWHERE], ids=["the kiosk", "another"])
def test_silent_connections_give_way_to_their_own_client(hasty: Server, address: str) -> None:
    with ExitStack() as stack:
        silent = [stack.enter_context(opened(hasty, address)) for _ in range(3 * CONNECTIONS)]
        until(lambda: sum(map(is_closed, silent)) >= 2 * CONNECTIONS, "some have given way")
        for _ in range(3):
            with opened(hasty, address) as client:
                client.sendall(HEAD + b"\r\n")
                assert client.recv(65_536).startswith(b"HTTP/1.1 200 ")


def test_server_raises_its_file_limit(servers: Callable[[Server], Server]) -> None:
    mine = servers(Server(ROOT, before=["prlimit", "--nofile=300:8000"]))
    limits = Path(f"/proc/{mine.process.pid}/limits").read_text()
    assert re.search(rf"Max open files\s+{FILES_WANTED}\s+8000\s", limits)


def test_tighter_file_limit_stays() -> None:
    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        raise AssertionError("it is not called")

    class Lifespan:
        def __init__(self, config: Config) -> None:
            self.config = config

        async def receive(self) -> dict[str, str]:
            return {}

    server = Config(app, ws_max_size=1000, ws_max_queue=1)
    server.load()
    assert bounded(Lifespan(server).receive) is server
    assert (server.ws_max_size, server.ws_max_queue) == (1000, 1)
    assert server.loaded_app is app
    assert bounded(asyncio.Queue[dict[str, str]]().get) is None  # another server's


def test_the_unit_starts_the_server_and_gives_it_the_files_that_it_wants() -> None:
    unit = (ROOT / "deploy/operator-panel.service").read_text()
    assert "\nExecStart=/opt/operator-panel/current/bin/operator-panel run\n" in unit
    assert f"\nLimitNOFILE={FILES_WANTED}\n" in unit


# Who is behind a proxy.


def address_of(server: Server, **headers: str) -> str:
    """That of a press, as the operator's log has it."""
    press = {"inputs": {"message": "x"}}
    answer = server.http.post("/widgets/operation", json=press, headers=headers)
    assert answer.status_code == 200
    row = server.http.get("/log.csv?every=true").text.splitlines()[1].split(",")
    return row[7]


def test_a_forwarded_address_counts_for_nothing_whatever_the_options_of_uvicorn(
    servers: Callable[[Server], Server],
) -> None:
    mine = servers(Server(ROOT, options=["--forwarded-allow-ips", "*"], FORWARDED_ALLOW_IPS="*"))
    until(mine.ready, "ready")
    assert address_of(mine, **{"X-Forwarded-For": "203.0.113.9"}) == "127.0.0.1"
    with mine.socket(**{"X-Forwarded-For": "203.0.113.9"}) as press_socket:
        assert press_socket.press(widget="operation", inputs={"message": "x"}).status_code == 200
    assert "203.0.113.9" not in mine.process.text


def test_a_named_proxy_is_believed(servers: Callable[[Server], Server]) -> None:
    mine = servers(Server(ROOT, KIOSK_PROXIES="127.0.0.1,198.51.100.0/24"))
    until(mine.ready, "ready")
    forged = "203.0.113.9, 192.0.2.4, 198.51.100.7"  # the last that no named proxy has is the client
    assert address_of(mine, **{"X-Forwarded-For": forged}) == "192.0.2.4"
    assert address_of(mine) == "127.0.0.1"


@pytest.mark.parametrize(
    ("peer", "forwarded", "client"),
    [
        ("192.0.2.2", "192.0.2.9", "192.0.2.9"),
        ("192.0.2.2", "127.0.0.1", "192.0.2.2"),  # on the proxy's machine is not at the cell
        ("192.0.2.2", "::1", "192.0.2.2"),
        ("192.0.2.3", "192.0.2.9", "192.0.2.3"),
        ("127.0.0.1", "127.0.0.1", "127.0.0.1"),
        ("127.0.0.1", "192.0.2.9", "192.0.2.9"),
        ("127.0.0.1", "192.0.2.9, 192.0.2.2", "192.0.2.9"),
        ("127.0.0.1", "", "127.0.0.1"),
    ],
)
def test_client_behind_a_proxy_is_at_the_cell_only_if_the_proxy_is(
    peer: str, forwarded: str, client: str
) -> None:
    addresses: list[str] = []

    async def app(scope: Scope, receive: Receive, send: Send) -> None:
        addresses.append(scope["client"][0])

    async def serve() -> None:
        scope = {
            "type": "http",
            "client": (peer, 1),
            "headers": [(b"x-forwarded-for", forwarded.encode())],
        }
        queue: asyncio.Queue[Any] = asyncio.Queue()
        await Proxies(app, ["127.0.0.1", "192.0.2.2"])(scope, queue.get, queue.put)

    asyncio.run(serve())
    assert addresses == [client]


# Where it listens.


def refused(folder: Path, *options: str) -> str:
    """What a server says that can't start."""
    env = {"KIOSK_DATA": str(folder), "PATH": "/usr/bin:/bin"}
    command = [sys.executable, "-m", "uvicorn", "app.main:app", *options]
    done = subprocess.run(
        command, cwd=ROOT, env=env, capture_output=True, text=True, timeout=30, check=False
    )
    assert done.returncode != 0
    assert "Traceback" not in done.stderr
    assert "Zenoh" not in done.stderr  # nothing else had begun
    return done.stderr


def test_a_port_in_use_is_one_sentence(plain: Server, tmp_path: Path) -> None:
    said = refused(tmp_path, "--port", str(plain.port))
    assert said.count(str(plain.port)) == 1
    assert f"can't listen on 127.0.0.1 port {plain.port}: another program does, perhaps" in said


def test_start_logs_the_used_files_and_the_address(servers: Callable[[Server], Server]) -> None:
    panel = REFERENCE
    mine = servers(Server(ROOT, KIOSK_MODE="live"))
    until(
        lambda: f"the panel is at http://127.0.0.1:{mine.port}\n" in mine.process.text + "\n", "where"
    )
    said = f'panel "Robot cell 1" ({panel}), robot live by {ROOT / "zenoh.json5"}, data in {mine.data}'
    assert mine.process.count(said)


@pytest.mark.parametrize(
    ("host", "addresses"),
    [
        ("127.0.0.1", ["http://127.0.0.1:80"]),
        ("::1", ["http://[::1]:80"]),
        ("0.0.0.0", ["http://localhost:80", "http://cell1.local:80"]),
    ],
)
def test_a_panel_is_found_by_its_names(host: str, addresses: list[str]) -> None:
    assert urls(None, [(host, 80)], ["localhost", "cell1.local"]) == addresses


def test_an_address_that_is_not_there_is_one_sentence(tmp_path: Path) -> None:
    said = refused(tmp_path, "--host", "192.0.2.1", "--port", str(free_port()))
    assert "can't listen on 192.0.2.1 port" in said
    assert "cannot assign requested address" in said
