"""Reads and exports the operator's log beside the event loop: on threads, and in a separate process."""

import asyncio
import csv
import io
import json
import os
import signal
import subprocess
import sys
import zlib
from collections.abc import AsyncIterator, Callable, Collection, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import asynccontextmanager, contextmanager, suppress
from dataclasses import asdict, dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import BinaryIO, Final, NoReturn, Protocol, TypeVar

from app.records import entry
from app.records.database import Filter, LogRow, OpenPress, open_presses, rows
from app.records.entry import Entry
from app.system.errors import LogError, SearchTooLong, TooMany, os_error_text
from app.system.printable import printable
from app.system.settings import PACKAGE
from app.system.texts import ENGLISH, TextLike, say

# Reads the operator's log in another process, chunk by chunk.

PIECE_BYTES: Final = 65_536  # the capacity of a pipe
COMMAND: Final = (sys.executable, "-P", "-c", "from app.records.reader import run; run()")


class ReaderRequest(Protocol):
    """What the process reads, as JSON on its stdin."""

    def as_json(self) -> bytes: ...


Done = TypeVar("Done")


class ReaderProcess:
    """Runs `app.records.reader`, or another command, in a process. Used on the event loop; a
    thread waits for the process."""

    def __init__(self, request: ReaderRequest, command: Sequence[str] = ()) -> None:
        self._request = request
        self._command = command
        self._loop = asyncio.get_running_loop()
        self._thread = ThreadPoolExecutor(1, "operators-log-process")
        self._process: subprocess.Popen[bytes] | None = None
        self._killed = False

    async def start(self) -> bytes:
        """Starts the process; returns the first chunk. LogError if the log can't be read."""
        return await self._on_thread(self._start_process)

    async def read_next(self) -> bytes:
        """The next chunk, b"" after the last; LogError if the process fails."""
        return await self._on_thread(self._read_piece)

    async def read_all(self) -> bytes:
        """The whole output, for short ones; LogError."""
        pieces = [await self.start()]
        while pieces[-1]:
            pieces.append(await self.read_next())
        return b"".join(pieces)

    def kill(self) -> None:
        """Kills the process: the client that reads gets an error."""
        self._killed = True
        if self._process is not None:
            self._process.kill()

    async def close(self) -> None:
        """Ends the process and the thread."""
        self.kill()
        await asyncio.shield(self._on_thread(self._close))
        self._thread.shutdown(wait=False)

    def _on_thread(self, work: Callable[[], Done]) -> "asyncio.Future[Done]":
        return self._loop.run_in_executor(self._thread, work)

    def _start_process(self) -> bytes:
        try:
            self._process = process = _popen(self._command or COMMAND)
        except OSError as error:  # such as memory or open files that are used up
            raise LogError(say("log_unreadable", why=os_error_text(error))) from error
        if self._killed:
            process.kill()
        assert process.stdin is not None
        try:
            process.stdin.write(self._request.as_json())
            process.stdin.close()
        except BrokenPipeError:
            pass  # the process has ended; `_read_piece` raises the reason
        return self._read_piece()

    def _read_piece(self) -> bytes:
        process = self._process
        assert process is not None
        assert process.stdout is not None
        assert process.stderr is not None
        if piece := process.stdout.read(PIECE_BYTES):
            return piece
        if process.wait():
            output = process.stderr.read(PIECE_BYTES).decode(errors="replace").strip()
            why = output.splitlines()[-1] if output else say("log_reader_ended")
            raise LogError(say("log_unreadable", why=why))
        return b""

    def _close(self) -> None:
        if self._process is not None:
            with self._process:
                self._process.kill()


def _popen(command: Sequence[str]) -> "subprocess.Popen[bytes]":
    path = os.pathsep.join(filter(None, (str(PACKAGE.parent), os.environ.get("PYTHONPATH"))))
    return subprocess.Popen(
        command,
        bufsize=0,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONPATH": path},
        start_new_session=True,  # signals of the server's terminal do not reach it
    )


# The operator's log as CSV: RFC 4180 with a byte order mark, the newest entry first.
#
# Reads some rows at a time and keeps nothing open in between: a slow reader does not block the writer.

ROWS_AT_ONCE: Final = 500
GZIP: Final = zlib.MAX_WBITS | 16  # zlib's parameter for the gzip format
TEXTS: Final = entry.FIELDS.index("address")  # the first text field of an entry
# `text`, which is for programs, comes last.
LATER: Final = tuple(name for name in entry.FIELDS[TEXTS:] if name != "text")
FIELDS: Final = (*entry.FIELDS[:TEXTS], "pressed_at", *LATER, "text")
# What a spreadsheet would take as a formula.
FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")


