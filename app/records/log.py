"""The operator's log as the event loop uses it; with the limit of refusals, and the log that records
nothing."""

import asyncio
import logging
import secrets
import time
from collections.abc import Callable, Collection, Hashable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import Final, Protocol

from app.records.copy import LogCopier, log_copiers
from app.records.data_dir import DataDir
from app.records.database import Filter, Head, LogRow, OpenPress
from app.records.entry import Entry, Origin, new_entry
from app.records.reader import Readers
from app.records.starts import StartRecord
from app.records.store import Limits, Results, Ticket
from app.records.writer import LogWriter
from app.system.clock import format_time
from app.system.errors import FolderInUse, LogError
from app.system.limits import Quota, TokenBuckets
from app.system.settings import Settings
from app.system.texts import ENGLISH, TextLike, number, render, say
from app.system.worker import RunningWorker

# Limits how many refusals get their own entries in the operator's log; the others are summarised.
#
# A client that floods the server with refused presses would otherwise push older entries out of the
# log, whose size is limited. There is a quota per browser, per address (a browser may drop its cookie)
# and in total. Presses that are sent do not count.

SUMMARY_INTERVAL_S: Final = 60.0  # from the first suppressed refusal to the summary entry
MAX_BROWSERS: Final = 5  # with their own summary entry per interval; the others share one
OF_BROWSER: Final = Quota(60, per_s=1 / 30)
OF_ADDRESS: Final = Quota(200, per_s=1 / 15)
OF_ALL: Final = Quota(600, per_s=1 / 10)


class HasOrigin(Protocol):
    """An origin, or an entry with its fields."""

    @property
    def address(self) -> str: ...
    @property
    def browser(self) -> str: ...


@dataclass(slots=True)
class _Suppressed:
    """Refusals of one browser without entries; `limited`: they were over the rate limit."""

    origin: Origin
    limited: bool
    since: float  # seconds since the epoch
    count: int = 0


