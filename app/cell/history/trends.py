"""The history of trends: recorded from samples, and kept on the disk."""

import asyncio
import logging
import math
import sqlite3
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Any, Final, NamedTuple, TypeVar

from app.cell.robot.history import Bucket, FieldHistory, History, Level
from app.cell.robot.state import RobotState
from app.cell.robot.topics import Slices
from app.panel.model import Panel
from app.panel.widgets.trend import RAW_S, disk_fields, kept_fields, trends_of
from app.records.database import Files, as_log_error, make_way
from app.ros.messages import FieldReader, Interfaces, has_key
from app.ros.zenoh.sample import Sample
from app.system.disk_writer import DiskWriter
from app.system.errors import DecodeError, LogCorrupt, LogError, LogGone
from app.system.limits import BoundedQueue
from app.system.texts import TextLike, say

# Records the fields that trends show, and those that alarms have limits for, from each sample. Used on
# the event loop only.
#
# Samples are kept undecoded for a moment, and decoded in slices of some milliseconds: whatever a robot
# publishes delays no press and no hold by more than a slice.

log = logging.getLogger("kiosk.trends")

DECODE_AFTER_S: Final = 0.2
MAX_PENDING: Final = 4_000  # samples that are not decoded yet
MAX_PENDING_BYTES: Final = 16_000_000
FORGET_EVERY: Final = 300  # decoded batches
MAX_ALARMED: Final = 50  # fields that only alarms need: the others have no curve
BETWEEN_CLOCK: Final = 32  # samples that are decoded between two looks at the clock


class Pending(NamedTuple):
    """A sample that is not decoded yet; `whole` is false where the one before is not continued."""

    key: str
    at: float
    wall: float
    data: bytes
    whole: bool


class TrendRecorder:
    """The `SampleListener` of a robot's history."""

    def __init__(
        self, panel: Panel, interfaces: Interfaces, robot: RobotState, slices: Slices | None = None
    ) -> None:
        self._robot = robot
        self._slices = slices or robot.slices
        self._readers: dict[str, FieldReader] = {}
        self._fields: dict[str, list[tuple[str, FieldHistory]]] = {}
        self._origins: dict[tuple[str, str | None], int] = {}  # (topic's key, bridge) → cuts
        self._pending: BoundedQueue[Pending] = BoundedQueue(MAX_PENDING, MAX_PENDING_BYTES)
        self._timer: asyncio.TimerHandle | None = None
        self._batches = 0
        types = panel.subscriptions()
        by_topic: dict[str, list[str]] = {}
        for (topic, field), (keep_s, max_age_s) in recorded_fields(panel).items():
            by_topic.setdefault(topic, []).append(field)
            history = FieldHistory(keep_s, max_age_s)
            robot.history.fields[robot.key(topic), field] = history
            self._fields.setdefault(robot.key(topic), []).append((field, history))
        for topic, fields in by_topic.items():
            self._readers[robot.key(topic)] = interfaces.field_reader(types[topic], fields)

    @property
    def keys(self) -> frozenset[str]:
        return frozenset(self._readers)

    def record_sample(self, key: str, sample: Sample) -> None:
        """A sample was received: it is decoded within a moment."""
        cuts = self._robot.cuts(key)
        whole = self._origins.get((key, sample.source)) == cuts
        if not whole:
            current = [(o, n) for o, n in self._origins.items() if o[0] != key or n == cuts]
            self._origins = dict(current)
            self._origins[key, sample.source] = cuts
        pending = Pending(key, sample.at, sample.wall, bytes(sample.payload), whole)
        for lost in self._pending.add(pending, len(pending.data)):
            self._interrupt(lost.key)
        if self._timer is None:
            loop = asyncio.get_running_loop()
            self._timer = loop.call_later(DECODE_AFTER_S, self._begin)

    def stop(self) -> None:
        """Decodes what is pending."""
        if self._timer is not None:
            self._timer.cancel()
        self.decode(math.inf)

    def decode(self, until: float) -> bool:
        """Decodes until a time (monotonic seconds); returns whether nothing is left."""
        while self._pending:
            for _ in range(min(BETWEEN_CLOCK, len(self._pending))):
                self._record(self._pending.take())
                if self._pending and len(self._pending[0].data) > 2_000:
                    break
            if time.monotonic() >= until:
                break
        if self._pending:
            return False
        self._timer = None
        self._batches += 1
        if self._batches % FORGET_EVERY == 0:
            now = self._robot.history.time(time.monotonic())
            for history in self._robot.history.fields.values():
                history.forget_old(now)
        return True

    def _begin(self) -> None:
        self._slices.schedule(self.decode)

    def _interrupt(self, key: str) -> None:
        for _, history in self._fields[key]:
            history.interrupt()

    def _record(self, pending: Pending) -> None:
        if not pending.whole:
            self._interrupt(pending.key)
        try:
            received = self._robot.clock.time_at(pending.wall)
            values = self._readers[pending.key].read(pending.data, received)
        except DecodeError:  # the topic's state counts and logs it
            self._interrupt(pending.key)
            return
        except Exception:  # the next sample has another try
            log.exception("a sample of %s is missing in the trends", pending.key)
            self._interrupt(pending.key)
            return
        at = self._robot.history.time(pending.at)
        for field, history in self._fields[pending.key]:
            value = values.get(field)
            if value is None and has_key(field) and not values.is_ambiguous(field):
                continue  # another node's part of the list
            history.add(at, _number(value))


