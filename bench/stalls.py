"""The application with a measurement of its event loop, for `uvicorn bench.stalls:app`.

`GET /stalls` answers the longest time between two turns since the last request: as the clock has it
(`wall_ms`), and how much of it the loop's thread has worked (`cpu_ms`), which is the server's own on a
machine with other work.
"""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, Final

from app.main import app as app

EVERY_S: Final = 0.002

_longest = {"wall_ms": 0.0, "cpu_ms": 0.0}
_inner = app.router.lifespan_context


async def _watch() -> None:
    while True:
        wall, cpu = time.perf_counter(), time.thread_time()
        await asyncio.sleep(EVERY_S)
        figures = {
            "wall_ms": 1000 * (time.perf_counter() - wall - EVERY_S),
            "cpu_ms": 1000 * (time.thread_time() - cpu),
        }
        for name, value in figures.items():
            _longest[name] = max(_longest[name], value)


@asynccontextmanager
async def _lifespan(app: Any) -> AsyncIterator[Any]:
    async with _inner(app) as state:
        watching = asyncio.create_task(_watch())
        yield state
        watching.cancel()


@app.get("/stalls", include_in_schema=False)
async def stalls() -> dict[str, float]:
    longest = dict(_longest)
    _longest.update(wall_ms=0.0, cpu_ms=0.0)
    return longest


app.router.lifespan_context = _lifespan
