"""Reads and exports the history of alarms beside the event loop: on a thread, and in a separate
process."""

import asyncio
import json
import sys
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import BinaryIO, Final, NoReturn, TypeVar

from app.cell.alarms.history import HistoryFilter, HistoryRow, read_history
from app.cell.alarms.records import text_of, written_value
from app.records import ReaderProcess
from app.records.reader import (
    EXPORT_AGAIN_S,
    MAX_SEARCHES,
    ROWS_AT_ONCE,
    SEARCH_AGAIN_S,
    ReaderSlots,
    cell_text,
    cell_time,
    csv_lines,
    gzipped,
    run_main,
    write,
)
from app.system.errors import LogError
from app.system.texts import render, say

# The history of alarms as CSV: RFC 4180 with a byte order mark, the newest transition first.
#
# Reads some rows at a time and keeps nothing open in between, as the export of the operator's log.

FIELDS: Final = (
    "seq", "at", "clock_back_s", "id", "robot", "group", "priority", "event", "state", "occurrence",
    "lasted_s", "who", "text", "value", "unit", "limit", "action", "reason", "value_text",
)  # fmt: skip


def csv_chunks(path: Path | None, wanted: HistoryFilter, language: str) -> Iterator[bytes]:
    """All transitions of a filter, with texts in a language; LogError."""
    cells = partial(_cells, language)
    batch = read_history(path, wanted, ROWS_AT_ONCE)
    yield "\ufeff".encode() + csv_lines([FIELDS, *map(cells, batch)])
    while len(batch) == ROWS_AT_ONCE:
        batch = read_history(path, wanted._replace(before=batch[-1].seq), ROWS_AT_ONCE)
        yield csv_lines(map(cells, batch))


def _cells(language: str, row: HistoryRow) -> tuple[str | float | None, ...]:
    record = json.loads(row.record)
    about = record.get("about", {})

    def text(name: str) -> str:
        return cell_text(render(text_of(about.get(name, "")), language))

    return (
        row.seq,
        cell_time(round(row.at * 1000)),
        row.clock_back_s or None,
        cell_text(row.id),
        row.robot,
        text("group"),
        row.priority,
        row.event,
        row.state,
        row.occurrence,
        None if row.lasted_s is None else round(row.lasted_s, 3),
        cell_text(row.actor),
        text("text"),
        record.get("value"),
        text("unit"),
        record.get("limit"),
        text("action"),
        cell_text(_reason(record)),
        cell_text(render(written_value(record), language)),
    )


def _reason(record: dict[str, dict[str, str] | None]) -> str:
    """Why it is shelved or out of service; "" where it is not."""
    taken = record.get("out_of_service") or record.get("shelf") or {}
    return taken.get("reason", "")


# The process that exports the history of alarms for the server: `run`.
#
# As `app/records/reader.py`: the request arrives as JSON on stdin (`ExportRequest`), stdout gets CSV.


@dataclass(frozen=True, slots=True)
class ExportRequest:
    """`path` is the file, None for no history; `language` is that of its texts."""

    path: Path | None
    wanted: HistoryFilter
    gzip: bool
    language: str

    def as_json(self) -> bytes:
        path = str(self.path) if self.path else None
        return json.dumps([path, list(self.wanted), self.gzip, self.language]).encode()


def parse_request(text: bytes) -> ExportRequest:
    path, wanted, gzip, language = json.loads(text)
    return ExportRequest(Path(path) if path else None, HistoryFilter(*wanted), gzip, language)


def export(request: ExportRequest) -> Iterator[bytes]:
    """The CSV in chunks; LogError."""
    pieces = csv_chunks(request.path, request.wanted, request.language)
    return gzipped(pieces) if request.gzip else pieces


def main(source: BinaryIO, out: BinaryIO) -> int:
    return write(export(parse_request(source.read())), out)


def run() -> NoReturn:
    """The entry point of the process."""
    run_main(main)


# Reads the history of alarms beside the event loop: few searches at a time, and one export in another
# process.

EXPORT: Final = (sys.executable, "-P", "-c", "from app.cell.alarms.export import run; run()")

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
        """What a function of `app/cell/alarms/` reads from the file, on another thread; LogError if it
        can't be read, TooMany if too many searches run."""
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
