"""The listening sockets of this process. uvicorn opens them after everything else has started and has
no callback for it, so they are found in /proc."""

import asyncio
import errno
import fcntl
import os
import socket
import sys
import termios
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.system.errors import SettingsError

POLL_INTERVAL_S: Final = 0.02
LISTEN_TIMEOUT_S: Final = 5.0  # a socket passed to the server listens from the start
INET_FAMILIES: Final = frozenset({socket.AF_INET, socket.AF_INET6})
ACCEPTS_CONNECTIONS: Final = (socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
SEND_BUFFER_BYTES: Final = 8_192  # Linux doubles it
USER_TIMEOUT_MS: Final = 120_000  # TCP_USER_TIMEOUT


def open_sockets() -> Iterator[tuple[str, socket.socket]]:
    """Yields (name in /proc, socket) for each socket of this process. The socket is a duplicate, closed
    after its iteration."""
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            name = os.readlink(entry)
            if name.startswith("socket:"):
                with socket.socket(fileno=os.dup(int(entry.name))) as sock:
                    yield name, sock


def listening_sockets() -> Iterator[tuple[str, socket.socket]]:
    """`open_sockets` that listen."""
    return ((name, sock) for name, sock in open_sockets() if sock.getsockopt(*ACCEPTS_CONNECTIONS))


async def wait_for_listener(before: Collection[str]) -> None:
    """Waits until a socket listens that is not in `before`, at most `LISTEN_TIMEOUT_S`."""
    with suppress(TimeoutError):
        async with asyncio.timeout(LISTEN_TIMEOUT_S):
            while listener_names() <= set(before):
                await asyncio.sleep(POLL_INTERVAL_S)


def listener_names() -> set[str]:
    return {name for name, _ in listening_sockets()}


async def limit_send_buffer(ports: set[int]) -> list[tuple[str, int]]:
    """Waits for the server's sockets, limits the send buffer of their connections and adds their ports
    to `ports`. Returns their (host, port).

    A small buffer means that little old data waits in the kernel for a browser that does not read. A
    client that disappears, or does not read for `USER_TIMEOUT_MS`, is disconnected.
    """
    addresses: list[tuple[str, int]] = []
    with suppress(OSError):  # no /proc on this system
        before = listener_names()
        await wait_for_listener(before)
        for name, sock in listening_sockets():
            if name not in before and sock.family in INET_FAMILIES:
                host, port = sock.getsockname()[:2]
                ports.add(port)
                addresses.append((host, port))
                sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER_BYTES)
                sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT, USER_TIMEOUT_MS)
    return addresses


def abort_unsent(ports: Collection[int]) -> None:
    """Closes the connections of these ports that have unsent data: uvicorn would wait for them without
    a limit."""
    with suppress(OSError):
        for _, sock in open_sockets():
            if sock.family in INET_FAMILIES and sock.getsockname()[1] in ports and unsent_bytes(sock):
                with suppress(OSError):
                    sock.shutdown(socket.SHUT_RDWR)


def unsent_bytes(sock: socket.socket) -> int:
    """The number of bytes in the send queue; 0 for a listening socket."""
    if sock.getsockopt(*ACCEPTS_CONNECTIONS):
        return 0
    return int.from_bytes(fcntl.ioctl(sock, termios.TIOCOUTQ, bytes(4)), sys.byteorder)


def check_port_free(host: str, port: int) -> None:
    """SettingsError if the address can't be listened on now."""
    where = f"can't listen on {host} port {port}"
    try:
        infos = socket.getaddrinfo(host or None, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE)
        for family, kind, protocol, _, address in infos:
            with socket.socket(family, kind, protocol) as probe:
                probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
                if family == socket.AF_INET6:  # as asyncio does
                    probe.setsockopt(socket.IPPROTO_IPV6, socket.IPV6_V6ONLY, 1)
                probe.bind(address)
    except OSError as error:
        if error.errno != errno.EADDRINUSE:
            raise SettingsError(f"{where}: {(error.strerror or str(error)).lower()}") from error
        raise SettingsError(
            f"{where}: another program does, perhaps another panel; end that one, or start this one "
            "with --port and another number"
        ) from error
