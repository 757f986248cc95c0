"""The history of alarms and the standing alarms, in a SQLite database, and the thread that writes
it."""

import asyncio
import logging
import math
import sqlite3
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.cell.alarms.history import ALL, MAX_PAGE, SCHEMA, HistoryFilter, HistoryRow, history_rows
from app.panel.alarm import AlarmRules
from app.records.database import Files, as_log_error, make_way
from app.system.disk_writer import DiskWriter
from app.system.errors import LogCorrupt, LogError, LogGone
from app.system.texts import TextLike, say

# The history of alarms and those that stand, in a SQLite database. Used by one thread at a time.
#
# A commit is on the disk when `write` returns: the database has a write-ahead log, which is synced at
# each commit. A write that was torn is not in it, as SQLite checks its sums.

DAY_S: Final = 86_400.0
REMOVED_AT_ONCE: Final = 10  # a tenth of the history, if the file is too large
MIN_REMOVED: Final = 1000  # transitions that are removed at once, if they are too old
CLOCK_BACK_S: Final = 1.0  # by so much a clock that is kept right is not set back
COLUMNS: Final = HistoryRow._fields[:-1]  # without `seq`
OCCURRENCES: Final = "occurrences"  # the key of the highest number of an occurrence
ABOUT: Final = "CREATE TABLE IF NOT EXISTS about (key TEXT PRIMARY KEY, value INTEGER NOT NULL)"
NAMES: Final = ", ".join(f'"{name}"' for name in COLUMNS)
INSERT: Final = f"INSERT INTO history ({NAMES}) VALUES ({', '.join('?' * len(COLUMNS))})"
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
    """The database in a file, which is made if it is missing. sqlite3.Error if it can't be used.
    `is_new`: it had no alarms before. `occurrences` is the highest number of an occurrence ever
    written."""

    def __init__(self, path: Path, *, days: float, size_mb: float) -> None:
        self._days = days
        self._most_bytes = size_mb * 1e6
        self._db = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=5.0)
        self._db.execute("PRAGMA auto_vacuum = INCREMENTAL")
        self._db.execute("PRAGMA journal_mode = WAL")
        self._db.execute("PRAGMA synchronous = FULL")
        self.is_new = not self._has_table("standing")
        self._db.executescript(SCHEMA)
        self._db.execute(ABOUT)
        known = {column for _, column, *_ in self._db.execute("PRAGMA table_info(history)")}
        for name in ADDED.keys() - known:
            self._db.execute(f'ALTER TABLE history ADD COLUMN "{name}" {ADDED[name]}')
        newest = self._db.execute("SELECT at FROM history ORDER BY seq DESC LIMIT 1").fetchone()
        self._last_at = newest[0] if newest else -math.inf
        self.occurrences = self._read_occurrences()

    def _has_table(self, name: str) -> bool:
        tables = self._db.execute("SELECT name FROM sqlite_schema WHERE type = 'table'")
        return (name,) in tables.fetchall()

    def _read_occurrences(self) -> int:
        """Of a file of an earlier version, those of its history."""
        written = self._db.execute("SELECT value FROM about WHERE key = ?", (OCCURRENCES,)).fetchone()
        if written is None:
            written = self._db.execute("SELECT max(occurrence) FROM history").fetchone()
        return int(written[0] or 0)

    def close(self) -> None:
        self._db.close()

    def write(self, rows: Sequence[HistoryRow], standing: Mapping[str, str | None]) -> None:
        """Adds transitions, and replaces the records of alarms; None for one that no longer stands. All
        or nothing, and on the disk when it returns."""
        gone = [(alarm_id,) for alarm_id, record in standing.items() if record is None]
        kept = [(alarm_id, record) for alarm_id, record in standing.items() if record is not None]
        occurrences = max((row.occurrence for row in rows), default=0)
        self._db.execute("BEGIN IMMEDIATE")
        try:
            self._db.executemany(INSERT, [row[:-1] for row in self._with_steps(rows)])
            self._db.executemany("DELETE FROM standing WHERE id = ?", gone)
            self._db.executemany("INSERT OR REPLACE INTO standing VALUES (?, ?)", kept)
            if occurrences > self.occurrences:
                about = (OCCURRENCES, occurrences)
                self._db.execute("INSERT OR REPLACE INTO about VALUES (?, ?)", about)
            self._db.execute("COMMIT")
        except BaseException:
            self._db.execute("ROLLBACK")
            raise
        self.occurrences = max(self.occurrences, occurrences)
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


# Alarms on the disk: read at the start, and written by a thread (`DiskWriter`) that drops no change
# while the disk refuses it.

log = logging.getLogger("kiosk.alarms")

NAME: Final = "alarms.sqlite3"
MARKER: Final = "alarms.kept"  # an empty file: alarms were kept here, so that a missing one is noticed
TIDY_AFTER: Final = 5_000  # transitions; a flood is not kept until the next time
MAX_WAITING: Final = 20_000  # changes; of those beyond, the disk gets only the last of each alarm
STOP_TIMEOUT_S: Final = 5.0
TIDY_EVERY_S: Final = 600.0


class RecordChange(NamedTuple):
    """A change of an alarm by its number `seq`: the transition, None for none, and the record that
    replaces the one that stands, None if the alarm no longer stands."""

    seq: int
    id: str
    row: HistoryRow | None
    record: str | None


