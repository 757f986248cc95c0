"""Graceful shutdown on SIGTERM, SIGINT and SIGHUP."""

import asyncio
import faulthandler
import logging
import multiprocessing
import os
import signal
import sys
import threading
from collections.abc import Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager
from types import FrameType
from typing import Any, Final

log = logging.getLogger("kiosk")

ShutdownCallback = Callable[[], Awaitable[None]]

# After this time the process writes a traceback and exits. Longer than all waits of a shutdown together
# (robot 2 s, readers 1 s, disk 3 s, session 3 s, operator's log 10 s), shorter than the unit's
# TimeoutStopSec.
SHUTDOWN_TIMEOUT_S: Final = 20.0


@contextmanager
def graceful_shutdown(loop: asyncio.AbstractEventLoop, end: ShutdownCallback) -> Iterator[None]:
    """Awaits `end` on SIGTERM, SIGINT or SIGHUP, then calls the signal handlers that were installed
    before.

    uvicorn waits for open streams before the lifespan ends, so they must end first. It closes
    WebSockets, so they must get their responses first. SIGHUP (a closed terminal) is ignored under
    nohup. A library or disk that hangs does not keep the process alive.
    """
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    listened = {n: signal.getsignal(n) for n in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)}
    if listened[signal.SIGHUP] is not signal.SIG_DFL:
        del listened[signal.SIGHUP]
    handler = _ShutdownSequence(loop, end, listened).handle_signal
    for number in listened:
        signal.signal(number, handler)
    try:
        yield
    finally:
        for number, listener in listened.items():
            signal.signal(number, listener)


class Restart:
    """Starts this server again when it has ended in order: the service manager does, or this process
    becomes a new one of the same command line."""

    def __init__(self, has_manager: bool) -> None:
        self._has_manager = has_manager
        self.is_due = False

    def begin(self) -> None:
        """Ends the server as SIGTERM does."""
        self.is_due = True
        signal.raise_signal(signal.SIGTERM)

    def finish(self) -> None:
        """Call it when everything is closed. Does not return if this process becomes a new one."""
        if not self.is_due or self._has_manager:
            return
        if multiprocessing.parent_process() is not None:
            log.error("this server can't start again by itself: its parent process does not start it")
            return
        for stream in (sys.stdout, sys.stderr):
            stream.flush()
        os.execv(sys.executable, sys.orig_argv)


class _ShutdownSequence:
    """The sequence from the first signal to the previous handlers."""

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
        """A second SIGINT skips the waiting. A SIGTERM after a SIGINT comes from uvicorn's reloader and
        is ignored."""
        if number == signal.SIGHUP:
            signal.raise_signal(signal.SIGTERM)
        elif not self._started:
            self._started = True
            faulthandler.dump_traceback_later(
                SHUTDOWN_TIMEOUT_S, exit=True
            )  # works without a running Python thread
            asyncio.run_coroutine_threadsafe(self._shut_down(number, frame), self._loop)
        elif self._forwarded or number == signal.SIGINT:
            self._forward(number, frame)

    async def _shut_down(self, number: int, frame: FrameType | None) -> None:
        try:
            await self._end()
        except Exception:
            log.exception("shutdown failed")
        finally:
            if not self._forwarded:
                self._forward(number, frame)

    def _forward(self, number: int, frame: FrameType | None) -> None:
        self._forwarded = True
        listener = self._previous_handlers[signal.Signals(number)]
        if callable(listener):
            listener(number, frame)
