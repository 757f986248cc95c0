"""The operator's log as CSV: RFC 4180 with a byte order mark, the newest entry first.

Reads some rows at a time and keeps nothing open in between: a slow reader does not block the writer.
"""

import csv
import io
import zlib
from collections.abc import Iterable, Iterator
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Final

from app.audit import entry
from app.audit.queries import Filter, Row, rows
from app.i18n import ENGLISH
from app.printable import printable

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


def _cells(language: str, row: Row) -> tuple[str | int | None, ...]:
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
