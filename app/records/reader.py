"""Reads and exports the operator's log beside the event loop: on threads, and in a separate process."""

import asyncio
import zlib
from collections.abc import AsyncIterator, Callable, Collection, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, asynccontextmanager, contextmanager
from functools import partial
from pathlib import Path
from typing import Any, Final, TypeVar

from app.records import entry
from app.records.database import Filter, LogRow, OpenPress, open_presses, rows
from app.records.entry import Entry
from app.system.csv_text import ROWS_AT_ONCE, Cell, csv_chunks, text_cell, time_cell
from app.system.errors import LogError, SearchTooLong, TooMany
from app.system.texts import ENGLISH, TextLike, say
from app.system.worker import RunningWorker, Worker, Workers

# What a process does for the server (`app.system.worker`).

GZIP: Final = zlib.MAX_WBITS | 16  # zlib's parameter for the gzip format
TEXTS: Final = entry.FIELDS.index("address")  # the first text field of an entry
# `text`, which is for programs, comes last.
LATER: Final = tuple(name for name in entry.FIELDS[TEXTS:] if name != "text")
FIELDS: Final = (*entry.FIELDS[:TEXTS], "pressed_at", *LATER, "text")


def search(
    folder: Path, wanted: Filter, before: int | None, count: int
) -> Iterator[list[tuple[tuple[Any, ...], int | None]]]:
    """One list of the newest `count` entries that match; LogError."""
    yield [(tuple(row.entry), row.pressed_at) for row in rows(folder, wanted, before, count)]


def export(
    folder: Path, wanted: Filter, before: int | None, gzip: bool = False, language: str = ENGLISH
) -> Iterator[bytes]:
    """All entries that match before the entry number `before` as CSV, the newest first, with reasons in
    a language; LogError."""

    def read(last: LogRow | None) -> list[LogRow]:
        return rows(folder, wanted, last.entry.seq if last else before, ROWS_AT_ONCE)

    pieces = csv_chunks(FIELDS, read, partial(_cells, language))
    return gzipped(pieces) if gzip else pieces


def gzipped(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The chunks compressed by gzip."""
    packer = zlib.compressobj(wbits=GZIP)
    for piece in pieces:
        if packed := packer.compress(piece):
            yield packed
    yield packer.flush()


def _cells(language: str, row: LogRow) -> tuple[Cell, ...]:
    entry = row.entry
    times = (
        entry.seq,
        time_cell(entry.at),
        entry.boot,
        entry.monotonic,
        entry.kind,
        entry.of,
        time_cell(row.pressed_at),
    )
    shown = entry._replace(reason=entry.reason_in(language))
    return (*times, *(text_cell(getattr(shown, name)) for name in LATER), text_cell(entry.text))


# Reads the operator's log beside the event loop: few readers at a time, and slow reads in another
# process, so that they take no time from presses and holds.

MAX_SEARCHES: Final = 2  # at a time
THREADS: Final = MAX_SEARCHES + 1  # one for the server's own reads
QUICK_S: Final = 0.03  # a search that takes longer is repeated in another process
SEARCH_AGAIN_S: Final = 2
EXPORT_AGAIN_S: Final = 10

Read = TypeVar("Read")


class _Slots:
    """A semaphore that rejects instead of waiting, with a message and when to try again."""

    def __init__(self, most: int, retry_after_s: int, message: TextLike) -> None:
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


class ReaderSlots:
    """The searches and exports of one history: two searches at a time, one export, and the processes in
    which they run. Used on the event loop only."""

    def __init__(self, searches_busy: TextLike, exports_busy: TextLike) -> None:
        """The messages of those that are rejected."""
        self.searching: Final = _Slots(MAX_SEARCHES, SEARCH_AGAIN_S, searches_busy).slot
        self._exporting = _Slots(1, EXPORT_AGAIN_S, exports_busy).slot
        self._workers = Workers(_unreadable)

    @asynccontextmanager
    async def process(self, worker: Worker) -> AsyncIterator[RunningWorker]:
        """Reads within the block; LogError at shutdown."""
        if self._workers.closed:
            raise LogError(say("server_shutting_down"))
        async with self._workers.run(worker) as running:
            yield running

    @asynccontextmanager
    async def export(self, worker: Worker) -> AsyncIterator[RunningWorker]:
        """The same for an export; TooMany if another one runs."""
        with self._exporting():
            async with self.process(worker) as running:
                yield running

    def close(self) -> None:
        """Ends all processes at shutdown."""
        self._workers.close()


def _unreadable(why: TextLike) -> LogError:
    return LogError(say("log_unreadable", why=why or say("log_reader_ended")))


class Readers:
    """The readers of one log. Used on the event loop only."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._threads = ThreadPoolExecutor(THREADS, "operators-log-reader")
        self._slots = ReaderSlots(say("log_search_busy"), say("log_export_running"))

    async def rows(self, wanted: Filter, before: int | None, count: int) -> list[LogRow]:
        """The newest `count` entries that match, before the entry number `before`; LogError if they
        can't be read, TooMany if too many searches run."""
        with self._slots.searching():
            try:
                return await self._read(partial(rows, self._folder, wanted, before, count, QUICK_S))
            except SearchTooLong:
                slow = Worker("app.records.reader:search", self._folder, wanted, before, count)
                async with self._slots.process(slow) as process:
                    (matching,) = await process.all_results()
                return [LogRow(Entry(*entry), pressed_at) for entry, pressed_at in matching]

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        """See `database.open_presses`."""
        return await self._read(partial(open_presses, self._folder, robot, widgets, since))

    def export(
        self, wanted: Filter, before: int | None, gzip: bool, language: str = ENGLISH
    ) -> AbstractAsyncContextManager[RunningWorker]:
        """All entries that match before the entry number `before`, as CSV in a language; TooMany if
        another export runs, LogError at shutdown."""
        arguments = (self._folder, wanted, before, gzip, language)
        return self._slots.export(Worker("app.records.reader:export", *arguments))

    def close(self) -> None:
        """Ends searches and exports at shutdown."""
        self._slots.close()

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
