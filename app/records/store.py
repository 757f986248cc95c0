"""The file of the operator's log: append, sync, retention. With the entries that wait for it."""

import asyncio
import os
import sqlite3
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from app.records.database import BUSY_TIMEOUT_S, NAME, Files, Head, as_log_error, open_database
from app.records.entry import FIELDS, Entry, new_entry
from app.system.errors import LogError
from app.system.texts import TextLike, number, say
from app.system.whole_file import sync_folder

# Writes the file of the operator's log: append, sync, retention. Blocks; used by one thread.
#
# `append` returns when its entries are committed to the operating system: they survive a kill of the
# process, but not a power cut. After a later `sync` they survive that too. SQLite (WAL, synchronous =
# NORMAL) keeps the file consistent in both cases.

COLUMNS: Final = ", ".join(f'"{name}"' for name in FIELDS)
INSERT: Final = f"INSERT INTO entry ({COLUMNS}) VALUES ({', '.join('?' * len(FIELDS))})"
REMOVED_AT_ONCE: Final = 1000
PROBE_BYTES: Final = 256 * 1024
DAY_MS: Final = 86_400_000
UNSET_BEFORE_MS: Final = 1_704_067_200_000  # 2024: a clock before that was never set


class Store:
    """The open file. Used only by the thread that opened it, except for `sync`."""

    def __init__(self, folder: Path, boot: str, after: Head | None = None) -> None:
        """LogError, LogCorrupt. A new file continues the chain after the entry `after` of an earlier
        one."""
        self._db = open_database(folder, after)
        self._wal = -1
        self._boot = boot
        try:
            with as_log_error():
                self._read_head()
                self._db.execute("INSERT OR REPLACE INTO about VALUES ('opened', ?)", (boot,))
                self._wal = os.open(folder / f"{NAME}-wal", os.O_RDONLY | os.O_CLOEXEC)
                sync_folder(folder)
                self._files = Files(folder)
        except BaseException:
            self.close()
            raise

    def _read_head(self) -> None:
        about = dict(self._db.execute("SELECT key, value FROM about"))
        newest = self._db.execute("SELECT seq, hash FROM entry ORDER BY seq DESC LIMIT 1").fetchone()
        oldest = self._db.execute("SELECT seq FROM entry ORDER BY seq LIMIT 1").fetchone()
        before = (int(about["first"]) - 1, str(about["genesis"]))
        self.opened_before = about.get("opened", self._boot) != self._boot  # by an earlier server
        self._seq: int
        self._hash: str
        self._seq, self._hash = newest or before
        self._oldest: int = oldest[0] if oldest else self._seq + 1

    @property
    def head(self) -> Head:
        return Head(self._seq, self._hash, self._seq - self._oldest + 1)

    def check(self) -> None:
        """LogError if the open files are no longer those in the folder."""
        with as_log_error():
            self._files.check()

    def append(self, entries: Sequence[Entry]) -> list[Entry]:
        """Writes entries in one commit, and returns them as written."""
        return self._commit(entries)

    def sync(self) -> None:
        """Syncs everything committed so far to the disk. May be called by any thread."""
        with as_log_error():
            os.fdatasync(self._wal)

    def undone(self) -> list[Entry]:
        """Presses of earlier servers without a known end."""
        with as_log_error():
            rows = self._db.execute(
                f"SELECT {COLUMNS} FROM entry WHERE boot <> ? AND seq IN (SELECT seq FROM undone)"
                " ORDER BY seq",
                (self._boot,),
            ).fetchall()
        return [Entry(*row) for row in rows]

    def entries_of_press(self, press: Entry) -> list[Entry]:
        """All entries of the press with this id on this robot, the oldest first."""
        with as_log_error():
            rows = self._db.execute(
                f"SELECT {COLUMNS} FROM entry WHERE press = ? AND press <> '' AND robot = ?"
                " AND action = 'press' ORDER BY seq",
                (press.press, press.robot),
            ).fetchall()
        return [Entry(*row) for row in rows]

    def has_outcome(self, seq: int) -> bool:
        """Whether a press without a known end has an outcome so far."""
        with as_log_error():
            row = self._db.execute("SELECT outcome FROM undone WHERE seq = ?", (seq,)).fetchone()
        return bool(row and row[0])

    def last_start(self) -> str:
        """The values of the entry of the last start, as JSON; "{}" without one."""
        query = """SELECT "values" FROM entry WHERE kind = 'began' AND seq =
            (SELECT value FROM about WHERE key = 'start')"""
        with as_log_error():
            row = self._db.execute(query).fetchone()
        return str(row[0]) if row else "{}"

    def mark_start(self, seq: int) -> None:
        """Notes the number of the entry of this start."""
        with as_log_error():
            self._db.execute("INSERT OR REPLACE INTO about VALUES ('start', ?)", (seq,))

    def remove_old(self, days: float, size_mb: float, now_ms: int) -> bool:
        """Removes some of the oldest entries if they are too old or too many; returns whether it did.

        An entry `removed` says which and why. It has the hash of the last removed entry, so that the
        rest can be verified.
        """
        with as_log_error():
            if last := self._last_older(now_ms - days * DAY_MS):
                return self._remove(last, "days", say("log_removed_days", days=number(f"{days:g}")))
            if last := self._last_beyond(size_mb * 1_000_000):
                return self._remove(last, "size", say("log_removed_size", size=number(f"{size_mb:g}")))
        return False

    def _last_older(self, limit_ms: float) -> int:
        """The number of the last entry before the first one that is recent enough; 0 for none.

        An entry from before the machine's clock was set is removed with the next one that has a valid
        time.
        """
        last = 0
        for seq, at in self._db.execute(
            "SELECT seq, at FROM entry ORDER BY seq LIMIT ?", (REMOVED_AT_ONCE,)
        ):
            if at >= limit_ms:
                break
            if at >= UNSET_BEFORE_MS:
                last = seq
        return last

    def _last_beyond(self, allowed: float) -> int:
        if self.used_bytes() <= allowed:
            return 0
        return self._oldest - 1 + min(REMOVED_AT_ONCE, self.head.count)

    def used_bytes(self) -> int:
        """The size of the file without its free pages."""
        pages, free, size = (
            self._db.execute(f"PRAGMA {name}").fetchone()[0]
            for name in ("page_count", "freelist_count", "page_size")
        )
        return int(pages - free) * int(size)

    def _remove(self, last: int, why: Literal["days", "size"], reason: TextLike) -> bool:
        first, (anchor,) = (
            self._oldest,
            self._db.execute("SELECT hash FROM entry WHERE seq = ?", (last,)).fetchone(),
        )
        values = {"first": first, "last": last, "hash": anchor, "why": why}
        entry = new_entry("removed", values=values, reason=reason)
        self._commit([entry], removed=last)
        self._db.execute("PRAGMA incremental_vacuum(200)").fetchall()
        return True

    def _commit(self, entries: Sequence[Entry], removed: int = 0) -> list[Entry]:
        seq, last, sealed = self._seq, self._hash, []
        for entry in entries:
            seq += 1
            sealed.append(entry.sealed(seq, self._boot, last))
            last = sealed[-1].hash
        with as_log_error():
            self._db.execute("BEGIN IMMEDIATE")
            try:
                self._db.executemany(INSERT, sealed)
                self._update_undone(sealed)
                if removed:
                    self._db.execute("DELETE FROM entry WHERE seq <= ?", (removed,))
                    self._db.execute("DELETE FROM undone WHERE seq <= ?", (removed,))
                self._db.execute("COMMIT")
            except BaseException:
                if self._db.in_transaction:
                    self._db.execute("ROLLBACK")
                raise
        self._seq, self._hash = seq, last
        self._oldest = max(self._oldest, removed + 1)
        return sealed

    def _update_undone(self, sealed: Sequence[Entry]) -> None:
        for entry in sealed:
            if entry.kind == "pressed":
                self._db.execute("INSERT INTO undone VALUES (?, '')", (entry.seq,))
            elif entry.of and entry.outcome == "accepted" and entry.action == "press":
                self._db.execute(
                    "INSERT OR REPLACE INTO undone VALUES (?, ?)", (entry.of, entry.outcome)
                )
            elif entry.of:
                self._db.execute("DELETE FROM undone WHERE seq = ?", (entry.of,))

    def probe(self) -> None:
        """Checks that the disk is writable and has room: writes, syncs and removes some data."""
        with as_log_error():
            self._db.execute(
                "INSERT OR REPLACE INTO about VALUES ('probe', zeroblob(?))", (PROBE_BYTES,)
            )
            self.sync()
            self._db.execute("DELETE FROM about WHERE key = 'probe'")

    def wal_bytes(self) -> int:
        with as_log_error():
            return os.fstat(self._wal).st_size

    def checkpoint(self) -> None:
        """Moves the write-ahead log into the file and truncates it, with a sync.

        Pages that a reader still needs stay for the next time. The first commit after a checkpoint
        waits for the disk, so it is made here.
        """
        with as_log_error():
            self._db.execute("PRAGMA busy_timeout = 0")
            try:
                self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()
            finally:
                self._db.execute(f"PRAGMA busy_timeout = {int(BUSY_TIMEOUT_S * 1000)}")
            self._db.execute("UPDATE about SET value = ? WHERE key = 'opened'", (self._boot,))

    def complete(self) -> None:
        """Moves the write-ahead log into the file, even if the file is no longer in the folder."""
        with as_log_error():
            self._db.execute("PRAGMA wal_checkpoint(TRUNCATE)").fetchall()

    def close(self) -> None:
        """Closes the file, in any state."""
        if self._wal >= 0:
            os.close(self._wal)
            self._wal = -1
        try:
            self._db.close()
        except sqlite3.Error as error:
            raise LogError(str(error)) from error


