"""The history of alarms as CSV: RFC 4180 with a byte order mark, the newest transition first.

Reads some rows at a time and keeps nothing open in between, as the export of the operator's log.
"""

import json
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Final

from app.alarms.history import HistoryFilter, HistoryRow, read_history
from app.alarms.records import text_of
from app.audit.export import ROWS_AT_ONCE, cell_text, cell_time, csv_lines
from app.i18n import render

FIELDS: Final = (
    "seq", "at", "clock_back_s", "id", "robot", "group", "priority", "event", "state", "occurrence",
    "lasted_s", "who", "text", "value", "unit", "limit", "action", "reason",
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
    )


def _reason(record: dict[str, dict[str, str] | None]) -> str:
    """Why it is shelved or out of service; "" where it is not."""
    taken = record.get("out_of_service") or record.get("shelf") or {}
    return taken.get("reason", "")
