"""Whether a server answers."""

import asyncio
from asyncio import StreamReader, StreamWriter

from app.tools.kiosk.watcher import server_answers
from tests.support.parts import free_port


async def _well(reader: StreamReader, writer: StreamWriter) -> None:
    assert (await reader.readline()).startswith(b"GET /healthz ")
    writer.write(b"HTTP/1.1 200 OK\r\n\r\n")
    writer.close()


async def _busy(_: StreamReader, writer: StreamWriter) -> None:
    writer.write(b"HTTP/1.1 503 Service Unavailable\r\n\r\n")
    writer.close()


def test_a_server_that_starts_later_answers_then() -> None:
    port = free_port()
    url = f"http://127.0.0.1:{port}/"

    async def answers() -> bool:
        async with await asyncio.start_server(_well, "127.0.0.1", port):
            return await server_answers(url)

    assert not asyncio.run(server_answers(url))
    assert asyncio.run(answers())


def test_a_server_that_is_not_well_does_not_answer() -> None:
    port = free_port()

    async def answers() -> bool:
        async with await asyncio.start_server(_busy, "127.0.0.1", port):
            return await server_answers(f"http://127.0.0.1:{port}/")

    assert not asyncio.run(answers())
