"""`python -m tests.support.modules_at_start`: starts the server by its environment, requests the first
page, and prints how many modules of the server, and how many in all, it has imported by then."""

import asyncio
import json
import sys
from collections.abc import Sequence
from typing import Any

from app.main import app
from app.web.routes import pages

# What is imported a moment after the start is not counted, on a slow machine either.
pages.COMPILED_AFTER_S = 3600.0

HEADERS: Sequence[tuple[bytes, bytes]] = ((b"host", b"127.0.0.1"),)
PAGE = {"type": "http", "method": "GET", "path": "/", "raw_path": b"/", "query_string": b""}


async def first_page() -> None:
    """The lifespan's start, and the page, without a socket."""
    started = asyncio.Event()
    asked: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
    await asked.put({"type": "lifespan.startup"})
    answers: list[dict[str, Any]] = []

    async def send(message: Any) -> None:
        answers.append(message)
        started.set()

    async def nothing() -> dict[str, Any]:
        return {"type": "http.request", "body": b"", "more_body": False}

    lifespan = asyncio.create_task(app({"type": "lifespan", "asgi": {}, "state": {}}, asked.get, send))
    await started.wait()
    scope = PAGE | {"headers": HEADERS, "http_version": "1.1", "scheme": "http", "state": {}}
    await app(scope | {"asgi": {}, "client": ("127.0.0.1", 1), "root_path": ""}, nothing, send)
    assert [answer.get("status") for answer in answers[:2]] == [None, 200], answers[:2]
    own = sum(name.startswith("app.") for name in sys.modules)
    print(json.dumps([own, len(sys.modules)]), flush=True)
    await asked.put({"type": "lifespan.shutdown"})
    await lifespan


if __name__ == "__main__":
    asyncio.run(first_page())
