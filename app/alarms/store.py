"""The history of alarms and those that stand, in a SQLite database. Used by one thread at a time.

A commit is on the disk when `write` returns: the database has a write-ahead log, which is synced at
each commit. A write that was torn is not in it, as SQLite checks its sums.
"""

import math
import sqlite3
from collections.abc import Mapping, Sequence
from contextlib import closing
from pathlib import Path
from typing import Final, NamedTuple

SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS history (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, at REAL NOT NULL, id TEXT NOT NULL, state TEXT NOT NULL,
    occurrence INTEGER NOT NULL, act TEXT NOT NULL, actor TEXT NOT NULL, record TEXT NOT NULL
);
CREATE INDEX IF NOT EXISTS history_at ON history (at);
CREATE TABLE IF NOT EXISTS standing (id TEXT PRIMARY KEY, record TEXT NOT NULL);
"""
DAY_S: Final = 86_400.0
REMOVED_AT_ONCE: Final = 10  # a tenth of the history, if the file is too large
MAX_PAGE: Final = 500


class HistoryRow(NamedTuple):
    """A transition: `at` in seconds since the epoch, `record` as in `app/alarms/records.py`. `seq`
    gives the order, also where the clock was set back; 0 before it is written."""

    at: float
    id: str
    state: str
    occurrence: int
    act: str
    actor: str
    record: str
    seq: int = 0


class HistoryFilter(NamedTuple):
    """Transitions before a `seq`, from `since` on and before `until` (seconds since the epoch), with a
    text in the alarm's id, text or group."""

    before: int = 2**62
    since: float = -math.inf
    until: float = math.inf
    text: str = ""


ALL: Final = HistoryFilter()


def read_history(path: Path, wanted: HistoryFilter = ALL, limit: int = MAX_PAGE) -> list[HistoryRow]:
    """The same as `AlarmStore.history` while another thread writes; nothing without a file.
    sqlite3.Error if it can't be read."""
    if not path.exists():
        return []
    with closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True, timeout=5.0)) as db:
        return _history(db, wanted, limit)


def _history(db: sqlite3.Connection, wanted: HistoryFilter, limit: int) -> list[HistoryRow]:
    pattern = wanted.text.replace("!", "!!").replace("%", "!%").replace("_", "!_")
    rows = db.execute(
        "SELECT at, id, state, occurrence, act, actor, record, seq FROM history WHERE seq < ?"
        " AND at >= ? AND at < ? AND (? = ''"
        " OR id || char(10) || coalesce(json_extract(record, '$.about'), '') LIKE ? ESCAPE '!')"
        " ORDER BY seq DESC LIMIT ?",
        (
            wanted.before,
            wanted.since,
            wanted.until,
            wanted.text,
            f"%{pattern}%",
            min(limit, MAX_PAGE),
        ),
    )
    return [HistoryRow(*row) for row in rows]


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

    def close(self) -> None:
        self._db.close()

    def write(self, rows: Sequence[HistoryRow], standing: Mapping[str, str | None]) -> None:
        """Adds transitions, and replaces the records of alarms; None for one that no longer stands. All
        or nothing, and on the disk when it returns."""
        gone = [(alarm_id,) for alarm_id, record in standing.items() if record is None]
        kept = [(alarm_id, record) for alarm_id, record in standing.items() if record is not None]
        self._db.execute("BEGIN IMMEDIATE")
        try:
            self._db.executemany(
                "INSERT INTO history (at, id, state, occurrence, act, actor, record)"
                " VALUES (?, ?, ?, ?, ?, ?, ?)",
                [row[:-1] for row in rows],
            )
            self._db.executemany("DELETE FROM standing WHERE id = ?", gone)
            self._db.executemany("INSERT OR REPLACE INTO standing VALUES (?, ?)", kept)
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise

    def standing(self) -> dict[str, str]:
        """The records of the alarms that stand, by their ids."""
        return dict(self._db.execute("SELECT id, record FROM standing"))

    def history(self, wanted: HistoryFilter = ALL, limit: int = MAX_PAGE) -> list[HistoryRow]:
        """The newest transitions of a filter first."""
        return _history(self._db, wanted, limit)

    def remove_old(self, now: float) -> int:
        """Removes transitions that are too old, or too many for the size; returns how many. Alarms that
        stand are kept. `now` is in seconds since the epoch."""
        removed = self._db.execute(
            "DELETE FROM history WHERE at < ?", (now - self._days * DAY_S,)
        ).rowcount
        while self._used_bytes() > self._most_bytes:
            oldest, newest = self._db.execute("SELECT min(seq), max(seq) FROM history").fetchone()
            if oldest is None:
                break
            upto = oldest + (newest - oldest) // REMOVED_AT_ONCE
            removed += self._db.execute("DELETE FROM history WHERE seq <= ?", (upto,)).rowcount
        if removed:
            self._db.execute("PRAGMA incremental_vacuum").fetchall()
        return removed

    def _used_bytes(self) -> int:
        pages, free, size = (
            self._db.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("page_count", "freelist_count", "page_size")
        )
        return int((pages - free) * size)
