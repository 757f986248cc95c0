"""The thread of the operator's log: opens the file, writes entries, syncs them and removes old ones."""

import json
import logging
import math
import threading
import time
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from app.records.data_dir import DataDir
from app.records.database import NAME, Head, as_log_error, make_room, set_aside
from app.records.entry import Entry, new_entry
from app.records.log_key import Signer
from app.records.starts import StartRecord
from app.records.store import Limits, Repeated, Results, Store, Ticket
from app.system.clock import format_time
from app.system.disk_writer import DiskWriter
from app.system.errors import FolderInUse, LogCorrupt, LogError, LogGone
from app.system.texts import TextLike, joined, say

# Opens the file of the operator's log, and makes the first entries after that.

log = logging.getLogger("kiosk.log")


class Opening:
    """Opens the file, again after each failure. Keeps the reason for a new file until it is written
    there."""

    def __init__(self, folder: Path, boot: str) -> None:
        self._folder = folder
        self._boot = boot
        self._cause: LogError | None = None
        self._new_file_reason: TextLike = ""

    def mark_lost(self, error: LogError) -> None:
        """The file was closed because of this error. An error that needs a new file is kept until there
        is one."""
        if not isinstance(self._cause, LogCorrupt | LogGone):
            self._cause = error

    def store(self, head: Head | None) -> Store:
        """Opens the file, or a new one if the old one is damaged or gone. `head` is the newest entry
        that this server has written. LogError if it can't be opened."""
        try:
            return self._store(head)
        except LogCorrupt as error:
            name = set_aside(self._folder)
            log.error("the operator's log is damaged (%s): it is kept as %s", error, name)
            self._cause, self._new_file_reason = None, say("log_began_after_damage", name=name)
            return Store(self._folder, self._boot, head)

    def _store(self, head: Head | None) -> Store:
        lost = self._cause
        if isinstance(lost, LogCorrupt):
            raise lost
        taken = isinstance(lost, LogGone) and lost.is_main_file
        if not self._new_file_reason and (taken or (head and not (self._folder / NAME).exists())):
            self._new_file_reason = self._clear_and_explain(head)
        store = Store(self._folder, self._boot, head)
        self._cause = None
        return store

    def _clear_and_explain(self, head: Head | None) -> TextLike:
        with as_log_error():
            kept = make_room(self._folder)
        gone = say("log_began_after_removal", last=head.seq if head else 0)
        why = joined([gone, say("log_found_file_kept", name=kept) if kept else ""])
        log.error("%s", why)
        return why

    def first_entries(self, store: Store, head: Head | None) -> Sequence[Entry]:
        """The first entries to write: that the file is new, or that written entries are missing in it.

        `first` in the first entry of a file is that entry's own number: its chain may begin there.
        """
        newest = store.head
        if not newest.count and (self._new_file_reason or newest.seq or store.opened_before):
            why = self._new_file_reason or say("log_began_empty", last=newest.seq)
            return [new_entry("began", values={"first": newest.seq + 1}, reason=why)]
        if head is None or head.seq <= newest.seq:
            return []
        gone = say("log_entries_lost", first=newest.seq + 1, last=head.seq)
        log.error("%s", gone)
        return [new_entry("resumed", reason=gone)]

    def mark_written(self) -> None:
        """The first entries are written."""
        self._new_file_reason = ""


def unfinished_entries(store: Store) -> Sequence[Entry]:
    """Closing entries for presses of servers that ended before the result was known."""
    return [
        entry.follow_up(
            "corrected" if store.has_outcome(entry.seq) else "closed",
            "unknown",
            say("press_unknown_server_ended"),
        )
        for entry in store.undone()
    ]


def start_entries(
    store: Store, mode: str, record: StartRecord | None, key: str = ""
) -> Sequence[Entry]:
    """The entry of this start, and those about what has changed since the last one. `key` is the public
    key that signs the log, "" without one."""
    values: dict[str, Any] = {"mode": mode} | ({"key": key} if key else {})
    changed: Sequence[Entry] = ()
    if record is not None:
        try:
            about, changed = record.make(json.loads(store.last_start()).get("files", ""))
            values |= about
        except Exception:  # the panel starts all the same, and its log says that this is missing
            log.exception("the files of this start are not in the operator's log")
            values["kept"] = False
    return [new_entry("began", values=values, reason=say("log_began")), *changed]


# The thread that syncs the operator's log to the disk.


class Syncer:
    """Syncs committed entries; entries that arrive together share a sync."""

    def __init__(self, done: Callable[[Results], None], failed: Callable[[Results], None]) -> None:
        self._done = done
        self._failed = failed
        self._waiting: Results = []
        self._store: Store | None = None
        self._ended = False
        self._wake = threading.Condition()
        self._syncing = threading.Lock()
        self._thread = threading.Thread(target=self._run, name="operators-log-sync", daemon=True)

    def start(self) -> None:
        self._thread.start()

    def set_store(self, store: Store | None) -> None:
        """Sets the file. Waits for a running sync first: the old file must stay open during it."""
        with self._syncing:
            self._store = store

    def add(self, written: Results) -> None:
        with self._wake:
            self._waiting += written
            self._wake.notify()

    def end(self, timeout_s: float) -> None:
        """Syncs the waiting entries, and ends the thread."""
        with self._wake:
            self._ended = True
            self._wake.notify()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            with self._wake:
                self._wake.wait_for(lambda: self._waiting or self._ended)
                batch, self._waiting = self._waiting, []
            if not batch:
                return
            try:
                with self._syncing:
                    if self._store is None:
                        raise LogError(say("log_file_reopening"))
                    self._store.sync()
            except LogError as error:
                self._failed([(ticket, error) for ticket, _ in batch])
            else:
                self._done(batch)


# The file of the operator's log as its thread uses it: writing, retention, and what it says of faults.
#
# `DiskWriter` is the thread. It commits what is queued together, and opens the file again after errors.
# A second thread, `Syncer`, waits for the disk.

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
