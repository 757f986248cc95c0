"""Reads the operator's log beside the event loop: few readers at a time, and slow reads in another
process, so that they take no time from presses and holds."""

import asyncio
from collections.abc import AsyncIterator, Callable, Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

from app.audit.queries import Filter, OpenPress, Row, open_presses, rows
from app.audit.reader_main import ReadRequest, parse_rows
from app.audit.reader_process import ReaderProcess
from app.errors import LogError, SearchTooLong, TooMany
from app.i18n import ENGLISH, TextLike, say

MAX_SEARCHES: Final = 2  # at a time
THREADS: Final = MAX_SEARCHES + 1  # one for the server's own reads
QUICK_S: Final = 0.03  # a search that takes longer is repeated in another process
SEARCH_AGAIN_S: Final = 2
EXPORT_AGAIN_S: Final = 10

Read = TypeVar("Read")


class ReaderSlots:
    """A semaphore that rejects instead of waiting. Used on the event loop only."""

    def __init__(self, most: int, retry_after_s: int, message: TextLike) -> None:
        """`message` and `retry_after_s` are for a client that is rejected."""
        self._free = most
        self._retry_after_s = retry_after_s
        self._message = message

    @contextmanager
    def slot(self) -> Iterator[None]:
        """Takes a slot within the block; TooMany if none is free."""
        if not self._free:
            raise TooMany(self._message, self._retry_after_s)
        self._free -= 1
        try:
            yield
        finally:
            self._free += 1


class Readers:
    """The readers of one log. Used on the event loop only."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._threads = ThreadPoolExecutor(THREADS, "operators-log-reader")
        self._searching = ReaderSlots(MAX_SEARCHES, SEARCH_AGAIN_S, say("log_search_busy"))
        self._exporting = ReaderSlots(1, EXPORT_AGAIN_S, say("log_export_running"))
        self._processes: set[ReaderProcess] = set()
        self._closed = False

    async def rows(self, wanted: Filter, before: int | None, count: int) -> list[Row]:
        """The newest `count` entries that match, before the entry number `before`; LogError if they
        can't be read, TooMany if too many searches run."""
        with self._searching.slot():
            try:
                return await self._read(partial(rows, self._folder, wanted, before, count, QUICK_S))
            except SearchTooLong:
                async with self._reader_process(
                    ReadRequest(self._folder, wanted, before, count)
                ) as process:
                    return parse_rows(await process.read_all())

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        """See `queries.open_presses`."""
        return await self._read(partial(open_presses, self._folder, robot, widgets, since))

    @asynccontextmanager
    async def export(
        self, wanted: Filter, before: int | None, gzip: bool, language: str = ENGLISH
    ) -> AsyncIterator[ReaderProcess]:
        """All entries that match before the entry number `before`, as CSV in a language; TooMany if
        another export runs, LogError at shutdown."""
        request = ReadRequest(self._folder, wanted, before, gzip=gzip, language=language)
        with self._exporting.slot():
            async with self._reader_process(request) as process:
                yield process

    def close(self) -> None:
        """Ends searches and exports at shutdown."""
        self._closed = True
        for process in self._processes:
            process.kill()

    def stop(self) -> None:
        """Ends the threads."""
        self._threads.shutdown(wait=False, cancel_futures=True)

    async def _read(self, read: Callable[[], Read]) -> Read:
        try:
            return await asyncio.get_running_loop().run_in_executor(self._threads, read)
        except SearchTooLong:
            raise
        except LogError as error:
            raise LogError(say("log_unreadable", why=error.text)) from error

    @asynccontextmanager
    async def _reader_process(self, request: ReadRequest) -> AsyncIterator[ReaderProcess]:
        if self._closed:
            raise LogError(say("server_shutting_down"))
        process = ReaderProcess(request)
        self._processes.add(process)
        try:
            yield process
        finally:
            self._processes.discard(process)
            await process.close()