def recorded_fields(panel: Panel) -> dict[tuple[str, str], tuple[float, float]]:
    """(topic, field) → how long it is kept, and after which silence there is a gap, in seconds: of all
    trends, and of the first alarms with limits."""
    kept = kept_fields(trends_of(panel))
    fields = {value: (trend.keep_s, trend.max_age_s) for value, trend in kept.items()}
    limited = ((alarm.limited_value, alarm.max_age_s or math.inf) for alarm in panel.alarms)
    added = {value: (RAW_S, max_age_s) for value, max_age_s in limited if value and value not in fields}
    return fields | dict(islice(added.items(), MAX_ALARMED))


def _number(value: Any) -> float:
    """NaN for an element that is not there, or a number beyond all floats."""
    try:
        return math.nan if value is None else float(value)
    except OverflowError:
        return math.nan


# The SQLite file of the trends' histories: a row for each bucket. Used on one thread.
#
# A transaction is in the file whole or not at all, also when the process is killed or the power fails
# while it is written.

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


# Histories on disk: read at the start, and written by a thread (`DiskWriter`).
#
# What could not be written stays due: histories go on in memory, and are written as soon as the disk
# takes them again.

WRITE_EVERY_S: Final = 5.0
LOAD_TIMEOUT_S: Final = 5.0  # the panel starts without earlier values if the disk takes longer
STOP_TIMEOUT_S: Final = 5.0
MOST_ROWS: Final = 500  # of a level, in one transaction
MOST_TRANSACTIONS: Final = 2  # that wait: the last one, and all that is due at the end
REMOVE_EVERY: Final = 120  # transactions

Argument = TypeVar("Argument")
Loaded = dict[tuple[FieldName, int], list[Bucket]]


class StoredField(NamedTuple):
    """A field that is kept on disk."""

    name: FieldName
    history: History
    field: FieldHistory

    def keep_s(self, level: Level) -> float:
        return min(self.field.keep_s, level.width * level.most)


class Transaction(NamedTuple):
    """Buckets to be written at once. `newest` is the time of the last one of each level, by the level's
    identity; `now` is the wall clock's time."""

    rows: Rows
    newest: dict[int, float]
    now: float


def _by_wall_clock(buckets: Iterable[Bucket], history: History) -> list[Bucket]:
    """Buckets with the time of the wall clock: of those of this run as it is now."""
    return [
        bucket._replace(at=bucket.at + history.shift) if bucket.at >= history.start else bucket
        for bucket in buckets
    ]


