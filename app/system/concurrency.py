"""Background tasks, waits that shutdown cancels, and commands that shutdown waits for."""

import asyncio
import logging
import time
from collections.abc import AsyncIterator, Callable, Coroutine, Iterable, Iterator
from contextlib import asynccontextmanager, contextmanager, suppress
from typing import Any, Final, Generic, TypeVar

from app.system.log import RobotLog

Built = TypeVar("Built")

RESTART_S: Final = 1.0  # from the failure of a task that is kept running to its next start
RESTART_MOST_S: Final = 30.0
_spawned: Final[set["asyncio.Task[None]"]] = set()  # the event loop alone keeps no task alive


def spawn_logged(
    work: Coroutine[Any, Any, None], log: logging.Logger | RobotLog, failure: str
) -> "asyncio.Task[None]":
    """Starts `work` as a task. An exception in it is logged as `failure`."""

    def done(task: "asyncio.Task[None]") -> None:
        _spawned.discard(task)
        if not task.cancelled() and (error := task.exception()):
            log.error(failure, exc_info=error)

    task = asyncio.get_running_loop().create_task(work)
    _spawned.add(task)
    task.add_done_callback(done)
    return task


def keep_running(
    work: Callable[[], Coroutine[Any, Any, None]], log: logging.Logger | RobotLog, failure: str
) -> "asyncio.Task[None]":
    """Starts `work` as a task, and starts it again after a pause if it ends with an exception, until it
    returns or the task is cancelled. The same exception again is not logged."""
    return asyncio.get_running_loop().create_task(_restarted(work, log, failure))


async def _restarted(
    work: Callable[[], Coroutine[Any, Any, None]], log: logging.Logger | RobotLog, failure: str
) -> None:
    logged, pause_s = "", RESTART_S
    while True:
        began = time.monotonic()
        try:
            return await work()
        except Exception as error:
            if time.monotonic() - began > RESTART_MOST_S:
                pause_s = RESTART_S
            if repr(error) != logged:
                log.error("%s; trying again until it works", failure, exc_info=error)
            logged = repr(error)
        await asyncio.sleep(pause_s)
        pause_s = min(2 * pause_s, RESTART_MOST_S)


async def end_tasks(tasks: Iterable["asyncio.Task[Any] | None"]) -> None:
    """Cancels tasks and waits until they have ended."""
    present = [task for task in tasks if task is not None]
    for task in present:
        task.cancel()
    await asyncio.gather(*present, return_exceptions=True)


class BuiltOnce(Generic[Built]):
    """A value that is built on a thread at its first use, and kept: those that wait for it share one
    building. Used on the event loop only."""

    def __init__(self, build: Callable[[], Built]) -> None:
        self._build = build
        self._building: asyncio.Task[Built] | None = None

    async def value(self) -> Built:
        """The value, or the exception of its building, which the next use tries again."""
        if self._building is None or (self._building.done() and self._building.exception()):
            self._building = asyncio.create_task(asyncio.to_thread(self._build))
        return await asyncio.shield(self._building)


class CancellableWaits:
    """Waits that end when `cancel_all` is called. Used on the event loop only."""

    __slots__ = ("_cancelled", "_timeouts")

    def __init__(self) -> None:
        self._timeouts: set[asyncio.Timeout] = set()
        self._cancelled = False

    def cancel_all(self) -> None:
        """Cancels all current waits, and every later one at its first `await`. Call it once."""
        self._cancelled = True
        for limit in self._timeouts:
            limit.reschedule(asyncio.get_running_loop().time())

    @asynccontextmanager
    async def cancellable(self) -> AsyncIterator[None]:
        """Runs the block; TimeoutError if it is cancelled while it waits."""
        limit = asyncio.timeout(0 if self._cancelled else None)
        self._timeouts.add(limit)
        try:
            async with limit:
                yield
        finally:
            self._timeouts.discard(limit)


class InFlight:
    """Commands whose response has not been sent yet. Used on the event loop only."""

    __slots__ = ("_count", "_idle")

    def __init__(self) -> None:
        self._count = 0
        self._idle = asyncio.Event()
        self._idle.set()

    @contextmanager
    def track(self) -> Iterator[None]:
        """Counts one command while the block runs."""
        self._count += 1
        self._idle.clear()
        try:
            yield
        finally:
            self._count -= 1
            if not self._count:
                self._idle.set()

    async def drained(self, within_s: float) -> None:
        """Waits until no command is in flight, at most `within_s` seconds."""
        with suppress(TimeoutError):
            async with asyncio.timeout(within_s):
                await self._idle.wait()
