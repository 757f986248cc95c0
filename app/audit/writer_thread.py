"""The thread that owns the file of the operator's log: writing, retention, reopening after errors."""

import logging
import math
import queue
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final

from app.audit.data_dir import DataDir
from app.audit.database import Head, as_log_error
from app.audit.entry import Entry, new_entry
from app.audit.opening import Opening, unfinished_entries
from app.audit.store import Store
from app.audit.syncer import Syncer
from app.audit.ticket import Limits, Repeated, Results, Ticket
from app.clock import format_time
from app.errors import FolderInUse, LogError, LogGone
from app.i18n import TextLike, say

log = logging.getLogger("kiosk.log")

RETRY_DELAYS_S: Final = (0.5, 1.0, 2.0, 4.0, 8.0)  # the last one is repeated
HOUR_S: Final = 3600.0
CLOCK_SET_BY_S: Final = 60.0  # a larger change of the wall clock is no drift
IDLE_S: Final = 1.0  # after this time without a press, the file is tidied
FILE_CHECK_S: Final = 1.0  # between two checks that the files are still in the folder
WAL_BYTES: Final = 16_000_000  # a larger write-ahead log is checkpointed without waiting for a pause
TIDY_INTERVAL_S: Final = (
    0.1  # at least between two runs during presses: each takes interpreter time from them
)
CHECKPOINT_S: Final = 5.0  # at least between two forced checkpoints: a reader may block them
TIDY_AFTER: Final = 1000  # entries
MAX_UNWRITTEN: Final = 1000


class ClockSteadiness:
    """Whether the wall clock can be trusted for retention: it was not set for an hour."""

    def __init__(self) -> None:
        self._ahead: float | None = None  # of the monotonic clock
        self._since = 0.0

    def is_steady(self, wall: float, now: float) -> bool:
        if self._ahead is None or abs(wall - now - self._ahead) > CLOCK_SET_BY_S:
            self._since = now
        self._ahead = wall - now
        return now - self._since >= HOUR_S


