"""Keeps the cells of a wall: takes what has arrived once a second, and wakes the pages."""

import asyncio
import logging
import time
from collections.abc import Sequence
from contextlib import suppress
from typing import Final

from app.cell.site.cells import CellTable
from app.cell.site.summary import MAX_BYTES
from app.ros.zenoh.config import Config
from app.ros.zenoh.site import SummaryReader
from app.system.concurrency import keep_running
from app.system.texts import TextLike, say

log = logging.getLogger("kiosk.wall")

LOOK_EVERY_S: Final = 1.0
ASK_EVERY_S: Final = 2.0  # for what cells have said before


class Wall:
    """From `start` to `stop`. Used on the event loop only; `ticks` counts the seconds."""

    def __init__(self, config: Config, sites: Sequence[str]) -> None:
        self.sites = tuple(sites)
        self.table = CellTable()
        self.closed = False
        self.ticks = 0
        self.is_connected = False
        self._reader = SummaryReader(config, MAX_BYTES, sites)
        self._asked_at = 0.0
        self._changed = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def state(self) -> TextLike:
        """Of the link to the routers, as text."""
        return say("ready") if self.is_connected else say("wall_no_router")

    def start(self) -> None:
        self._tasks = [
            keep_running(self._run, log, "reading the cells failed"),
            asyncio.create_task(self._reader.open()),
        ]

    def close(self) -> None:
        """Ends the streams of pages."""
        self.closed = True
        self._wake()

    async def stop(self) -> None:
        self.close()
        for task in self._tasks:
            task.cancel()
        for task in self._tasks:
            with suppress(asyncio.CancelledError):
                await task
        await self._reader.close()

    async def _run(self) -> None:
        while True:
            await self.look(time.monotonic(), time.time())
            await asyncio.sleep(LOOK_EVERY_S)

    async def look(self, now: float, wall: float) -> None:
        """Takes what has arrived since the last call, in slices."""
        was_connected, self.is_connected = self.is_connected, self._reader.is_connected
        if was_connected and not self.is_connected:
            self.table.lose_all(now, wall)
        for _ in self.table.apply(self._reader.take(), now, wall):
            await asyncio.sleep(0)
        self.table.advance(now, wall)
        waiting = self.table.waiting
        if waiting and now - self._asked_at >= ASK_EVERY_S:
            self._asked_at = now
            self._reader.ask(waiting if len(waiting) < 10 else ())
        self.ticks += 1
        self._wake()

    def _wake(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()

    async def next_tick(self) -> None:
        """Returns after the next look, or when the wall is closed."""
        if not self.closed:
            await self._changed.wait()
