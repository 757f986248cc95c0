"""The file of the operator's log as its thread uses it: writing, retention, and what it says of
faults.

`DiskWriter` is the thread. It commits what is queued together, and opens the file again after errors. A
second thread, `Syncer`, waits for the disk.
"""

import logging
import math
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final

from app.audit.data_dir import DataDir
from app.audit.database import Head, as_log_error
from app.audit.entry import Entry, new_entry
from app.audit.log_key import Signer
from app.audit.opening import Opening, start_entries, unfinished_entries
from app.audit.start_record import StartRecord
from app.audit.store import Store
from app.audit.syncer import Syncer
from app.audit.ticket import Limits, Repeated, Results, Ticket
from app.clock import format_time
from app.disk_writer import DiskWriter
from app.errors import FolderInUse, LogError, LogGone
from app.i18n import TextLike, say

log = logging.getLogger("kiosk.log")

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
MOST_WAITING: Final = 1000  # entries; then new presses are refused


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


class LogWriter:
    """The `DiskFile` of the operator's log. `start`, `add` and `stop` are for the event loop."""

    def __init__(
        self,
        folder: DataDir,
        limits: Limits,
        boot: str,
        mode: str,
        report: Callable[[Results, bool], None],
        record: StartRecord | None = None,
        signs: bool = False,
    ) -> None:
        """`report` is called on the writer or sync thread with results, and whether `fault` has
        changed. `record` makes the entries about this start. `signs`: with the key in the folder."""
        self._folder = folder
        self._limits = limits
        self._mode = mode
        self._report = report
        self._record = record
        self._signer = Signer(folder.path) if signs else None
        self.fault: TextLike = ""
        self.displaced = False  # another server has the folder, or may
        self.head: Head | None = None
        self.synced_seq = 0  # entries up to this number are on the disk
        self._writer: DiskWriter[Ticket] = DiskWriter("operators-log", self, most=MOST_WAITING)
        self._unwritten: deque[Entry] = deque(maxlen=MAX_UNWRITTEN)
        self._opening = Opening(folder.path, boot)
        self._store: Store | None = None
        self._start_logged = False
        self._fault_since: TextLike = ""
        self._hourly_at = 0.0
        self._checkpoint_at = 0.0
        self._tidy_at = 0.0
        self._since_tidy = 0
        self._fresh_wal = True
        self._clock = ClockSteadiness()
        self._syncer = Syncer(self._synced, self._sync_failed)

    # On the event loop.

    def start(self) -> None:
        self._syncer.start()
        self._writer.start()

    def wait_until_tried(self, timeout_s: float) -> None:
        """Waits for the first attempt to open the file. Blocks."""
        self._writer.tried.wait(timeout_s)

    def stop(self, timeout_s: float) -> None:
        """Writes the queued entries and closes the file; waits at most `timeout_s`. Blocks."""
        self._writer.close(timeout_s)

    def add(self, ticket: Ticket, *, bounded: bool) -> bool:
        """Queues a ticket; False if it is bounded and too many are waiting already."""
        return self._writer.put(ticket, bounded=bounded)

    # On the writer thread: `DiskFile`.

    def open(self) -> None:
        with as_log_error():
            self._folder.claim()
        self._store = store = self._opening.store(self.head)
        self._syncer.set_store(store)
        store.probe()
        if self._start_logged and self._signer:
            self._signer.sign(store, "again")
        self._write_first_entries(store)
        self._check(store)
        self._fresh_wal, self._hourly_at = False, 0.0
        self.displaced = False
        if self.fault:
            log.info("the operator's log can be written again")
            self.fault, self._fault_since = "", ""
            self._report([], True)

    def write(self, items: Sequence[Ticket]) -> None:
        assert self._store is not None  # it is open
        tickets = [ticket for ticket in items if not ticket.abandoned]
        if abandoned := [ticket for ticket in items if ticket.abandoned]:
            error = LogError(say("log_entry_too_late"))
            self._answer([(ticket, error) for ticket in abandoned])
        tickets = self._without_repeated(self._store, tickets)
        sealed = self._store.append([ticket.entry for ticket in tickets])
        self._check(self._store)
        self.head = self._store.head
        self._fresh_wal = False
        self._since_tidy += len(sealed)
        results: Results = list(zip(tickets, sealed, strict=True))
        self._answer([(ticket, entry) for ticket, entry in results if not ticket.durable])
        if durable := [(ticket, entry) for ticket, entry in results if ticket.durable]:
            self._syncer.add(durable)

    def refuse(self, items: Sequence[Ticket], error: LogError) -> None:
        tickets = [ticket for ticket in items if not ticket.answered]
        self._unwritten += [ticket.entry for ticket in tickets if ticket.entry.of is not None]
        self._answer([(ticket, error) for ticket in tickets])

    def tidy(self, quiet: bool) -> None:
        """Removes old entries and empties the write-ahead log, a little at a time; logs the head once
        an hour."""
        if self._store is None or not (quiet or time.monotonic() >= self._tidy_at):
            return
        self._check(self._store)
        self._remove_old(self._store)
        self._empty_wal(self._store, quiet)
        self._tidy_at = time.monotonic() + TIDY_INTERVAL_S

    def idle_s(self) -> float:
        return min(max(0.0, self._hourly_at - time.monotonic()), FILE_CHECK_S, IDLE_S)

    def close(self, error: LogError | None) -> None:
        if error is None:
            self._syncer.end(IDLE_S * 5)
            if self._signer and self._store:
                self.head = self._signer.sign_end(self._store)
                self.synced_seq = self.head.seq
        self._close_store(complete=isinstance(error, LogGone))
        if error is None:
            return
        self.displaced = isinstance(error, FolderInUse)
        self._opening.mark_lost(error)
        if self.fault != error.text:
            log.error("the operator's log can't be written: %s", error)
            self._fault_since = self._fault_since or format_time(time.time())
            self.fault = error.text
            self._report([], True)

    def _answer(self, results: Results) -> None:
        for ticket, _ in results:
            ticket.answered = True
        self._report(results, False)

    def _without_repeated(self, store: Store, tickets: Sequence[Ticket]) -> list[Ticket]:
        """The tickets without repeated presses; these are answered with `Repeated`."""
        new: list[Ticket] = []
        known: Results = []
        for ticket in tickets:
            entries = store.entries_of_press(ticket.entry) if ticket.entry.is_press else []
            if entries and entries[0].is_press:
                results = [entry for entry in entries if entry.of == entries[0].seq]
                known.append((ticket, Repeated(entries[0], results[-1] if results else None)))
            else:
                new.append(ticket)
        self._answer(known)
        return new

    def _check(self, store: Store) -> None:
        """LogError if the files were replaced, or another server may have the folder."""
        store.check()
        with as_log_error():
            self._folder.check()

    def _write_first_entries(self, store: Store) -> None:
        """Writes the entries that come before any new ones."""
        entries = [*self._opening.first_entries(store, self.head), *self._unwritten]
        if not self._start_logged:
            entries += unfinished_entries(store)
            entries += start_entries(store, self._mode, self._record, self.public_key)
        if self.fault:
            text = say("log_resumed", since=self._fault_since, why=self.fault)
            entries.append(new_entry("resumed", reason=text))
        for entry in store.append(entries):
            if entry.kind == "began":
                store.mark_start(entry.seq)
        self._opening.mark_written()
        self._unwritten.clear()
        self._start_logged = True
        self.head = store.head
        store.sync()
        self.synced_seq = store.head.seq

    @property
    def public_key(self) -> str:
        """The key that signs, "" without one."""
        return self._signer.public if self._signer else ""

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
            if self._signer:
                self._signer.sign(store, "hour")
            self._hourly_at = now + HOUR_S
            self.head = store.head
            log.info(
                "operator's log: %d entries, head %s (for `log verify --head`)",
                self.head.count,
                self.head.hash,
            )

    def _empty_wal(self, store: Store, quiet: bool) -> None:
        now = time.monotonic()
        must = now >= self._checkpoint_at and store.wal_bytes() > WAL_BYTES
        if must or (quiet and not self._fresh_wal):
            store.checkpoint()
            self._fresh_wal, self._checkpoint_at = True, now + CHECKPOINT_S

    def _close_store(self, complete: bool) -> None:
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

    def _synced(self, results: Results) -> None:
        self.synced_seq = max(entry.seq for _, entry in results if isinstance(entry, Entry))
        self._report(results, False)

    def _sync_failed(self, results: Results) -> None:
        """Reports the failure; the writer thread then closes the file."""
        self._report(results, False)
        self._writer.report(next(error for _, error in results if isinstance(error, LogError)))
