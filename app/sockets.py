"""The sockets on which this process listens. uvicorn opens its own, after everything else has started,
and tells nobody: they are looked for."""

import asyncio
import os
import socket
from collections.abc import Collection, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

LOOK_EVERY_S: Final = 0.02
LISTENING_WITHIN_S: Final = 5.0  # a socket that the server was given listened before
SEND_BUFFER: Final = 8_192  # bytes; Linux takes twice as many


def listeners() -> Iterator[tuple[str, socket.socket]]:
    """Each, by its name in /proc, as a duplicate that is closed when the next is asked for."""
    for entry in Path("/proc/self/fd").iterdir():
        with suppress(OSError):
            name = os.readlink(entry)
            if name.startswith("socket:"):
                with socket.socket(fileno=os.dup(int(entry.name))) as one:
                    if one.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN):
                        yield name, one


async def listening(before: Collection[str]) -> None:
    """Until there is another than those `before`; five seconds at most."""
    with suppress(TimeoutError):
        async with asyncio.timeout(LISTENING_WITHIN_S):
            while names() <= set(before):
                await asyncio.sleep(LOOK_EVERY_S)


def names() -> set[str]:
    return {name for name, _ in listeners()}


async def narrow() -> None:
    """Narrows what the next sockets to listen accept: of what a browser does not read little waits in
    the kernel, where nobody can take it back; the rest is never written, and is skipped."""
    with suppress(OSError):  # no /proc on this system
        before = names()
        await listening(before)
        for name, one in listeners():
            if name not in before:
                one.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, SEND_BUFFER)
