"""A client that asks as fast as it can: `python -m tests.support.flood PORT ADDRESS PATH CONNECTIONS
SECONDS`. It writes how many answers came, by status, as JSON."""

import asyncio
import json
import sys
import time
from collections import Counter
from contextlib import suppress


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


if __name__ == "__main__":
    _, where, source, target, count, duration = sys.argv
    print(json.dumps(asyncio.run(flood(int(where), source, target, int(count), float(duration)))))
