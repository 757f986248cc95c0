"""The SQLite file of the trends' histories: a row for each bucket. Used on one thread.

A transaction is in the file whole or not at all, also when the process is killed or the power fails
while it is written.
"""

import logging
import math
import sqlite3
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path
from typing import Final

from app.audit.database import Files
from app.robot.history import Bucket

log = logging.getLogger("kiosk.trends")

NAME: Final = "trends.sqlite3"
SUFFIXES: Final = ("", "-wal", "-shm")
VERSION: Final = 1
BUSY_TIMEOUT_S: Final = 1.0
WAL_BYTES: Final = 4_000_000
FUTURE_S: Final = 31 * 86_400.0  # a clock that was set back by more has written no rows that help
UNUSED_S: Final = 31 * 86_400.0  # what no trend of the panel shows any more is kept for so long

SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS field (
  number INTEGER PRIMARY KEY, robot TEXT NOT NULL, topic TEXT NOT NULL, type TEXT NOT NULL,
  field TEXT NOT NULL, UNIQUE (robot, topic, type, field)
) STRICT;
CREATE TABLE IF NOT EXISTS bucket (
  field INTEGER NOT NULL, width INTEGER NOT NULL, at REAL NOT NULL, low REAL NOT NULL,
  high REAL NOT NULL, last REAL NOT NULL, gap INTEGER NOT NULL, PRIMARY KEY (field, width, at)
) STRICT, WITHOUT ROWID;
"""
ADD_FIELD: Final = "INSERT OR IGNORE INTO field (robot, topic, type, field) VALUES (?, ?, ?, ?)"
FIND_FIELD: Final = "SELECT number FROM field WHERE robot = ? AND topic = ? AND type = ? AND field = ?"

FieldName = tuple[str, str, str, str]  # robot's id, topic, type, field
Rows = Mapping[FieldName, Mapping[int, Iterable[Bucket]]]  # of each width in seconds


class TrendFile:
    """The open file. Each method may raise sqlite3.Error or OSError, `write` also LogGone or LogCorrupt
    if the file was removed, replaced or emptied."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.path = folder / NAME
        self._db = self._open()
        self._files = Files(folder, NAME)
        self._numbers: dict[FieldName, int] = {}

    def _open(self) -> sqlite3.Connection:
        db = sqlite3.connect(self.path, timeout=BUSY_TIMEOUT_S, isolation_level=None)
        try:
            db.execute("PRAGMA journal_mode = WAL")
            db.execute("PRAGMA synchronous = NORMAL")
            db.execute(f"PRAGMA journal_size_limit = {WAL_BYTES}")
            if db.execute("PRAGMA user_version").fetchone()[0] > VERSION:
                raise sqlite3.OperationalError("the file is of a newer version of this program")
            db.executescript(SCHEMA)
            db.execute(f"PRAGMA user_version = {VERSION}")  # also makes the journal's files
        except BaseException:
            db.close()
            raise
        return db

    def close(self) -> None:
        self._db.close()

    def buckets(self, name: FieldName, width: int, since: float) -> Iterator[Bucket]:
        """The buckets of a field in order, from a time on; those that can't be drawn are left out."""
        rows = self._db.execute(
            "SELECT at, low, high, last, gap FROM bucket WHERE field = ? AND width = ? AND at >= ? "
            "ORDER BY at",
            (self._number(name), width, since),
        )
        for at, low, high, last, gap in rows:
            if all(map(math.isfinite, (at, low, high, last))):
                yield Bucket(at, low, high, last, bool(gap))

    def write(self, rows: Rows, keep_s: Mapping[tuple[FieldName, int], float], now: float) -> None:
        """Writes buckets, in place of those with the same time, and removes the oldest: `keep_s` is by
        field and width."""
        self._files.check()
        self._db.execute("BEGIN IMMEDIATE")
        try:
            for name, levels in rows.items():
                number = self._number(name)
                for width, buckets in levels.items():
                    self._db.executemany(
                        "INSERT OR REPLACE INTO bucket VALUES (?, ?, ?, ?, ?, ?, ?)",
                        ((number, width, *bucket) for bucket in buckets),
                    )
            for (name, width), seconds in keep_s.items():
                where = (self._number(name), width, now - seconds)
                self._db.execute("DELETE FROM bucket WHERE field = ? AND width = ? AND at < ?", where)
            self._db.execute("COMMIT")
        except BaseException:
            self._numbers.clear()
            if self._db.in_transaction:
                self._db.execute("ROLLBACK")
            raise

    def remove_future(self, name: FieldName, width: int, now: float) -> int:
        """Removes the buckets of a field that are far in the future: nothing could follow them. Returns
        how many there were."""
        where = (self._number(name), width, now + FUTURE_S)
        delete = "DELETE FROM bucket WHERE field = ? AND width = ? AND at > ?"
        return self._db.execute(delete, where).rowcount

    def remove_unused(self, names: Iterable[FieldName], now: float) -> None:
        """Removes old buckets of fields that the panel no longer names."""
        used = {self._number(name) for name in names}
        for (number,) in self._db.execute("SELECT number FROM field").fetchall():
            if number not in used:
                where = (number, now - UNUSED_S)
                self._db.execute("DELETE FROM bucket WHERE field = ? AND at < ?", where)

    def _number(self, name: FieldName) -> int:
        if name not in self._numbers:
            self._db.execute(ADD_FIELD, name)
            self._numbers[name] = int(self._db.execute(FIND_FIELD, name).fetchone()[0])
        return self._numbers[name]
