"""The details of trends that someone at the plant asked this cell for: which, and their values.

A request is a row at the centre (`detail_request`) that the forwarder reads when nothing else is to be
sent. Its values go in batches, each in one transaction, with the key (panel, generation, pen, time,
width): a request that is interrupted begins again, and the centre leaves the values that it has.
"""

import math
import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final, NamedTuple

from app.cell.forward.spool import MINUTE_S, SETTLED_S, TRENDS_FILE, WIDTHS, Pen
from app.records.database import as_log_error

MOST_VALUES: Final = 320_000  # of one request: all that a cell has of twenty pens
BUSY_TIMEOUT_S: Final = 1.0
FINER: Final = tuple(width for width in WIDTHS if width < MINUTE_S)
NO_PEN: Final = "this panel sends no such pen"
NOTHING_KEPT: Final = "the cell has no values of this time any more"
TOO_MANY: Final = "the cell has {count} values of this time, at most {most} are sent: ask for less"


class Request(NamedTuple):
    """An open request: pens as topic, or as topic and field ("/speed data"), none for all of them, and
    the time span in seconds since 1970."""

    id: int
    pens: tuple[str, ...]
    since: float
    until: float
    asked_by: str

    def is_due(self, now: float) -> bool:
        """Whether the values of its time span are on the disk."""
        return self.until + SETTLED_S <= now

    def asks_for(self, pen: Pen) -> bool:
        """Whether this pen is one of those that are asked for."""
        return not self.pens or pen.topic in self.pens or f"{pen.topic} {pen.field}" in self.pens


class KnownPen(NamedTuple):
    """A pen as the centre knows it: its rows have this generation, and the pen's number."""

    generation: int
    pen: Pen


class Detail(NamedTuple):
    """The values of `width` seconds from `at` (seconds since 1970) on."""

    at: float
    width: int
    low: float
    high: float
    last: float


class Answer:
    """A request on its way. Each method may raise LogError."""

    def __init__(self, folder: Path, request: Request, pens: Iterable[KnownPen]) -> None:
        """`refusal` is why nothing is sent, "" if something is."""
        self.request = request
        self.sent = 0
        self._folder = folder
        self._left = [known for known in pens if request.asks_for(known.pen)]
        self._after = -math.inf
        self._widths: set[int] = set()
        self.refusal = "" if self._left else NO_PEN
        count = sum(self._count(known.pen) for known in self._left)
        if self._left and not count:
            self.refusal = NOTHING_KEPT
        elif count > MOST_VALUES:
            self.refusal = TOO_MANY.format(count=count, most=MOST_VALUES)

    @property
    def note(self) -> str:
        """Which values were sent."""
        widths = " and ".join(f"{width} s" for width in sorted(self._widths))
        return f"a value each {widths}"

    def batch(self, most: int) -> tuple[KnownPen, Sequence[Detail]] | None:
        """The next values of one pen; None at the end."""
        while self._left:
            known = self._left[0]
            details = self._read(known.pen, most)
            if details:
                return known, details
            self._next_pen()
        if not self.sent:  # all were removed since they were counted
            self.refusal = self.refusal or NOTHING_KEPT
        return None

    def done(self, details: Sequence[Detail]) -> None:
        """The centre has these."""
        self.sent += len(details)
        self._after = details[-1].at
        self._widths |= {detail.width for detail in details}

    def _next_pen(self) -> None:
        del self._left[0]
        self._after = -math.inf

    def _read(self, pen: Pen, most: int) -> list[Detail]:
        query = f"SELECT at, width, low, high, last {self._where(pen)} AND at > ? ORDER BY at LIMIT ?"
        rows = self._rows(query, pen, self._after, most)
        return [Detail(at, int(width), *values) for at, width, *values in rows]

    def _count(self, pen: Pen) -> int:
        return sum(int(count) for (count,) in self._rows(f"SELECT count(*) {self._where(pen)}", pen))

    def _where(self, pen: Pen) -> str:
        """Of each minute, the values of the smallest width."""
        widths = ", ".join(map(str, FINER))
        return (
            "FROM bucket AS b WHERE field = (SELECT number FROM field WHERE robot = ? AND topic = ?"
            f" AND type = ? AND field = ?) AND width IN ({widths}) AND at >= ? AND at < ?"
            " AND abs(low) < 1e300 AND abs(high) < 1e300 AND abs(last) < 1e300 AND NOT EXISTS"
            f" (SELECT 1 FROM bucket AS finer WHERE finer.field = b.field AND finer.width < b.width"
            f" AND finer.width IN ({widths})"
            f" AND finer.at >= CAST(b.at / {MINUTE_S} AS INTEGER) * {MINUTE_S}"
            f" AND finer.at < (CAST(b.at / {MINUTE_S} AS INTEGER) + 1) * {MINUTE_S})"
        )

    def _rows(self, query: str, pen: Pen, *more: float) -> list[tuple[float, ...]]:
        path = self._folder / TRENDS_FILE
        if not path.exists():
            return []
        span = (self.request.since, self.request.until)
        with as_log_error():
            uri = f"{path.absolute().as_uri()}?mode=ro"
            with closing(
                sqlite3.connect(uri, uri=True, timeout=BUSY_TIMEOUT_S, isolation_level=None)
            ) as db:
                return db.execute(query, (*pen[1:], *span, *more)).fetchall()
