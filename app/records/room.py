"""Whether the operator's log has room for the days that it is to keep: from its measured rate."""

import sqlite3
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from app.records.database import NAME, as_log_error, open_read_only
from app.records.store import DAY_MS

MB: Final = 1_000_000
MEASURED_DAYS: Final = 7.0  # the last ones
LEAST_DAYS: Final = 1.0  # from a shorter time nothing is concluded
WARNED_AT: Final = 0.8  # of the room

FreeBytes = Callable[[Path], int]


@dataclass(frozen=True, slots=True)
class LogRoom:
    """`entries_per_day` is measured over the last `measured_days`, `entry_bytes` over the whole file.
    `days` are those that the log is to keep, `room_mb` what it may take: `size_mb` of the panel file,
    or what the disk has left for it, if that is less."""

    entries_per_day: float
    measured_days: float
    entry_bytes: float
    days: float
    room_mb: float

    @property
    def needed_mb(self) -> float:
        """For all the days, at this rate."""
        return self.entries_per_day * self.days * self.entry_bytes / MB

    @property
    def share(self) -> float:
        """Of the room that is needed."""
        return self.needed_mb / self.room_mb if self.room_mb else float("inf")

    @property
    def days_kept(self) -> float:
        """How many days the room holds, at this rate."""
        rate_mb = self.entries_per_day * self.entry_bytes / MB
        return self.room_mb / rate_mb if rate_mb else float("inf")

    @property
    def is_short(self) -> bool:
        return self.share > WARNED_AT


def log_room(
    folder: Path, days: float, size_mb: float, free: FreeBytes, now_ms: int | None = None
) -> LogRoom | None:
    """Of the log in this folder; None without one, and before it has a day of entries. LogError if it
    can't be read. Blocks."""
    if not (folder / NAME).exists():
        return None
    db = open_read_only(folder)
    try:
        with as_log_error():
            first, last = db.execute("SELECT min(seq), max(seq) FROM entry").fetchone()
            if first is None:
                return None
            now = int(time.time() * 1000) if now_ms is None else now_ms
            since = max(_at(db, first), now - int(MEASURED_DAYS * DAY_MS))
            measured = (now - since) / DAY_MS
            if measured < LEAST_DAYS:
                return None
            rate = (last - _first_since(db, first, last, since) + 1) / measured
            (size,) = db.execute(
                "SELECT (page_count - freelist_count) * page_size FROM"
                " pragma_page_count, pragma_freelist_count, pragma_page_size"
            ).fetchone()
    finally:
        db.close()
    room = min(size_mb, (size + free(folder)) / MB)
    return LogRoom(rate, measured, size / (last - first + 1), days, room)


def _at(db: sqlite3.Connection, seq: int) -> int:
    """When the entry with this number was written, or the next one that is there."""
    row = db.execute("SELECT at FROM entry WHERE seq >= ? ORDER BY seq LIMIT 1", (seq,)).fetchone()
    return int(row[0])


def _first_since(db: sqlite3.Connection, first: int, last: int, since: int) -> int:
    """The first entry of that time, by halves: numbers and times rise together, but for a clock that
    was set back, which makes little of a difference."""
    while first < last:
        middle = (first + last) // 2
        if _at(db, middle) < since:
            first = middle + 1
        else:
            last = middle
    return first
