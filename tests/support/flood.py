"""A client that asks as fast as it can: `python -m tests.support.flood PORT ADDRESS PATH CONNECTIONS
SECONDS`. It writes how many answers came, by status, as JSON.

With a further argument PER_S it asks so often, whether answers come or not, from eight addresses from
ADDRESS on; "asked" is how often."""

import asyncio
import json
import random
import sys
import time
from collections import Counter
from contextlib import suppress
from ipaddress import ip_address
from typing import Final

ADDRESSES: Final = 8


async def ask(port: int, address: str, path: str, until: float, answers: Counter[str]) -> None:
    """Repeats one request on one connection, and opens that again when it is closed."""
    method, _, path = path.partition(" ") if " " in path else ("GET", "", path)
    request = f"{method} {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nContent-Length: 0\r\n\r\n".encode()
    while time.monotonic() < until:
        with suppress(OSError, asyncio.IncompleteReadError):
            reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=(address, 0))
            try:
                while time.monotonic() < until:
                    writer.write(request)
                    head = (await reader.readuntil(b"\r\n\r\n")).decode().lower()
                    answers[head.split()[1]] += 1
                    length = head.partition("content-length: ")[2].split("\r\n")[0]
                    await reader.readexactly(int(length or 0))
            finally:
                writer.close()


async def flood(port: int, address: str, path: str, connections: int, seconds: float) -> Counter[str]:
    answers: Counter[str] = Counter()
    until = time.monotonic() + seconds
    work = [ask(port, address, path, until, answers) for _ in range(connections)]
    await asyncio.wait([asyncio.ensure_future(job) for job in work], timeout=seconds + 2)
    return answers


async def ask_steadily(
    port: int, address: str, path: str, every_s: float, until: float, answers: Counter[str]
) -> None:
    """Sends a request each `every_s` on one connection, and opens that again when it is closed."""
    request = f"GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\n\r\n".encode()
    due = time.monotonic() + every_s * random.random()
    while time.monotonic() < until:
        with suppress(OSError, asyncio.IncompleteReadError):
            reader, writer = await asyncio.open_connection("127.0.0.1", port, local_addr=(address, 0))
            heard = asyncio.ensure_future(count_answers(reader, answers))
            try:
                while time.monotonic() < until and not heard.done():
                    await asyncio.sleep(max(0.0, due - time.monotonic()))
                    due += every_s
                    writer.write(request)
                    answers["asked"] += 1
            finally:
                heard.cancel()
                writer.close()


async def count_answers(reader: asyncio.StreamReader, answers: Counter[str]) -> None:
    with suppress(OSError, asyncio.IncompleteReadError):
        while True:
            head = (await reader.readuntil(b"\r\n\r\n")).decode().lower()
            answers[head.split()[1]] += 1
            length = head.partition("content-length: ")[2].split("\r\n")[0]
            await reader.readexactly(int(length or 0))


async def flood_steadily(
    port: int, first: str, path: str, connections: int, seconds: float, per_s: float
) -> Counter[str]:
    answers: Counter[str] = Counter()
    until, net = time.monotonic() + seconds, ip_address(first)
    work = [
        ask_steadily(port, str(net + i % ADDRESSES), path, connections / per_s, until, answers)
        for i in range(connections)
    ]
    await asyncio.wait([asyncio.ensure_future(job) for job in work], timeout=seconds + 2)
    return answers


if __name__ == "__main__":
    _, where, source, target, count, duration, *rate = sys.argv
    counts = (int(where), source, target, int(count), float(duration))
    made = flood_steadily(*counts, float(rate[0])) if rate else flood(*counts)
    print(json.dumps(asyncio.run(made)))
