"""The history of alarms and those that stand, in a SQLite database. Used by one thread at a time.

A commit is on the disk when `write` returns: the database has a write-ahead log, which is synced at
each commit. A write that was torn is not in it, as SQLite checks its sums.
"""

import math
import sqlite3
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from app.alarms.history import ALL, MAX_PAGE, SCHEMA, HistoryFilter, HistoryRow, history_rows

DAY_S: Final = 86_400.0
REMOVED_AT_ONCE: Final = 10  # a tenth of the history, if the file is too large
MIN_REMOVED: Final = 1000  # transitions that are removed at once, if they are too old
CLOCK_BACK_S: Final = 1.0  # by so much a clock that is kept right is not set back
WRITTEN: Final = HistoryRow._fields[:-1]  # without `seq`
NAMES: Final = ", ".join(f'"{name}"' for name in WRITTEN)
INSERT: Final = f"INSERT INTO history ({NAMES}) VALUES ({', '.join('?' * len(WRITTEN))})"
# Columns that a file of an earlier version lacks.
ADDED: Final[Mapping[str, str]] = {
    "event": "TEXT NOT NULL DEFAULT ''",
    "priority": "INTEGER NOT NULL DEFAULT 0",
    "robot": "TEXT NOT NULL DEFAULT ''",
    "group": "TEXT NOT NULL DEFAULT ''",
    "lasted_s": "REAL",
    "clock_back_s": "REAL NOT NULL DEFAULT 0",
}


class AlarmStore:
    """The database in a file, which is made if it is missing. sqlite3.Error if it can't be used."""

    def __init__(self, path: Path, *, days: float, size_mb: float) -> None:
        self._days = days
        self._most_bytes = size_mb * 1e6
        self._db = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=5.0)
        self._db.execute("PRAGMA auto_vacuum = INCREMENTAL")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        self._db.executescript(SCHEMA)
        known = {column for _, column, *_ in self._db.execute("PRAGMA table_info(history)")}
        for name in ADDED.keys() - known:
            self._db.execute(f'ALTER TABLE history ADD COLUMN "{name}" {ADDED[name]}')
        newest = self._db.execute("SELECT at FROM history ORDER BY seq DESC LIMIT 1").fetchone()
        self._last_at = newest[0] if newest else -math.inf

    def close(self) -> None:
        self._db.close()

    def write(self, rows: Sequence[HistoryRow], standing: Mapping[str, str | None]) -> None:
        """Adds transitions, and replaces the records of alarms; None for one that no longer stands. All
        or nothing, and on the disk when it returns."""
        gone = [(alarm_id,) for alarm_id, record in standing.items() if record is None]
        kept = [(alarm_id, record) for alarm_id, record in standing.items() if record is not None]
        self._db.execute("BEGIN IMMEDIATE")
        try:
            self._db.executemany(INSERT, [row[:-1] for row in self._with_steps(rows)])
            self._db.executemany("DELETE FROM standing WHERE id = ?", gone)
            self._db.executemany("INSERT OR REPLACE INTO standing VALUES (?, ?)", kept)
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        if rows:
            self._last_at = rows[-1].at

    def _with_steps(self, rows: Sequence[HistoryRow]) -> Iterator[HistoryRow]:
        """The rows with how far the clock was set back before each."""
        last = self._last_at
        for row in rows:
            back = last - row.at
            yield row._replace(clock_back_s=back if back >= CLOCK_BACK_S else 0.0)
            last = row.at

    def standing(self) -> dict[str, str]:
        """The records of the alarms that stand, by their ids."""
        return dict(self._db.execute("SELECT id, record FROM standing"))

    def history(self, wanted: HistoryFilter = ALL, limit: int = MAX_PAGE) -> list[HistoryRow]:
        """The newest transitions of a filter first."""
        return history_rows(self._db, wanted, limit)

    def remove_old(self, now: float) -> int:
        """Removes the first transitions if they are too old, or too many for the size; returns how
        many. Alarms that stand are kept. `now` is in seconds since the epoch: as it may be wrong, not
        all that seem too old go at once."""
        removed = self._remove_to(self._last_older(now - self._days * DAY_S))
        while self._used_bytes() > self._most_bytes:
            oldest, newest = self._db.execute("SELECT min(seq), max(seq) FROM history").fetchone()
            if oldest is None:
                break
            removed += self._remove_to(oldest + (newest - oldest) // REMOVED_AT_ONCE)
        if removed:
            self._db.execute("PRAGMA incremental_vacuum").fetchall()
        return removed

    def _last_older(self, limit: float) -> int:
        """The number of the last transition before the first that is recent enough; 0 for none."""
        first = self._db.execute("SELECT min(seq) FROM history").fetchone()[0] or 0
        most = max(MIN_REMOVED, (self._newest() - first) // REMOVED_AT_ONCE)
        last = 0
        for seq, at in self._db.execute("SELECT seq, at FROM history ORDER BY seq LIMIT ?", (most,)):
            if at >= limit:
                break
            last = seq
        return last

    def _newest(self) -> int:
        return int(self._db.execute("SELECT max(seq) FROM history").fetchone()[0] or 0)

    def _remove_to(self, seq: int) -> int:
        return self._db.execute("DELETE FROM history WHERE seq <= ?", (seq,)).rowcount

    def _used_bytes(self) -> int:
        pages, free, size = (
            self._db.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("page_count", "freelist_count", "page_size")
        )
        return int((pages - free) * size)
