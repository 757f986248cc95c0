"""The end of the process, in its order."""

import asyncio
import faulthandler
import logging
import signal
import threading
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

log = logging.getLogger("kiosk")

ShutdownCallback = Callable[[], Awaitable[None]]

# Else something stands still: where is told, and the process leaves it. More than an end waits for (the
# robot 2 s, readers 1 s, a disk 3 s, a session 3 s, the operator's log 10 s), and less than the unit's
# TimeoutStopSec.
SHUTDOWN_TIMEOUT_S: Final = 20.0


@contextmanager
def graceful_shutdown(loop: asyncio.AbstractEventLoop, end: ShutdownCallback) -> Iterator[None]:
    """Awaits `end` as soon as the process is told to end, and then tells whoever listened for that.

    uvicorn waits for open streams before it runs the lifespan's end: they must end first. WebSockets it
    closes: they must have their answers first. A terminal that closes ends it in the same order, unless
    nohup started it. What stands still, in a library or on a disk, does not keep the process.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    listened = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    if listened[signal.SIGHUP] is not signal.SIG_DFL:
        del listened[signal.SIGHUP]
    hear = _ShutdownSequence(loop, end, listened).handle_signal
    for number in listened:
        signal.signal(number, hear)
    try:
        yield
    finally:
        for number, listener in listened.items():
            signal.signal(number, listener)


class _ShutdownSequence:
    """From the first signal to those who listened for it."""

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        end: ShutdownCallback,
        listened: Mapping[signal.Signals, Any],
    ) -> None:
        self._loop = loop
        self._end = end
        self._previous_handlers = listened
        self._started = self._forwarded = False

    def handle_signal(self, number: int, frame: FrameType | None) -> None:
        """A second SIGINT waits for nothing more. A SIGTERM after a SIGINT is of uvicorn's reloader: it
        changes nothing."""
        if number == signal.SIGHUP:
            signal.raise_signal(signal.SIGTERM)
        elif not self._started:
            self._started = True
            faulthandler.dump_traceback_later(SHUTDOWN_TIMEOUT_S, exit=True)  # no thread of Python's
            asyncio.run_coroutine_threadsafe(self._shut_down(number, frame), self._loop)
        elif self._forwarded or number == signal.SIGINT:
            self._forward(number, frame)

    async def _shut_down(self, number: int, frame: FrameType | None) -> None:
        try:
            await self._end()
        except Exception:
            log.exception("the end is not in order")
        finally:
            if not self._forwarded:
                self._forward(number, frame)

    def _forward(self, number: int, frame: FrameType | None) -> None:
        self._forwarded = True
        listener = self._previous_handlers[signal.Signals(number)]
        if callable(listener):
            listener(number, frame)
