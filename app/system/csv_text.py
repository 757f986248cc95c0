"""Tables as CSV: RFC 4180 with a byte order mark, which spreadsheets need to read it as UTF-8."""

import csv
import io
from collections.abc import Callable, Iterable, Iterator, Sequence
from datetime import UTC, datetime
from typing import Final, TypeVar

from app.system.printable import printable

BOM: Final = "\ufeff"
# The beginnings of what a spreadsheet takes for a formula.
FORMULA: Final = ("=", "+", "-", "@", "\t", "\r")
QUOTED: Final = (*FORMULA, "'")
ROWS_AT_ONCE: Final = 500

Cell = str | float | None
Row = TypeVar("Row")


def time_cell(ms: int | None) -> str | None:
    """A time in ms since 1970 as ISO 8601 in UTC."""
    if ms is None:
        return None
    return datetime.fromtimestamp(ms / 1000, UTC).isoformat(timespec="milliseconds")


def text_cell(text: str) -> str:
    """A text that no spreadsheet takes for a formula, with escapes for what must not be shown."""
    shown = text if text.isprintable() else printable(text)
    return f"'{shown}" if shown.startswith(FORMULA) else shown


def quoted_cell(text: str) -> str:
    """The same for a table that is read again: `text_in_cell` is the inverse."""
    return f"'{text}" if text.startswith(QUOTED) else text


def text_in_cell(cell: str) -> str:
    """The text that `quoted_cell` made a cell of."""
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(QUOTED) else cell


def csv_text(header: Iterable[str], rows: Iterable[Iterable[Cell]]) -> str:
    """A whole table."""
    return BOM + _lines([header, *rows])


def csv_chunks(
    header: Iterable[str],
    read: Callable[[Row | None], Sequence[Row]],
    cells: Callable[[Row], Iterable[Cell]],
) -> Iterator[bytes]:
    """A table in chunks. `read` returns at most ROWS_AT_ONCE rows, those after the last one that it
    returned: nothing stays open in between, so a slow reader blocks no writer."""
    rows = read(None)
    yield csv_text(header, map(cells, rows)).encode()
    while len(rows) == ROWS_AT_ONCE:
        rows = read(rows[-1])
        yield _lines(map(cells, rows)).encode()


def _lines(rows: Iterable[Iterable[Cell]]) -> str:
    text = io.StringIO(newline="")
    csv.writer(text).writerows(rows)
    return text.getvalue()
