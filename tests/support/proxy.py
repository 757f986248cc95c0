"""A proxy that shows a server below a path, and takes that path off or leaves it."""

import asyncio
import threading
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress


class Proxy:
    """Each request has a connection of its own; a socket that was upgraded goes on."""

    def __init__(self, target: int, path: str, strip: bool) -> None:
        """`target` is the server's port."""
        self._target = target
        self._path = path.encode()
        self._strip = strip

    async def connected(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        async with _closed(writer):
            head = await reader.readuntil(b"\r\n\r\n")
            there, back = await asyncio.open_connection("127.0.0.1", self._target)
            async with _closed(back):
                back.write(self._forwarded(head))
                ways = (_copy(reader, back), _copy(there, writer))
                tasks = [asyncio.ensure_future(way) for way in ways]
                await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                for task in tasks:
                    task.cancel()
                await asyncio.gather(*tasks, return_exceptions=True)

    def _forwarded(self, head: bytes) -> bytes:
        method, path, rest = head.split(b" ", 2)
        assert path.startswith(self._path + b"/"), path  # the panel has no other URLs
        if self._strip:
            path = path.removeprefix(self._path)
        if b"\r\nUpgrade:" not in rest:
            rest = rest.replace(b"Connection: keep-alive", b"Connection: close")
        return b" ".join((method, path, rest))


async def _copy(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    while data := await reader.read(65_536):
        writer.write(data)
        await writer.drain()


@asynccontextmanager
async def _closed(writer: asyncio.StreamWriter) -> AsyncIterator[None]:
    """Closes a connection after the block, and ends the block with it."""
    try:
        with suppress(OSError, asyncio.IncompleteReadError):
            yield
    finally:
        writer.close()
        with suppress(OSError):
            await writer.wait_closed()


@contextmanager
def proxied(target: int, port: int, path: str, strip: bool) -> Iterator[str]:
    """Runs a proxy in a thread; the URL of the panel behind it, without a slash at its end."""
    proxy = Proxy(target, path, strip)
    started = threading.Event()
    loop = asyncio.new_event_loop()

    async def serve() -> None:
        server = await asyncio.start_server(proxy.connected, "127.0.0.1", port)
        started.set()
        try:
            await asyncio.Event().wait()
        finally:
            server.close()
            others = asyncio.all_tasks() - {asyncio.current_task()}
            for other in others:
                other.cancel()
            await asyncio.gather(*others, return_exceptions=True)

    task = loop.create_task(serve())

    def run() -> None:
        with suppress(asyncio.CancelledError):
            loop.run_until_complete(task)

    thread = threading.Thread(target=run)
    thread.start()
    started.wait()
    try:
        yield f"http://127.0.0.1:{port}{path}"
    finally:
        loop.call_soon_threadsafe(task.cancel)
        thread.join()
        loop.close()
