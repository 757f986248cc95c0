"""The forwarder's own file: how far each stream is sent, and the rows that no store of the cell has,
a minute of each trend and the panel's health.

A minute is made from the finest values that the trends' file has of it, when it is over; values that
the disk took late are counted as long as no later minute of the field was made.
"""

import math
import os
import sqlite3
import time
from collections.abc import Iterable, Iterator, Mapping
from contextlib import closing, suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.records.database import as_log_error

SPOOL_FILE: Final = "forward.sqlite3"
TRENDS_FILE: Final = "trends.sqlite3"
VERSION: Final = 1
MINUTE_S: Final = 60
SETTLED_S: Final = 20.0  # after a minute, its values are in the trends' file
WIDTHS: Final = (1, 10, 60)  # seconds of the buckets that a minute is made of, the finest first
BACK_S: Final = 7 * 86_400.0  # so far back minutes are made of what the file has
AT_ONCE: Final = 2_000  # minutes of one field in one transaction
DAY_MS: Final = 86_400_000
BUSY_TIMEOUT_S: Final = 5.0

TREND_COLUMNS: Final = ("pen", "low", "high", "mean", "last", "count")
HEALTH_COLUMNS: Final[Mapping[str, str]] = {
    "version": "text",
    "up_s": "float8",
    "cpu_s": "float8",
    "memory_bytes": "bigint",
    "disk_free_bytes": "bigint",
    "data_bytes": "bigint",
    "unsent": "bigint",
    "lag_s": "float8",
    "clock_ahead_s": "float8",
    "log_generation": "integer",
    "log_seq": "bigint",
}
SCHEMA: Final = f"""
CREATE TABLE IF NOT EXISTS cursor (
  stream TEXT PRIMARY KEY, generation INTEGER NOT NULL, seq INTEGER NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS pen (
  number INTEGER PRIMARY KEY, robot TEXT NOT NULL, topic TEXT NOT NULL, type TEXT NOT NULL,
  field TEXT NOT NULL, made_to INTEGER NOT NULL DEFAULT 0, UNIQUE (robot, topic, type, field)
) STRICT;
CREATE TABLE IF NOT EXISTS trend (
  seq INTEGER PRIMARY KEY AUTOINCREMENT, at INTEGER NOT NULL, pen INTEGER NOT NULL, low REAL NOT NULL,
  high REAL NOT NULL, mean REAL NOT NULL, last REAL NOT NULL, count INTEGER NOT NULL
) STRICT;
CREATE TABLE IF NOT EXISTS health (
  seq INTEGER PRIMARY KEY AUTOINCREMENT, at INTEGER NOT NULL, {", ".join(HEALTH_COLUMNS)}
);
"""


class Cursor(NamedTuple):
    """The last row of a stream that the centre has."""

    generation: int = 0
    seq: int = 0


class Pen(NamedTuple):
    """A field whose minutes are sent."""

    number: int
    robot: str
    topic: str
    type: str
    field: str


class Minute(NamedTuple):
    """The values of a minute from `at` (seconds since 1970) on: `mean` is of the last value of each
    bucket, `samples` how many there were."""

    at: int
    low: float
    high: float
    mean: float
    last: float
    samples: int


def minutes(buckets: Iterable[tuple[float, int, float, float, float]]) -> Iterator[Minute]:
    """The minutes of buckets (at, width, lowest, highest, last), in the order of `at`. Of each minute
    those of the smallest width count."""
    by_minute: dict[int, dict[int, list[tuple[float, float, float]]]] = {}
    for at, width, low, high, last in buckets:
        if all(map(math.isfinite, (at, low, high, last))):
            minute = math.floor(at / MINUTE_S) * MINUTE_S
            by_minute.setdefault(minute, {}).setdefault(width, []).append((low, high, last))
    for minute, widths in sorted(by_minute.items()):
        values = widths[min(widths)]
        lasts = [last for _, _, last in values]
        yield Minute(
            minute,
            min(low for low, _, _ in values),
            max(high for _, high, _ in values),
            math.fsum(lasts) / len(lasts),
            lasts[-1],
            len(lasts),
        )