class DiskEvents(NamedTuple):
    """Called on the event loop: with the records that stood at the start, and the highest number of an
    occurrence before it; with the number of the last change that is on the disk; with why changes are
    not kept, "" when they are again; when a new file was begun, which has nothing yet; and with why
    alarms of before or their history were lost."""

    loaded: Callable[[Mapping[str, str], int], None]
    written: Callable[[int], None]
    fault: Callable[[TextLike], None]
    emptied: Callable[[], None]
    lost: Callable[[TextLike], None]


class AlarmDisk:
    """The file of the alarms, from `start` to `stop`."""

    def __init__(self, folder: Path, rules: AlarmRules, events: DiskEvents) -> None:
        self._folder = folder
        self._rules = rules
        self._events = events
        self._loop = asyncio.get_running_loop()
        self._writer: DiskWriter[RecordChange] = DiskWriter(
            "alarms", self, most=MAX_WAITING, keep=True, rests=True
        )
        self._is_started = False
        self._records_after: float = math.inf  # changes up to this number replace no record
        # On the thread.
        self._store: AlarmStore | None = None
        self._files: Files | None = None
        self._is_loaded = False
        self._has_fault = False
        self._is_replaced = False  # a file that is damaged or gone
        self._tidy_at = 0.0
        self._untidied = 0  # transitions that were written since

    @property
    def exists(self) -> bool:
        """Whether alarms were kept in the folder before."""
        return (self._folder / NAME).exists() or (self._folder / MARKER).exists()

    def start(self) -> None:
        """Starts the thread, which loads what stood."""
        if not self._is_started:
            self._is_started = True
            self._writer.start()

    def replace_records(self, after: int) -> None:
        """What stood is read: changes above this number replace records from now on. Before, only
        transitions are written, so that no record is lost that was not read."""
        self._records_after = after

    def put(self, change: RecordChange) -> bool:
        """Queues a change; False if too many wait already."""
        self.start()
        return self._writer.put(change)

    @property
    def waiting(self) -> int:
        """How many changes are not on the disk yet, without those that are being written."""
        return self._writer.waiting

    async def stop(self) -> None:
        """Writes what is queued; waits for `STOP_TIMEOUT_S` at most."""
        if self._is_started and not await asyncio.to_thread(self._writer.close, STOP_TIMEOUT_S):
            log.error("the disk is too slow: the last changes of alarms were not written")

    # On the thread: `DiskFile`.

    def open(self) -> None:
        with as_log_error():
            self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            existed = self.exists
            self._store = AlarmStore(
                self._folder / NAME, days=self._rules.days, size_mb=self._rules.size_mb
            )
            self._files = Files(self._folder, NAME)
            (self._folder / MARKER).touch(mode=0o600)
            if not self._is_loaded:
                standing = self._store.standing()
                self._is_loaded = True
                occurrences = self._store.occurrences
                if self._store.is_new and existed:
                    occurrences = int(time.time())  # above those that were lost
                    if not self._is_replaced:
                        self._call(self._events.lost, say("own_lost_empty"))
                self._call(self._events.loaded, standing, occurrences)

    def write(self, items: Sequence[RecordChange]) -> None:
        assert self._store is not None  # it is open
        assert self._files is not None
        with as_log_error():
            self._files.check()
            rows = [change.row for change in items if change.row is not None]
            after = self._records_after
            self._store.write(rows, {item.id: item.record for item in items if item.seq > after})
            self._untidied += len(rows)
        self._call(self._events.written, items[-1].seq)
        self._report("")

    def refuse(self, items: Sequence[RecordChange], error: LogError) -> None:
        log.error("%d changes of alarms were not written: %s", len(items), error)

    def tidy(self, quiet: bool) -> None:
        if (now := time.monotonic()) >= self._tidy_at or self._untidied >= TIDY_AFTER:
            self._tidy_at, self._untidied = now + TIDY_EVERY_S, 0
            assert self._store is not None  # it is open
            with as_log_error():
                self._store.remove_old(time.time())

    def idle_s(self) -> float:
        return TIDY_EVERY_S

    def close(self, error: LogError | None) -> None:
        if self._store is not None:
            self._store.close()
            self._store = None
        if error is None:
            return
        if isinstance(error, LogCorrupt | LogGone):
            self._begin_again(error)
        if not self._has_fault:
            log.error("alarms are not written to %s: %s", self._folder, error)
        self._report(say("alarm_not_kept", why=error.text))

    def _begin_again(self, error: LogError) -> None:
        """Makes way for a new file, in place of one that is damaged or gone."""
        with suppress(LogError):
            cause = say("own_lost_empty")
            if kept_as := make_way(self._folder, NAME, error):
                log.error("%s is damaged: it is kept as %s", self._folder / NAME, kept_as)
                cause = say("own_lost_damaged", file=kept_as)
            self._is_replaced = True
            self._call(self._events.lost, cause)
        if self._is_loaded:
            self._call(self._events.emptied)

    def _report(self, fault: TextLike) -> None:
        if self._has_fault or fault:
            if not fault:
                log.info("alarms are written to %s again", self._folder)
            self._has_fault = bool(fault)
            self._call(self._events.fault, fault)

    def _call(self, function: Callable[..., None], *arguments: Any) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(function, *arguments)
