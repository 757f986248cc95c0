"""The sockets on which this process listens. uvicorn opens its own, after everything else has started,
and tells nobody: they are looked for."""

import asyncio
import fcntl
import os
import socket
import sys
import termios
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

LOOK_EVERY_S: Final = 0.02
LISTENING_WITHIN_S: Final = 5.0  # a socket that the server was given listened before
INTERNET: Final = frozenset({socket.AF_INET, socket.AF_INET6})
LISTENS: Final = (socket.SOL_SOCKET, socket.SO_ACCEPTCONN)
SEND_BUFFER: Final = 8_192  # bytes; Linux takes twice as many


def opened() -> Iterator[tuple[str, socket.socket]]:
    """Each socket of this process, by its name in /proc, as a duplicate that is closed when the next is
    asked for."""
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            name = os.readlink(entry)
            if name.startswith("socket:"):
                with socket.socket(fileno=os.dup(int(entry.name))) as one:
                    yield name, one


def listeners() -> Iterator[tuple[str, socket.socket]]:
    """Those that listen."""
    return ((name, one) for name, one in opened() if one.getsockopt(*LISTENS))


async def listening(before: Collection[str]) -> None:
    """Until there is another than those `before`; five seconds at most."""
    with suppress(TimeoutError):
        async with asyncio.timeout(LISTENING_WITHIN_S):
            while names() <= set(before):
                await asyncio.sleep(LOOK_EVERY_S)


def names() -> set[str]:
    return {name for name, _ in listeners()}


async def narrow(ports: set[int]) -> None:
    """Narrows what the next sockets to listen accept, and adds their ports: of what a browser does not
    read little waits in the kernel, where nobody can take it back; the rest is never written."""
    with suppress(OSError):  # no /proc on this system
        before = names()
        await listening(before)
        for name, one in listeners():
            if name not in before and one.family in INTERNET:
                ports.add(one.getsockname()[1])
                one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)


def hang_up(ports: Collection[int]) -> None:
    """Cuts the connections that came by one of these ports and still have something to send: uvicorn
    waits for them for ever, also where nobody reads."""
    with suppress(OSError):
        for _, one in opened():
            if one.family in INTERNET and one.getsockname()[1] in ports and unsent(one):
                with suppress(OSError):
                    one.shutdown(socket.SHUT_RDWR)


def unsent(one: socket.socket) -> int:
    """How many bytes wait in the kernel; 0 for one that listens."""
    if one.getsockopt(*LISTENS):
        return 0
    return int.from_bytes(fcntl.ioctl(one, termios.TIOCOUTQ, bytes(4)), sys.byteorder)