class TrendWriter:
    """The histories of all robots of a panel on disk, from `start` to `stop`."""

    def __init__(self, folder: Path, panel: Panel) -> None:
        self._folder = folder
        self._panel = panel
        self._kept: list[StoredField] = []
        self._listeners: list[tuple[History, Callable[[], None]]] = []
        self._saved: dict[int, float] = {}  # by the level's identity: the time of the last bucket
        self._loop = asyncio.get_running_loop()
        self._writer: DiskWriter[Transaction] = DiskWriter("trends", self, most=MOST_TRANSACTIONS)
        self._file: TrendFile | None = None
        self._loaded: Loaded = {}
        self._is_delivered = False  # `_loaded`, or what could be read of it
        self._has_loaded: asyncio.Future[None] = self._loop.create_future()
        self._fault: TextLike = ""
        self._busy = False
        self._more = False  # whether one transaction does not take all that is due
        self._transactions = 0
        self._timer: asyncio.TimerHandle | None = None

    def add(self, robot_id: str, robot: RobotState, show: Callable[[], None]) -> None:
        """Keeps a robot's fields; `show` is called when the history's `fault` has changed."""
        types = self._panel.subscriptions()
        for topic, field in sorted(disk_fields(trends_of(self._panel))):
            name = (robot_id, topic, types[topic], field)
            history = robot.history.fields[robot.key(topic), field]
            self._kept.append(StoredField(name, robot.history, history))
        self._listeners.append((robot.history, show))

    async def start(self) -> None:
        """Starts the thread and loads what was kept."""
        self._writer.start()
        try:
            async with asyncio.timeout(LOAD_TIMEOUT_S):
                await self._has_loaded
        except TimeoutError:
            log.error("%s takes too long: trends begin without earlier values", self._folder)
        self._timer = self._loop.call_later(WRITE_EVERY_S, self._tick)

    async def stop(self) -> None:
        """Writes what is due; waits for `STOP_TIMEOUT_S` at most."""
        if self._timer is not None:
            self._timer.cancel()
        self._submit(everything=True)
        if not await asyncio.to_thread(self._writer.close, STOP_TIMEOUT_S):
            log.error("the disk is too slow: the last values of trends were not written")

    def _tick(self) -> None:
        self._timer = self._loop.call_later(WRITE_EVERY_S, self._tick)
        if not self._busy:
            self._submit()

    def _submit(self, everything: bool = False) -> None:
        """Gives the thread what is due: of each level `MOST_ROWS`, or everything."""
        most = None if everything else MOST_ROWS
        monotonic, wall = time.monotonic(), time.time()
        rows: dict[FieldName, dict[int, list[Bucket]]] = {}
        newest: dict[int, float] = {}
        more = False
        for stored in self._kept:
            stored.history.set_clock(monotonic, wall)
            for level in stored.field.levels:
                since = self._saved.get(id(level), stored.history.start)
                due = list(islice(level.since(since), most))
                if due:
                    newest[id(level)] = due[-1].at
                    rows.setdefault(stored.name, {})[int(level.width)] = _by_wall_clock(
                        due, stored.history
                    )
                    more = more or len(due) == most
        if rows:
            self._busy, self._more = True, more
            self._writer.put(Transaction(rows, newest, wall), bounded=False)

    def _put_loaded(self, loaded: Loaded) -> None:
        """Puts loaded buckets before those of this run."""
        last = {id(stored.history): stored.history for stored in self._kept}
        for history in last.values():
            own = [stored for stored in self._kept if stored.history is history]
            recorded = any(level.at for stored in own for level in stored.field.levels)
            ends = [
                b[-1].at for stored in own for key, b in loaded.items() if key[0] == stored.name and b
            ]
            if ends and not recorded:
                history.begin_after(max(ends))
            for stored in own:
                for level in stored.field.levels:
                    buckets = loaded.get((stored.name, int(level.width)), [])
                    level.put_before(b for b in buckets if b.at < history.start)

    def _show_fault(self, fault: TextLike) -> None:
        self._fault = fault
        for history, show in self._listeners:
            history.fault = fault
            show()

    def _written(self, newest: dict[int, float]) -> None:
        """What was written is due no more; the newest buckets still grow."""
        self._busy = False
        self._saved |= newest
        if newest and self._more:
            self._submit()
        if newest and self._fault:
            log.info("trends are written to %s again", self._folder)
            self._show_fault("")

    def _end_loading(self, loaded: Loaded) -> None:
        self._put_loaded(loaded)
        if not self._has_loaded.done():
            self._has_loaded.set_result(None)

    def _begin_again(self, _: None) -> None:
        self._saved = {
            id(level): -math.inf for field_on_disk in self._kept for level in field_on_disk.field.levels
        }

    # On the thread: `DiskFile`.

    def open(self) -> None:
        with as_log_error():
            self._file = TrendFile(self._folder)
            if not self._is_delivered:
                self._load(self._file, time.time())
        self._deliver()

    def write(self, items: Sequence[Transaction]) -> None:
        assert self._file is not None  # it is open
        for transaction in items:
            with as_log_error():
                self._file.write(transaction.rows, self._removal(), transaction.now)
            self._call(self._written, transaction.newest)

    def refuse(self, items: Sequence[Transaction], error: LogError) -> None:
        self._call(self._written, {})

    def tidy(self, quiet: bool) -> None:
        """`write` removes what is old."""

    def idle_s(self) -> float:
        return math.inf

    def close(self, error: LogError | None) -> None:
        if self._file is not None:
            self._file.close()
            self._file = None
        if error is not None:
            self._report(error)
            self._deliver()

    def _deliver(self) -> None:
        """Gives the event loop what was loaded; once."""
        if not self._is_delivered:
            self._is_delivered = True
            self._call(self._end_loading, self._loaded)

    def _load(self, file: TrendFile, now: float) -> None:
        dropped = 0
        for stored in self._kept:
            for level in stored.field.levels:
                since = now - stored.keep_s(level)
                width = int(level.width)
                dropped += file.remove_future(stored.name, width, now)
                self._loaded[stored.name, width] = list(file.buckets(stored.name, width, since))
        file.remove_unused([stored.name for stored in self._kept], now)
        if dropped:
            log.error("%s: %d stored values are in the future and are dropped", self._folder, dropped)

    def _removal(self) -> dict[tuple[FieldName, int], float]:
        """How long each level is kept, for a transaction that removes what is old; empty for others."""
        self._transactions += 1
        if self._transactions % REMOVE_EVERY != 1:
            return {}
        return {
            (stored.name, int(level.width)): stored.keep_s(level)
            for stored in self._kept
            for level in stored.field.levels
        }

    def _report(self, error: LogError) -> None:
        """Shows the fault, logged once. In place of a file that is damaged or gone a new one is begun,
        with all that is in memory."""
        if isinstance(error, LogCorrupt | LogGone):
            with suppress(LogError):
                if kept_as := make_way(self._folder, NAME, error):
                    log.error("%s is damaged: it is kept as %s", self._folder / NAME, kept_as)
            self._call(self._begin_again, None)
        if not self._fault:
            log.error("trends are not written to %s: %s", self._folder, error)
        self._call(self._show_fault, say("trend_not_kept", why=error.text))

    def _call(self, function: Callable[[Argument], None], argument: Argument) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(function, argument)