# Entries waiting to be written to the operator's log, and the log's limits.


@dataclass(frozen=True, slots=True, kw_only=True)
class Limits:
    """How long entries are kept, how large the file may be, and whether presses need it."""

    days: float = 365.0
    size_mb: float = 512.0
    required: bool = True


class Repeated(Exception):
    """The log already has a press with this id: `press` is its entry, `last_entry` the newest entry
    about it, None without one."""

    def __init__(self, press: Entry, last_entry: Entry | None) -> None:
        super().__init__(f"press {press.press} is entry {press.seq}")
        self.press = press
        self.last_entry = last_entry


@dataclass(slots=True, eq=False)
class Ticket:
    """An entry to be written; `result` is the entry as written, or the reason why it was not.

    A press has its result when it is committed, any other entry when it is on the disk. `waiter` is
    done then, or at a timeout. `answered`: the writer has reported its result.
    """

    entry: Entry
    waiter: "asyncio.Future[None]"
    result: Entry | LogError | Repeated | None = None
    abandoned: bool = False
    answered: bool = False

    def wake(self) -> None:
        """Ends the waiting for this entry."""
        if not self.waiter.done():
            self.waiter.set_result(None)

    @property
    def durable(self) -> bool:
        return self.entry.kind != "pressed"


Results = list[tuple[Ticket, Entry | LogError | Repeated]]