class Spool:
    """The open file. Each method may raise LogError."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.path = folder / SPOOL_FILE
        with as_log_error():
            os.close(os.open(self.path, os.O_RDWR | os.O_CREAT, 0o600))
            self._db = sqlite3.connect(self.path, timeout=BUSY_TIMEOUT_S, isolation_level=None)
            try:
                self._db.execute("PRAGMA auto_vacuum = INCREMENTAL")
                self._db.execute("PRAGMA journal_mode = WAL")
                self._db.execute("PRAGMA synchronous = NORMAL")
                if self._db.execute("PRAGMA user_version").fetchone()[0] > VERSION:
                    raise sqlite3.OperationalError("the file is of a newer version of this program")
                self._db.executescript(SCHEMA)
                self._db.execute(f"PRAGMA user_version = {VERSION}")
            except BaseException:
                self._db.close()
                raise

    def close(self) -> None:
        with as_log_error():
            self._db.close()

    def cursor(self, stream: str) -> Cursor | None:
        """How far a stream is sent; None if nothing was sent yet."""
        with as_log_error():
            query = "SELECT generation, seq FROM cursor WHERE stream = ?"
            row = self._db.execute(query, (stream,)).fetchone()
        return Cursor(*row) if row else None

    def move(self, stream: str, cursor: Cursor) -> None:
        """Keeps how far a stream is sent."""
        with as_log_error():
            self._db.execute("INSERT OR REPLACE INTO cursor VALUES (?, ?, ?)", (stream, *cursor))

    def pens(self, numbers: Iterable[int]) -> list[Pen]:
        """The fields with these numbers."""
        with as_log_error():
            rows = self._db.execute("SELECT number, robot, topic, type, field FROM pen").fetchall()
        chosen = set(numbers)
        return [Pen(*row) for row in rows if row[0] in chosen]

    def add_health(self, at: float, values: Mapping[str, Any]) -> None:
        """Adds how the panel is at a time (seconds since 1970)."""
        marks = ", ".join("?" * (len(HEALTH_COLUMNS) + 1))
        names = ", ".join(HEALTH_COLUMNS)
        row = (round(at * 1000), *(values[name] for name in HEALTH_COLUMNS))
        with as_log_error():
            self._db.execute(f"INSERT INTO health (at, {names}) VALUES ({marks})", row)

    def make_minutes(self, now: float) -> int:
        """Makes the minutes that are over at `now`; returns how many rows."""
        path = self._folder / TRENDS_FILE
        if not path.exists():
            return 0
        made = 0
        with as_log_error():
            uri = f"{path.absolute().as_uri()}?mode=ro"
            with closing(sqlite3.connect(uri, uri=True, timeout=1.0, isolation_level=None)) as trends:
                tables = trends.execute(
                    "SELECT name FROM sqlite_schema WHERE type = 'table'"
                ).fetchall()
                if not {("field",), ("bucket",)} <= set(tables):
                    return 0
                for number, *name in trends.execute(
                    "SELECT number, robot, topic, type, field FROM field"
                ):
                    made += self._make_minutes_of(trends, number, name, now)
        return made

    def _make_minutes_of(
        self, trends: sqlite3.Connection, number: int, name: list[str], now: float
    ) -> int:
        pen, made_to = self._pen(name)
        end = math.floor((now - SETTLED_S) / MINUTE_S) * MINUTE_S
        if made_to > end:  # the clock was set back: minutes that it shows again are made again
            made_to = end - MINUTE_S
        recorded = [
            trends.execute(
                "SELECT min(at) FROM bucket WHERE field = ? AND width = ? AND at >= ?",
                (number, width, max(made_to, end - BACK_S)),
            ).fetchone()[0]
            for width in WIDTHS
        ]
        first = min((at for at in recorded if at is not None), default=math.inf)
        if first >= end:
            return 0
        since = math.floor(first / MINUTE_S) * MINUTE_S
        marks = ", ".join("?" * len(WIDTHS))
        buckets = trends.execute(
            "SELECT at, width, low, high, last FROM bucket WHERE field = ? AND at >= ? AND at < ?"
            f" AND width IN ({marks}) ORDER BY at",
            (number, since, min(end, since + AT_ONCE * MINUTE_S), *WIDTHS),
        )
        rows = list(minutes(buckets))
        newest = rows[-1].at + MINUTE_S if rows else since + MINUTE_S
        self._db.execute("BEGIN IMMEDIATE")
        try:
            self._db.executemany(
                f"INSERT INTO trend (at, {', '.join(TREND_COLUMNS)}) VALUES (?, ?, ?, ?, ?, ?, ?)",
                [(row.at * 1000, pen, *row[1:]) for row in rows],
            )
            self._db.execute("UPDATE pen SET made_to = ? WHERE number = ?", (newest, pen))
            self._db.execute("COMMIT")
        except BaseException:
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            raise
        return len(rows)

    def _pen(self, name: list[str]) -> tuple[int, int]:
        where = "robot = ? AND topic = ? AND type = ? AND field = ?"
        query = f"SELECT number, made_to FROM pen WHERE {where}"
        row = self._db.execute(query, name).fetchone()
        if row is None:
            columns = "robot, topic, type, field"
            self._db.execute(f"INSERT INTO pen ({columns}) VALUES (?, ?, ?, ?)", name)
            row = self._db.execute(query, name).fetchone()
        return row[0], row[1]

    def remove_old(self, keep_days: float, keep_mb: float, now: float) -> int:
        """Removes rows that are older than so many days, and the oldest beyond the size, sent or not;
        returns how many. Sent rows are kept as long: the centre may be restored from a copy."""
        removed = 0
        with as_log_error():
            limit = now * 1000 - keep_days * DAY_MS
            for table in ("trend", "health"):
                query = f"SELECT min(seq) FROM {table} WHERE at >= ?"
                (kept,) = self._db.execute(query, (limit,)).fetchone()
                if kept is not None:
                    removed += self._db.execute(f"DELETE FROM {table} WHERE seq < ?", (kept,)).rowcount
            while self._used_bytes() > keep_mb * 1e6:
                oldest, newest = self._db.execute("SELECT min(seq), max(seq) FROM trend").fetchone()
                if oldest is None or newest - oldest < 10:
                    break
                upto = oldest + (newest - oldest) // 10
                removed += self._db.execute("DELETE FROM trend WHERE seq <= ?", (upto,)).rowcount
            if removed:
                self._db.execute("PRAGMA incremental_vacuum").fetchall()
        return removed

    def _used_bytes(self) -> int:
        pages, free, size = (
            self._db.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("page_count", "freelist_count", "page_size")
        )
        return int((pages - free) * size)


def folder_bytes(folder: Path) -> int:
    """The bytes of the files of a data folder, without those of its folders."""
    with as_log_error():
        return sum(entry.stat().st_size for entry in os.scandir(folder) if entry.is_file())


def uptime_s(pid: int) -> float:
    """For how many seconds a process has run; 0 for one that has ended."""
    try:
        with open(f"/proc/{pid}/stat", "rb") as file:
            started = int(file.read().rpartition(b")")[2].split()[19])
    except (OSError, ValueError, IndexError):
        return 0.0
    return max(0.0, time.clock_gettime(time.CLOCK_BOOTTIME) - started / os.sysconf("SC_CLK_TCK"))


def process_use(pid: int) -> tuple[float, int]:
    """CPU seconds and resident bytes of a process; zeros for one that has ended."""
    with suppress(OSError, ValueError, IndexError), open(f"/proc/{pid}/stat", "rb") as file:
        values = file.read().rpartition(b")")[2].split()
        ticks = int(values[11]) + int(values[12])
        return ticks / os.sysconf("SC_CLK_TCK"), int(values[21]) * os.sysconf("SC_PAGE_SIZE")
    return 0.0, 0
