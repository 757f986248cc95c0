"""Reads the history of alarms beside the event loop: few searches at a time, and one export in another
process."""

import asyncio
import sys
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Final, TypeVar

from app.alarms.export_main import ExportRequest
from app.alarms.history import HistoryFilter
from app.audit import ReaderProcess
from app.audit.readers import EXPORT_AGAIN_S, MAX_SEARCHES, SEARCH_AGAIN_S, ReaderSlots
from app.errors import LogError
from app.i18n import say

EXPORT: Final = (sys.executable, "-P", "-c", "from app.alarms.export_main import run; run()")

Read = TypeVar("Read")


class HistoryReader:
    """The history in a file, or an empty one. Used on the event loop only."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._searching = ReaderSlots(MAX_SEARCHES, SEARCH_AGAIN_S, say("alarms_history_busy"))
        self._exporting = ReaderSlots(1, EXPORT_AGAIN_S, say("alarms_history_exporting"))
        self._processes: set[ReaderProcess] = set()
        self._closed = False

    async def read(self, read: Callable[[Path | None], Read]) -> Read:
        """What a function of `app/alarms/` reads from the file, on another thread; LogError if it can't
        be read, TooMany if too many searches run."""
        with self._searching.slot():
            return await asyncio.to_thread(read, self._path)

    @asynccontextmanager
    async def export(
        self, wanted: HistoryFilter, gzip: bool, language: str
    ) -> AsyncIterator[ReaderProcess]:
        """The transitions of a filter as CSV in a language; TooMany if another export runs, LogError at
        shutdown."""
        with self._exporting.slot():
            if self._closed:
                raise LogError(say("server_shutting_down"))
            process = ReaderProcess(ExportRequest(self._path, wanted, gzip, language), EXPORT)
            self._processes.add(process)
            try:
                yield process
            finally:
                self._processes.discard(process)
                await process.close()

    def close(self) -> None:
        """Ends exports at shutdown."""
        self._closed = True
        for process in self._processes:
            process.kill()