def csv_chunks(
    folder: Path, wanted: Filter, before: int | None, language: str = ENGLISH
) -> Iterator[bytes]:
    """All entries that match before the entry number `before`, with reasons in a language; LogError."""
    cells = partial(_cells, language)
    batch = rows(folder, wanted, before, ROWS_AT_ONCE)
    yield "\ufeff".encode() + csv_lines([FIELDS, *map(cells, batch)])
    while len(batch) == ROWS_AT_ONCE:
        batch = rows(folder, wanted, batch[-1].entry.seq, ROWS_AT_ONCE)
        yield csv_lines(map(cells, batch))


def gzipped(pieces: Iterable[bytes]) -> Iterator[bytes]:
    """The chunks compressed by gzip."""
    packer = zlib.compressobj(wbits=GZIP)
    for piece in pieces:
        yield packer.compress(piece)
    yield packer.flush()


def _cells(language: str, row: LogRow) -> tuple[str | int | None, ...]:
    entry = row.entry
    times = (
        entry.seq,
        cell_time(entry.at),
        entry.boot,
        entry.monotonic,
        entry.kind,
        entry.of,
        cell_time(row.pressed_at),
    )
    shown = entry._replace(reason=entry.reason_in(language))
    return (*times, *(cell_text(getattr(shown, name)) for name in LATER), cell_text(entry.text))


def cell_time(ms: int | None) -> str | None:
    """A time in ms since 1970 as ISO 8601 in UTC."""
    if ms is None:
        return None
    return datetime.fromtimestamp(ms / 1000, UTC).isoformat(timespec="milliseconds")


def cell_text(text: str) -> str:
    """A text that no spreadsheet takes as a formula, with escapes for what must not be shown."""
    shown = text if text.isprintable() else printable(text)
    return f"'{shown}" if shown.startswith(FORMULA) else shown


def csv_lines(cells: Iterable[tuple[str | float | None, ...]]) -> bytes:
    """Rows of cells as CSV."""
    text = io.StringIO()
    csv.writer(text).writerows(cells)
    return text.getvalue().encode()


# The process that reads the operator's log for the server: `run`.
#
# A thread would take interpreter and processor time from presses and holds. The request arrives as JSON
# on stdin (`ReadRequest`); stdout gets CSV or, for a request with a count, JSON. Exit status: 0 if
# complete, 1 after an error, which is on stderr.

NICE_INCREMENT: Final = 10  # lower priority than the server


@dataclass(frozen=True, slots=True)
class ReadRequest:
    """A request for entries before the entry number `before`, the newest first: at most `count`, or
    with None all of them as CSV."""

    folder: Path
    wanted: Filter
    before: int | None
    count: int | None = None
    gzip: bool = False
    language: str = ENGLISH  # of the reasons in CSV

    def as_json(self) -> bytes:
        return json.dumps(asdict(self) | {"folder": str(self.folder)}).encode()


def parse_request(text: bytes) -> ReadRequest:
    fields = json.loads(text)
    folder, wanted = Path(fields.pop("folder")), Filter(**fields.pop("wanted"))
    return ReadRequest(folder, wanted, **fields)


def parse_rows(text: bytes) -> list[LogRow]:
    """The rows in a JSON response."""
    return [LogRow(Entry(*entry), pressed_at) for entry, pressed_at in json.loads(text)]


def read(request: ReadRequest) -> Iterator[bytes]:
    """The response, in chunks; LogError."""
    if request.count is not None:
        matching = rows(request.folder, request.wanted, request.before, request.count)
        yield json.dumps([(row.entry, row.pressed_at) for row in matching]).encode()
        return
    pieces = csv_chunks(request.folder, request.wanted, request.before, request.language)
    yield from gzipped(pieces) if request.gzip else pieces


def main(source: BinaryIO, out: BinaryIO) -> int:
    return write(read(parse_request(source.read())), out)


def write(pieces: Iterable[bytes], out: BinaryIO) -> int:
    """Writes the response; returns the exit status."""
    with suppress(OSError):  # the unit's filter of system calls may forbid it
        os.nice(NICE_INCREMENT)
    try:
        for piece in pieces:
            out.write(piece)
            out.flush()
    except LogError as error:
        print(error, file=sys.stderr)
        return 1
    return 0


def run() -> NoReturn:
    """The entry point of the process."""
    run_main(main)


def run_main(main: Callable[[BinaryIO, BinaryIO], int]) -> NoReturn:
    """Runs `main` on stdin and stdout."""
    signal.signal(signal.SIGPIPE, signal.SIG_DFL)  # ends the process when the server stops reading
    sys.exit(main(sys.stdin.buffer, sys.stdout.buffer))


# Reads the operator's log beside the event loop: few readers at a time, and slow reads in another
# process, so that they take no time from presses and holds.

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

    async def rows(self, wanted: Filter, before: int | None, count: int) -> list[LogRow]:
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
        """See `database.open_presses`."""
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
