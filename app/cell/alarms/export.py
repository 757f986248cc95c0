"""Reads and exports the history of alarms beside the event loop: on a thread, and in a separate
process."""

import asyncio
import json
from collections.abc import Callable, Iterator
from contextlib import AbstractAsyncContextManager
from functools import partial
from pathlib import Path
from typing import Final, TypeVar

from app.cell.alarms.history import HistoryFilter, HistoryRow, read_history
from app.cell.alarms.records import text_of, written_value
from app.records.reader import ReaderSlots, gzipped
from app.system.csv_text import ROWS_AT_ONCE, Cell, csv_chunks, text_cell, time_cell
from app.system.texts import render, say
from app.system.worker import RunningWorker, Worker

Read = TypeVar("Read")

FIELDS: Final = (
    "seq", "at", "clock_back_s", "id", "robot", "group", "priority", "event", "state", "occurrence",
    "lasted_s", "who", "text", "value", "unit", "limit", "action", "reason", "value_text",
)  # fmt: skip


def export(path: Path | None, wanted: HistoryFilter, gzip: bool, language: str) -> Iterator[bytes]:
    """All transitions of a filter as CSV, the newest first, with texts in a language; LogError. `path`
    is the file, None for no history."""

    def read(last: HistoryRow | None) -> list[HistoryRow]:
        rest = wanted._replace(before=last.seq) if last else wanted
        return read_history(path, rest, ROWS_AT_ONCE)

    pieces = csv_chunks(FIELDS, read, partial(_cells, language))
    return gzipped(pieces) if gzip else pieces


def _cells(language: str, row: HistoryRow) -> tuple[Cell, ...]:
    record = json.loads(row.record)
    about = record.get("about", {})

    def text(name: str) -> str:
        return text_cell(render(text_of(about.get(name, "")), language))

    return (
        row.seq,
        time_cell(round(row.at * 1000)),
        row.clock_back_s or None,
        text_cell(row.id),
        row.robot,
        text("group"),
        row.priority,
        row.event,
        row.state,
        row.occurrence,
        None if row.lasted_s is None else round(row.lasted_s, 3),
        text_cell(row.actor),
        text("text"),
        record.get("value"),
        text("unit"),
        record.get("limit"),
        text("action"),
        text_cell(_reason(record)),
        text_cell(render(written_value(record), language)),
    )


def _reason(record: dict[str, dict[str, str] | None]) -> str:
    """Why it is shelved or out of service; "" where it is not."""
    taken = record.get("out_of_service") or record.get("shelf") or {}
    return taken.get("reason", "")


class HistoryReader:
    """The history in a file, or an empty one: few searches at a time, and one export in another
    process. Used on the event loop only."""

    def __init__(self, path: Path | None) -> None:
        self._path = path
        self._slots = ReaderSlots(say("alarms_history_busy"), say("alarms_history_exporting"))

    async def read(self, read: Callable[[Path | None], Read]) -> Read:
        """What a function of `app/cell/alarms/` reads from the file, on another thread; LogError if it
        can't be read, TooMany if too many searches run."""
        with self._slots.searching():
            return await asyncio.to_thread(read, self._path)

    def export(
        self, wanted: HistoryFilter, gzip: bool, language: str
    ) -> AbstractAsyncContextManager[RunningWorker]:
        """The transitions of a filter as CSV in a language; TooMany if another export runs, LogError at
        shutdown."""
        work = Worker("app.cell.alarms.export:export", self._path, wanted, gzip, language)
        return self._slots.export(work)

    def close(self) -> None:
        """Ends exports at shutdown."""
        self._slots.close()
