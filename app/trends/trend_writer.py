"""Histories on disk: read at the start, and written by a thread (`DiskWriter`).

What could not be written stays due: histories go on in memory, and are written as soon as the disk
takes them again.
"""

import asyncio
import logging
import math
import time
from collections.abc import Callable, Iterable, Sequence
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from app.audit.database import as_log_error, make_way
from app.disk_writer import DiskWriter
from app.errors import LogCorrupt, LogError, LogGone
from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.widgets.trend import disk_fields, trends_of
from app.robot.history import Bucket, FieldHistory, History, Level
from app.robot.state import RobotState
from app.trends.trend_file import NAME, FieldName, Rows, TrendFile

log = logging.getLogger("kiosk.trends")

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
