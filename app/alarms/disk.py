"""Alarms on the disk: read at the start, and written by a thread (`DiskWriter`) that drops no change
while the disk refuses it."""

import asyncio
import logging
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.alarms.history import HistoryRow
from app.alarms.store import AlarmStore
from app.audit.database import Files, as_log_error, make_way
from app.disk_writer import DiskWriter
from app.errors import LogCorrupt, LogError, LogGone
from app.i18n import TextLike, say
from app.panel.alarm import AlarmRules

log = logging.getLogger("kiosk.alarms")

NAME: Final = "alarms.sqlite3"
TIDY_AFTER: Final = 5_000  # transitions; a flood is not kept until the next time
MAX_WAITING: Final = 20_000  # changes; of those beyond, the disk gets only the last of each alarm
STOP_TIMEOUT_S: Final = 5.0
TIDY_EVERY_S: Final = 600.0


class Change(NamedTuple):
    """A change of an alarm by its number `seq`: the transition, None for none, and the record that
    replaces the one that stands, None if the alarm no longer stands."""

    seq: int
    id: str
    row: HistoryRow | None
    record: str | None


class DiskEvents(NamedTuple):
    """Called on the event loop: with the records that stood at the start; with the number of the last
    change that is on the disk; with why changes are not kept, "" when they are again; and when a new
    file was begun, which has nothing yet."""

    loaded: Callable[[Mapping[str, str]], None]
    written: Callable[[int], None]
    fault: Callable[[TextLike], None]
    emptied: Callable[[], None]


class AlarmDisk:
    """The file of the alarms, from `start` to `stop`."""

    def __init__(self, folder: Path, rules: AlarmRules, events: DiskEvents) -> None:
        self._folder = folder
        self._rules = rules
        self._events = events
        self._loop = asyncio.get_running_loop()
        self._writer: DiskWriter[Change] = DiskWriter(
            "alarms", self, most=MAX_WAITING, keep=True, rests=True
        )
        self._is_started = False
        # On the thread.
        self._store: AlarmStore | None = None
        self._files: Files | None = None
        self._is_loaded = False
        self._has_fault = False
        self._tidy_at = 0.0
        self._untidied = 0  # transitions that were written since

    @property
    def exists(self) -> bool:
        """Whether alarms were kept in the folder before."""
        return (self._folder / NAME).exists()

    def start(self) -> None:
        """Starts the thread, which loads what stood."""
        if not self._is_started:
            self._is_started = True
            self._writer.start()

    def put(self, change: Change) -> bool:
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
            self._store = AlarmStore(
                self._folder / NAME, days=self._rules.days, size_mb=self._rules.size_mb
            )
            self._files = Files(self._folder, NAME)
            if not self._is_loaded:
                standing = self._store.standing()
                self._is_loaded = True
                self._call(self._events.loaded, standing)

    def write(self, items: Sequence[Change]) -> None:
        assert self._store is not None  # it is open
        assert self._files is not None
        with as_log_error():
            self._files.check()
            rows = [change.row for change in items if change.row is not None]
            self._store.write(rows, {change.id: change.record for change in items})
            self._untidied += len(rows)
        self._call(self._events.written, items[-1].seq)
        self._report("")

    def refuse(self, items: Sequence[Change], error: LogError) -> None:
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
            if kept_as := make_way(self._folder, NAME, error):
                log.error("%s is damaged: it is kept as %s", self._folder / NAME, kept_as)
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