class RefusalQuota:
    """The quotas of one log. Used on the event loop only."""

    def __init__(
        self,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        self._wall = wall
        self._all = TokenBuckets(OF_ALL, monotonic)
        self._browsers = TokenBuckets(OF_BROWSER, monotonic)
        self._addresses = TokenBuckets(OF_ADDRESS, monotonic)
        self._suppressed: dict[tuple[str, str, bool], _Suppressed] = {}
        self.left_out = 0

    def allowed(self, origin: HasOrigin) -> bool:
        """Whether a refusal may have its own entry."""
        return all(buckets.has_token(key) for buckets, key in self._buckets(origin))

    def count(self, origin: HasOrigin) -> None:
        """Counts a refusal with its own entry."""
        for buckets, key in self._buckets(origin):
            buckets.take_token(key)

    def suppress(self, origin: Origin, limited: bool = False) -> bool:
        """Counts a refusal without an entry; `limited`: it was over the rate limit. Returns whether it
        is the first since the last summary."""
        first = not self._suppressed
        key = (origin.address, origin.browser, limited)
        if key not in self._suppressed and len(self._suppressed) >= MAX_BROWSERS:
            key, origin = ("", "", limited), Origin(address="", who=render(say("others")))
        self._suppressed.setdefault(key, _Suppressed(origin, limited, self._wall())).count += 1
        self.left_out += not limited
        return first

    def summary_due(self) -> list[Entry]:
        """The summary entries, one per browser; the counts begin at zero again."""
        suppressed, self._suppressed = self._suppressed, {}
        return [_entry(refusals) for refusals in suppressed.values()]

    def _buckets(self, origin: HasOrigin) -> tuple[tuple[TokenBuckets, Hashable], ...]:
        return (
            (self._all, ""),
            (self._browsers, (origin.address, origin.browser)),
            (self._addresses, origin.address),
        )


def _entry(suppressed: _Suppressed) -> Entry:
    origin = suppressed.origin
    name = " ".join(filter(None, (origin.who, f"({origin.address})" if origin.address else "")))
    sentence = "log_more_limited" if suppressed.limited else "log_more_refused"
    reason = say(sentence, count=suppressed.count, name=name, since=format_time(suppressed.since))
    return new_entry("refused", origin, {"more": suppressed.count}, outcome="refused", reason=reason)


# The operator's log as the event loop uses it. A separate thread owns the file.
#
# `pressed` returns when the entry is committed to the operating system: it survives a kill of the
# process. `closed` returns when the result and every earlier entry are on the disk (fdatasync): every
# receipt survives a power cut. Entries that arrive together share a commit and a sync. Syncs have their
# own thread, so that no press waits for the sync of another. Nothing here blocks the event loop.

log = logging.getLogger("kiosk.log")

PRESSED_WITHIN_S: Final = 2.0  # if the entry takes longer, the press is not sent
CLOSED_WITHIN_S: Final = 3.0  # then the receipt is sent with a note that it is not on the disk
ENDED_WITHIN_S: Final = 10.0


class OperatorLog:
    """The log of one server, in its own folder. Used on the event loop only."""

    def __init__(
        self,
        folder: Path,
        limits: Limits,
        mode: str = "live",
        record: StartRecord | None = None,
        signs: bool = False,
    ) -> None:
        self.folder = folder
        self.copiers: tuple[LogCopier, ...] = ()
        self._limits = limits
        self._folder = DataDir(folder)
        self._listeners: set[Callable[[], None]] = set()
        self._readers = Readers(folder)
        self._stuck: set[Ticket] = set()
        self._loop = asyncio.get_running_loop()
        self._refusals = RefusalQuota()
        self._summary_timer: asyncio.TimerHandle | None = None
        self._writer = LogWriter(
            self._folder, limits, secrets.token_hex(4), mode, self._post_results, record, signs
        )

    async def start(self) -> None:
        """Opens the log; FolderInUse if another server has the folder. Any other error becomes `fault`,
        and opening is retried."""
        with suppress(OSError):  # the writer thread meets the same error and reports it
            await self._folder.hold_soon()
        self._writer.start()
        await self._wait_on_thread(self._writer.wait_until_tried)

    def start_copies(self, settings: Settings) -> None:
        """Copies the log to where the settings say, until it stops."""
        self.copiers = log_copiers(settings, self.folder, lambda: self._writer.synced_seq)
        for copier in self.copiers:
            copier.start()

    async def stop(self) -> None:
        """Writes the waiting entries, also to the copies, and releases the folder."""
        if self._summary_timer is not None:
            self._summary_timer.cancel()
            self._write_summary()
        await self._wait_on_thread(self._writer.stop)
        await asyncio.gather(*(asyncio.to_thread(copier.stop) for copier in self.copiers))
        self._readers.stop()
        self._folder.release()

    async def _wait_on_thread(self, wait: Callable[[float], object]) -> None:
        """Waits on its own thread: the default executor may be busy."""
        thread = ThreadPoolExecutor(1, "operators-log-wait")
        waited = self._loop.run_in_executor(thread, wait, ENDED_WITHIN_S)
        try:
            await waited
        finally:
            thread.shutdown(wait=waited.done() and not waited.cancelled())

    @property
    def enabled(self) -> bool:
        return True

    @property
    def head(self) -> Head | None:
        """The newest entry; None until the log is open."""
        return self._writer.head

    @property
    def uncopied(self) -> Mapping[str, int]:
        """How many entries each copy lacks, by what it is: `file`, `syslog`."""
        return {copier.place: copier.uncopied for copier in self.copiers}

    @property
    def key(self) -> str:
        """The public key that signs the log, "" if none does or the log is not open yet."""
        return self._writer.public_key if self.head else ""

    @property
    def fault(self) -> TextLike:
        """The sentence for the operator if the log can't be written, else ""."""
        why = self._fault_reason
        sentence = "log_unwritable" if self._is_required else "log_unwritable_free"
        return say(sentence, why=why) if why else ""

    @property
    def _fault_reason(self) -> TextLike:
        if self._stuck and not self._writer.fault:
            return say("log_write_too_slow", seconds=number(f"{PRESSED_WITHIN_S:g}"))
        return self._writer.fault

    @property
    def lock(self) -> TextLike:
        """Why presses are locked, "" if they are not."""
        return self.fault if self._is_required else ""

    @property
    def _is_required(self) -> bool:
        """Whether a press without a log entry is refused."""
        return self._limits.required or self._writer.displaced

    @contextmanager
    def notifying(self, changed: Callable[[], None]) -> Iterator[None]:
        """Within the block, `changed` is called on the event loop when `fault` has changed."""
        self._listeners.add(changed)
        try:
            yield
        finally:
            self._listeners.discard(changed)

    async def pressed(self, entry: Entry) -> Entry | None:
        """Writes the entry of a press before it is sent, and returns it as written.

        LogError if it can't be written and the log is required; None if it is not required. Repeated if
        the log already has a press with this id: then nothing is written.
        """
        try:
            return await self._write_press(entry)
        except LogError as error:
            if self._is_required:
                raise LogError(self.fault or say("log_unwritable", why=error.text)) from error
            return None

    async def closed(self, entry: Entry) -> TextLike:
        """Writes the result of a press. Returns "" when it is on the disk, else why it is not."""
        if entry.outcome == "refused":
            self._refusals.count(entry)
        try:
            await self._wait_for_result(self._add(entry), CLOSED_WITHIN_S)
        except LogError as error:
            return error.text
        return ""

    def add(self, entry: Entry) -> None:
        """Writes the result of a press without waiting."""
        self._add(entry)

    def allowed(self, origin: Origin) -> bool:
        """Whether a refusal may have its own entry; if not, it is only counted."""
        return self._refusals.allowed(origin)

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        """Counts a refusal without an entry; `limited`: it was over the rate limit. A summary entry is
        written later."""
        if self._refusals.suppress(origin, limited):
            self._schedule_summary()

    @property
    def left_out(self) -> int:
        """The number of refusals without an entry since the start."""
        return self._refusals.left_out

    def _schedule_summary(self) -> None:
        self._summary_timer = self._loop.call_later(
            SUMMARY_INTERVAL_S, self._write_summary_when_possible
        )

    def _write_summary_when_possible(self) -> None:
        if self._fault_reason:
            self._schedule_summary()
        else:
            self._write_summary()

    def _write_summary(self) -> None:
        for entry in self._refusals.summary_due():
            self._writer.add(Ticket(entry, self._loop.create_future()), bounded=False)

    async def rows(self, wanted: Filter, before: int | None, count: int) -> list[LogRow]:
        """The newest `count` entries that match, before the entry number `before`; LogError,
        TooMany."""
        return await self._readers.rows(wanted, before, count)

    def export(
        self, wanted: Filter, before: int | None, gzip: bool, language: str = ENGLISH
    ) -> AbstractAsyncContextManager[RunningWorker]:
        """All entries that match before the entry number `before`, as CSV in a language; LogError,
        TooMany."""
        return self._readers.export(wanted, before, gzip, language)

    def close(self) -> None:
        """Ends searches and exports at shutdown."""
        self._readers.close()

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        """Presses of these widgets since `since` (ms) without a known end, the newest first; LogError
        if the log can't be read or is not open yet."""
        if self.head is None:
            raise LogError(say("log_unreadable", why=self._fault_reason or say("log_file_reopening")))
        return await self._readers.open_presses(robot, widgets, since)

    async def _write_press(self, entry: Entry) -> Entry:
        if why := self._fault_reason:
            raise LogError(why)
        ticket = self._add(entry)
        try:
            return await self._wait_for_result(ticket, PRESSED_WITHIN_S)
        except BaseException:
            ticket.abandoned = True
            self._close_abandoned(ticket)
            raise

    async def _wait_for_result(self, ticket: Ticket, seconds: float) -> Entry:
        timer = self._loop.call_later(seconds, ticket.wake)
        try:
            await ticket.waiter
        finally:
            timer.cancel()
        if ticket.result is None:
            self._stuck.add(ticket)
            self._notify_listeners()
            raise LogError(say("log_write_too_slow", seconds=number(f"{seconds:g}")))
        if isinstance(ticket.result, Entry):
            return ticket.result
        raise ticket.result

    def _close_abandoned(self, ticket: Ticket) -> None:
        """Closes a press that was written after its waiting had ended."""
        if isinstance(ticket.result, Entry):
            self._add(ticket.result.follow_up("closed", "refused", say("log_entry_too_late")))

    def _add(self, entry: Entry) -> Ticket:
        """Queues an entry for the writer thread. If the queue is full, only new presses are rejected:
        the number of their results is limited by the number of presses."""
        ticket = Ticket(entry, self._loop.create_future())
        if not self._writer.add(ticket, bounded=entry.of is None):
            raise LogError(say("log_queue_full"))
        return ticket

    def _post_results(self, results: Results, changed: bool) -> None:
        """Runs on the writer and sync threads; wakes the event loop if there are results."""
        if not (results or changed):
            return
        try:
            self._loop.call_soon_threadsafe(self._deliver_results, results, changed)
        except RuntimeError:  # the loop is closed: the process ends
            log.debug("the results of %d entries are not delivered", len(results))

    def _deliver_results(self, results: Results, changed: bool) -> None:
        for ticket, result in results:
            ticket.result = result
            ticket.wake()
            if ticket.abandoned:
                self._close_abandoned(ticket)
            if ticket in self._stuck:
                self._stuck.discard(ticket)
                changed = True
        if changed:
            self._notify_listeners()

    def _notify_listeners(self) -> None:
        for listener in tuple(self._listeners):
            listener()


# The operator's log if the panel file switches it off: keeps nothing, and refuses presses while another
# server has the folder.


class NullLog:
    """Accepts every entry and writes none. Still locks the folder against a second server."""

    folder = None
    enabled = False
    fault: TextLike = ""
    lock: TextLike = ""
    head: Head | None = None
    key = ""
    uncopied: Mapping[str, int] = MappingProxyType({})
    left_out = 0

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = DataDir(folder) if folder else None

    async def start(self) -> None:
        """FolderInUse if another server has the folder: a repeated press could be sent by both."""
        try:
            if self._folder is not None:
                await self._folder.hold_soon()
        except OSError as error:
            log.warning("a second server would not be noticed: %s", error)

    async def stop(self) -> None:
        if self._folder is not None:
            self._folder.release()

    @contextmanager
    def notifying(self, changed: Callable[[], None]) -> Iterator[None]:
        """`changed` is never called."""
        yield

    def allowed(self, origin: Origin) -> bool:
        return True

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        """Does nothing."""

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        return []

    async def pressed(self, entry: Entry) -> Entry | None:
        """LogError if another server has taken the folder in the meantime."""
        if self._folder is not None:
            try:
                self._folder.claim()
            except FolderInUse as error:
                raise LogError(say("disk_data_in_use", why=error.text)) from error
            except OSError as error:
                log.warning("a second server would not be noticed: %s", error)
        return None

    async def closed(self, entry: Entry) -> TextLike:
        return ""

    def close(self) -> None:
        """Does nothing."""

    def add(self, entry: Entry) -> None:
        """Does nothing."""
