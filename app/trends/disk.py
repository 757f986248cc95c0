"""The thread that writes histories to disk, and reads them at the start.

The event loop never waits for the disk. What could not be written stays due: histories go on in memory,
and are written as soon as the disk takes them again.
"""

import asyncio
import logging
import math
import queue
import threading
import time
from collections.abc import Callable, Iterable
from contextlib import suppress
from itertools import islice
from pathlib import Path
from typing import Final, NamedTuple, TypeVar

from app.audit.database import as_log_error
from app.errors import LogCorrupt, LogError, LogGone
from app.i18n import TextLike, say
from app.panel.model import Panel
from app.panel.widgets.trend import disk_fields, trends_of
from app.robot.history import Bucket, FieldHistory, History, Level
from app.robot.state import RobotState
from app.trends.file import FieldName, Rows, TrendFile, remove_journal, set_aside

log = logging.getLogger("kiosk.trends")

WRITE_EVERY_S: Final = 5.0
LOAD_TIMEOUT_S: Final = 5.0  # the panel starts without earlier values if the disk takes longer
STOP_TIMEOUT_S: Final = 5.0
MOST_ROWS: Final = 500  # of a level, in one transaction
REMOVE_EVERY: Final = 120  # transactions

Given = TypeVar("Given")
Loaded = dict[tuple[FieldName, int], list[Bucket]]


class StoredField(NamedTuple):
    """A field that is kept on disk."""

    name: FieldName
    history: History
    field: FieldHistory

    def keep_s(self, level: Level) -> float:
        return min(self.field.keep_s, level.width * level.most)


def _by_wall_clock(buckets: Iterable[Bucket], history: History) -> list[Bucket]:
    """Buckets with the time of the wall clock: of those of this run as it is now."""
    return [
        bucket._replace(at=bucket.at + history.shift) if bucket.at >= history.start else bucket
        for bucket in buckets
    ]


class TrendDisk:
    """The histories of all robots of a panel on disk, from `start` to `stop`."""

    def __init__(self, folder: Path, panel: Panel) -> None:
        self._folder = folder
        self._panel = panel
        self._kept: list[StoredField] = []
        self._listeners: list[tuple[History, Callable[[], None]]] = []
        self._saved: dict[int, float] = {}  # by the level's identity: the time of the last bucket
        self._loop = asyncio.get_running_loop()
        self._queue: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._file: TrendFile | None = None
        self._fault: TextLike = ""
        self._busy = False
        self._more = False  # whether one transaction does not take all that is due
        self._transactions = 0
        self._timer: asyncio.TimerHandle | None = None
        self._thread = threading.Thread(target=self._run, name="trends", daemon=True)

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
        self._thread.start()
        done: asyncio.Future[None] = self._loop.create_future()

        def loaded(found: Loaded) -> None:
            self._take(found)
            if not done.done():
                done.set_result(None)

        now = time.time()
        self._queue.put(lambda: self._call(loaded, self._load(now)))
        try:
            async with asyncio.timeout(LOAD_TIMEOUT_S):
                await done
        except TimeoutError:
            log.error("%s takes too long: trends begin without earlier values", self._folder)
        self._timer = self._loop.call_later(WRITE_EVERY_S, self._tick)

    async def stop(self) -> None:
        """Writes what is due; waits for `STOP_TIMEOUT_S` at most."""
        if self._timer is not None:
            self._timer.cancel()
        self._submit(everything=True)
        self._queue.put(None)
        await asyncio.to_thread(self._thread.join, STOP_TIMEOUT_S)
        if self._thread.is_alive():
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
        for one in self._kept:
            one.history.set_clock(monotonic, wall)
            for level in one.field.levels:
                since = self._saved.get(id(level), one.history.start)
                due = list(islice(level.since(since), most))
                if due:
                    newest[id(level)] = due[-1].at
                    rows.setdefault(one.name, {})[int(level.width)] = _by_wall_clock(due, one.history)
                    more = more or len(due) == most
        if rows:
            self._busy, self._more = True, more
            self._queue.put(lambda: self._write(rows, newest, wall))

    def _take(self, found: Loaded) -> None:
        """Puts loaded buckets before those of this run."""
        last = {id(one.history): one.history for one in self._kept}
        for history in last.values():
            own = [one for one in self._kept if one.history is history]
            recorded = any(level.at for one in own for level in one.field.levels)
            ends = [b[-1].at for one in own for key, b in found.items() if key[0] == one.name and b]
            if ends and not recorded:
                history.begin_after(max(ends))
            for one in own:
                for level in one.field.levels:
                    buckets = found.get((one.name, int(level.width)), [])
                    level.put_before(b for b in buckets if b.at < history.start)

    def _show_fault(self, fault: TextLike) -> None:
        self._fault = fault
        for history, show in self._listeners:
            history.fault = fault
            show()

    def _begin_again(self, _: None) -> None:
        self._saved = {
            id(level): -math.inf for field_on_disk in self._kept for level in field_on_disk.field.levels
        }

    # Below: on the thread.

    def _run(self) -> None:
        while (work := self._queue.get()) is not None:
            try:
                work()
            except Exception:  # the thread must go on
                log.exception("writing trends failed")
        if self._file is not None:
            self._file.close()

    def _open(self) -> TrendFile:
        if self._file is None:
            self._file = TrendFile(self._folder)
        return self._file

    def _load(self, now: float) -> Loaded:
        found: Loaded = {}
        dropped = 0
        try:
            with as_log_error():
                file = self._open()
                for one in self._kept:
                    for level in one.field.levels:
                        since = now - one.keep_s(level)
                        width = int(level.width)
                        dropped += file.remove_future(one.name, width, now)
                        found[one.name, width] = list(file.buckets(one.name, width, since))
                file.remove_unused([one.name for one in self._kept], now)
        except LogError as error:
            self._failed(error)
        if dropped:
            log.error("%s: %d stored values are in the future and are dropped", self._folder, dropped)
        return found

    def _write(self, rows: Rows, newest: dict[int, float], now: float) -> None:
        self._transactions += 1
        removed = self._transactions % REMOVE_EVERY == 1
        keep_s = {
            (one.name, int(level.width)): one.keep_s(level)
            for one in (self._kept if removed else ())
            for level in one.field.levels
        }
        try:
            with as_log_error():
                self._open().write(rows, keep_s, now)
        except LogError as error:
            self._failed(error)
            self._call(self._written, {})
        else:
            self._call(self._written, newest)

    def _written(self, newest: dict[int, float]) -> None:
        """On the event loop: what was written is due no more; the newest buckets still grow."""
        self._busy = False
        self._saved |= newest
        if newest and self._more:
            self._submit()
        if newest and self._fault:
            log.info("trends are written to %s again", self._folder)
            self._show_fault("")

    def _failed(self, error: LogError) -> None:
        """Sets the fault, logged once; the file is opened again for the next transaction. In place of
        one that is damaged or gone a new one is begun, with all that is in memory."""
        if self._file is not None:
            self._file.close()
            self._file = None
        if isinstance(error, LogCorrupt | LogGone):
            with suppress(OSError):
                if isinstance(error, LogCorrupt):
                    set_aside(self._folder)
                elif error.is_main_file:
                    remove_journal(self._folder)
            self._call(self._begin_again, None)
        if not self._fault:
            log.error("trends are not written to %s: %s", self._folder, error)
        self._call(self._show_fault, say("trend_not_kept", why=error.text))

    def _call(self, function: Callable[[Given], None], given: Given) -> None:
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(function, given)
