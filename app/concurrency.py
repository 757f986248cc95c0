"""Tasks that no one awaits, waits that shutdown cancels, and commands that shutdown waits for."""

import asyncio
import logging
from collections.abc import AsyncIterator, Coroutine, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from typing import Any

from app.ros_logging import RobotLog


def spawn_logged(
    work: Coroutine[Any, Any, None], log: logging.Logger | RobotLog, failure: str
) -> "asyncio.Task[None]":
    """A task whose failure is logged, not lost."""

    def done(task: "asyncio.Task[None]") -> None:
        if not task.cancelled() and (error := task.exception()):
            log.error(failure, exc_info=error)

    task = asyncio.get_running_loop().create_task(work)
    task.add_done_callback(done)
    return task


class CancellableWaits:
    """On the event loop."""

    __slots__ = ("_cancelled", "_timeouts")

    def __init__(self) -> None:
        self._timeouts: set[asyncio.Timeout] = set()
        self._cancelled = False

    def cancel_all(self) -> None:
        """Ends all of them, and each later one where it first waits; once."""
        self._cancelled = True
        for limit in self._timeouts:
            limit.reschedule(asyncio.get_running_loop().time())

    @asynccontextmanager
    async def cancellable(self) -> AsyncIterator[None]:
        """TimeoutError where it was given up; what never waits is done in any case."""
        limit = asyncio.timeout(0 if self._cancelled else None)
        self._timeouts.add(limit)
        try:
            async with limit:
                yield
        finally:
            self._timeouts.discard(limit)


class InFlight:
    """On the event loop."""

    __slots__ = ("_count", "_idle")

    def __init__(self) -> None:
        self._count = 0
        self._idle = asyncio.Event()
        self._idle.set()

    @contextmanager
    def track(self) -> Iterator[None]:
        """While it lasts, somebody waits for an answer."""
        self._count += 1
        self._idle.clear()
        try:
            yield
        finally:
            self._count -= 1
            if not self._count:
                self._idle.set()

    async def drained(self, within_s: float) -> None:
        """Until nobody waits for one; `within_s` at most."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._idle.wait(), within_s)