class WriterThread:
    """Owns the file: writes queued entries, limits the file's size, and reopens it after errors."""

    def __init__(
        self,
        folder: DataDir,
        limits: Limits,
        boot: str,
        mode: str,
        report: Callable[[Results, bool], None],
    ) -> None:
        """`report` is called on the writer or sync thread with results, and whether `fault` has
        changed."""
        self._folder = folder
        self._limits = limits
        self._mode = mode
        self._report = report
        self.fault: TextLike = ""
        self.displaced = False  # another server has the folder, or may
        self.head: Head | None = None
        self.tried = threading.Event()
        self._queue: queue.SimpleQueue[Ticket | None] = queue.SimpleQueue()  # None only wakes
        self._unwritten: deque[Entry] = deque(maxlen=MAX_UNWRITTEN)
        self._opening = Opening(folder.path, boot)
        self._store: Store | None = None
        self._start_logged = False
        self._sync_error: LogError | None = None
        self._failures = 0
        self._fault_since: TextLike = ""
        self._try_at = 0.0
        self._hourly_at = 0.0
        self._checkpoint_at = 0.0
        self._tidy_at = 0.0
        self._since_tidy = 0
        self._fresh_wal = True
        self._clock = ClockSteadiness()
        self._ended = False
        self._syncer = Syncer(lambda results: self._report(results, False), self._sync_failed)
        self._thread = threading.Thread(target=self._run, name="operators-log", daemon=True)

    # On the event loop.

    def start(self) -> None:
        self._syncer.start()
        self._thread.start()

    def stop(self, timeout_s: float) -> None:
        """Writes the queued entries and closes the file; waits at most `timeout_s`."""
        self._ended = True
        self._queue.put(None)
        self._thread.join(timeout_s)

    def add(self, ticket: Ticket, most: int | None) -> bool:
        """Queues a ticket; False if `most` are waiting already."""
        if most is not None and self._queue.qsize() >= most:
            return False
        self._queue.put(ticket)
        return True

    # On the writer thread.

    def _run(self) -> None:
        ended = False
        while not ended:
            if self._store is None and time.monotonic() >= self._try_at:
                self._open()
                self.tried.set()
            batch = self._next()
            ended = self._ended and not self._queue.qsize()
            if self._sync_error is not None:
                self._handle_failure(self._sync_error)
            if batch:
                self._write(batch)
            if self._store is not None and (not batch or time.monotonic() >= self._tidy_at):
                self._tidy(self._store, quiet=not batch)
                self._tidy_at = time.monotonic() + TIDY_INTERVAL_S
        self._syncer.end(IDLE_S * 5)
        self._close()

    def _next(self) -> list[Ticket]:
        """The waiting tickets, as soon as there is something to do; empty if that is not writing."""
        try:
            waiting = [self._queue.get(timeout=self._idle_s())]
        except queue.Empty:
            return []
        waiting += [self._queue.get() for _ in range(self._queue.qsize())]
        return [ticket for ticket in waiting if ticket is not None]

    def _idle_s(self) -> float:
        if self._store is None:
            return max(0.0, self._try_at - time.monotonic())
        return min(max(0.0, self._hourly_at - time.monotonic()), FILE_CHECK_S, IDLE_S)

    def _write(self, batch: list[Ticket]) -> None:
        wanted = [ticket for ticket in batch if not ticket.abandoned]
        if len(wanted) < len(batch):
            abandoned = LogError(say("log_entry_too_late"))
            self._report([(ticket, abandoned) for ticket in batch if ticket.abandoned], False)
        if self._store is None:
            self._fail(wanted, LogError(self.fault))
            return
        try:
            wanted = self._without_repeated(self._store, wanted)
            sealed = self._store.append([ticket.entry for ticket in wanted])
            self._check(self._store)
        except LogError as error:
            self._handle_failure(error)
            self._fail(wanted, error)
            return
        self.head = self._store.head
        self._fresh_wal = False
        self._since_tidy += len(sealed)
        results: Results = list(zip(wanted, sealed, strict=True))
        self._report([(ticket, entry) for ticket, entry in results if not ticket.durable], False)
        if durable := [(ticket, entry) for ticket, entry in results if ticket.durable]:
            self._syncer.add(durable)

    def _without_repeated(self, store: Store, tickets: Sequence[Ticket]) -> list[Ticket]:
        """The tickets without repeated presses; these are answered with `Repeated`."""
        new: list[Ticket] = []
        known: Results = []
        for ticket in tickets:
            found = store.entries_of_press(ticket.entry) if ticket.entry.is_press else []
            if found and found[0].is_press:
                results = [one for one in found if one.of == found[0].seq]
                known.append((ticket, Repeated(found[0], results[-1] if results else None)))
            else:
                new.append(ticket)
        self._report(known, False)
        return new

    def _fail(self, tickets: Sequence[Ticket], error: LogError) -> None:
        self._unwritten += [ticket.entry for ticket in tickets if ticket.entry.of is not None]
        self._report([(ticket, error) for ticket in tickets], False)

    def _check(self, store: Store) -> None:
        """LogError if the files were replaced, or another server may have the folder."""
        store.check()
        with as_log_error():
            self._folder.check()

    def _handle_failure(self, error: LogError) -> None:
        """Closes the file. Nothing is written until it is open again."""
        self._sync_error = None
        self._close(complete=isinstance(error, LogGone))
        self.displaced = isinstance(error, FolderInUse)
        self._opening.mark_lost(error)
        wait = RETRY_DELAYS_S[min(self._failures, len(RETRY_DELAYS_S) - 1)]
        self._failures += 1
        self._try_at = time.monotonic() + wait
        if self.fault != error.text:
            log.error("the operator's log can't be written: %s", error)
            self._fault_since = self._fault_since or format_time(time.time())
            self.fault = error.text
            self._report([], True)

    def _open(self) -> None:
        try:
            with as_log_error():
                self._folder.claim()
            self._store = store = self._opening.store(self.head)
            self._syncer.set_store(store)
            store.probe()
            self._write_first_entries(store)
            self._check(store)
        except LogError as error:
            self._handle_failure(error)
            return
        self._failures, self._fresh_wal, self._hourly_at = 0, False, 0.0
        self.displaced = False
        if self.fault:
            log.info("the operator's log can be written again")
            self.fault, self._fault_since = "", ""
            self._report([], True)

    def _write_first_entries(self, store: Store) -> None:
        """Writes the entries that come before any new ones."""
        entries = [*self._opening.first_entries(store, self.head), *self._unwritten]
        if not self._start_logged:
            entries += unfinished_entries(store)
            values = {"mode": self._mode}
            entries.append(new_entry("began", values=values, reason=say("log_began")))
        if self.fault:
            text = say("log_resumed", since=self._fault_since, why=self.fault)
            entries.append(new_entry("resumed", reason=text))
        store.append(entries)
        self._opening.mark_written()
        self._unwritten.clear()
        self._start_logged = True
        self.head = store.head
        store.sync()

    def _tidy(self, store: Store, quiet: bool) -> None:
        """Removes old entries and empties the write-ahead log, a little at a time; logs the head once
        an hour."""
        try:
            self._check(store)
            self._remove_old(store)
            self._empty_wal(store, quiet)
        except LogError as error:
            self._handle_failure(error)

    def _remove_old(self, store: Store) -> None:
        now = time.monotonic()
        if now < self._hourly_at and self._since_tidy < TIDY_AFTER:
            return
        limits = self._limits
        days = limits.days if self._clock.is_steady(time.time(), now) else math.inf
        more = store.remove_old(days, limits.size_mb, time.time_ns() // 1_000_000)
        self._since_tidy = TIDY_AFTER if more else 0
        self._fresh_wal = self._fresh_wal and not more
        self.head = store.head
        if now >= self._hourly_at and not more:
            self._hourly_at = now + HOUR_S
            log.info("operator's log: %d entries, head %s", self.head.count, self.head.hash)

    def _empty_wal(self, store: Store, quiet: bool) -> None:
        now = time.monotonic()
        must = now >= self._checkpoint_at and store.wal_bytes() > WAL_BYTES
        if must or (quiet and not self._fresh_wal):
            store.checkpoint()
            self._fresh_wal, self._checkpoint_at = True, now + CHECKPOINT_S

    def _close(self, complete: bool = False) -> None:
        self._syncer.set_store(None)
        if self._store is not None:
            store, self._store = self._store, None
            try:
                if complete:
                    with suppress(LogError):  # as far as the disk allows
                        store.complete()
                store.close()
            except LogError as error:
                log.error("the operator's log could not be closed: %s", error)

    # On the sync thread.

    def _sync_failed(self, results: Results) -> None:
        """Reports the failure; the writer thread then closes the file."""
        self._report(results, False)
        self._sync_error = next(error for _, error in results if isinstance(error, LogError))
        self._queue.put(None)
