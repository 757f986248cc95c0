"""The face of the operator's log to the event loop, and the thread that owns its file.

`pressed` returns when the entry is committed to the operating system: a process that is killed
after that has it. `closed` returns when the outcome, and every entry before it, is on the disk
(fdatasync): so is all that has a receipt, after a power cut too. What comes together is committed
together, and shares a sync; syncs have a thread of their own, so that no press waits for one of
another. Neither ever blocks the event loop.
"""

import asyncio
import logging
import secrets
from collections.abc import Callable, Collection, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import AbstractAsyncContextManager, contextmanager, suppress
from pathlib import Path
from typing import Final

from app.audit.data_dir import DataDir
from app.audit.database import Head
from app.audit.entry import Entry, Origin
from app.audit.queries import Filter, OpenPress, Row
from app.audit.reader_process import ReaderProcess
from app.audit.readers import Readers
from app.audit.refusal_quota import SUMMARY_INTERVAL_S, RefusalQuota
from app.audit.ticket import Limits, Results, Ticket
from app.audit.writer_thread import WriterThread
from app.errors import LogError
from app.i18n import ENGLISH, TextLike, say

log = logging.getLogger("kiosk.log")

MOST_WAITING: Final = 1000
PRESSED_WITHIN_S: Final = 2.0  # an entry that takes longer is a press that is not sent
CLOSED_WITHIN_S: Final = 3.0  # a receipt does not wait longer: it says that it is not on the disk
ENDED_WITHIN_S: Final = 10.0


class OperatorLog:
    """One log for a whole server, in a folder that is its own; used on the event loop only."""

    def __init__(self, folder: Path, limits: Limits, mode: str = "live") -> None:
        self.folder = folder
        self._limits = limits
        self._folder = DataDir(folder)
        self._listeners: set[Callable[[], None]] = set()
        self._readers = Readers(folder)
        self._stuck: set[Ticket] = set()
        self._loop = asyncio.get_running_loop()
        self._refusals = RefusalQuota()
        self._summary_timer: asyncio.TimerHandle | None = None
        self._writer = WriterThread(
            self._folder, limits, secrets.token_hex(4), mode, self._post_results
        )

    async def start(self) -> None:
        """Opens the log; FolderInUse when another server has the folder. What else may be wrong is
        its `fault`, and tried again."""
        with suppress(OSError):  # the keeper meets it again, and says it
            await self._folder.hold_soon()
        self._writer.start()
        await self._wait_on_thread(self._writer.tried.wait)

    async def stop(self) -> None:
        """Writes what is waiting, and lets go of the folder."""
        if self._summary_timer is not None:
            self._summary_timer.cancel()
            self._write_summary()
        await self._wait_on_thread(self._writer.stop)
        self._readers.stop()
        self._folder.release()

    async def _wait_on_thread(self, wait: Callable[[float], object]) -> None:
        """Waits on a thread of its own, whatever else the process's threads are busy with."""
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
        """None until it could be opened."""
        return self._writer.head

    @property
    def fault(self) -> TextLike:
        """The sentence that says that the log can't be written; "" while it can."""
        why = self._fault_reason
        sentence = "log_unwritable" if self._is_required else "log_unwritable_free"
        return say(sentence, why=why) if why else ""

    @property
    def _fault_reason(self) -> TextLike:
        if self._stuck and not self._writer.fault:
            return say("log_slow", seconds=f"{PRESSED_WITHIN_S:g}")
        return self._writer.fault

    @property
    def lock(self) -> TextLike:
        """Why nothing may be pressed; "" while it may."""
        return self.fault if self._is_required else ""

    @property
    def _is_required(self) -> bool:
        """Whether nothing is sent that is not logged."""
        return self._limits.required or self._writer.displaced

    @contextmanager
    def notifying(self, changed: Callable[[], None]) -> Iterator[None]:
        """`changed` is called, on the loop, whenever `fault` has changed."""
        self._listeners.add(changed)
        try:
            yield
        finally:
            self._listeners.discard(changed)

    async def pressed(self, entry: Entry) -> Entry | None:
        """Writes the entry of a press that is about to be sent, and returns it as it stands.

        Raises LogError when it can't be written and must be; where it need not be, None. Repeated
        where the log has a press of this id: nothing is written then.
        """
        try:
            return await self._write_press(entry)
        except LogError as error:
            if self._is_required:
                raise LogError(self.fault or say("log_unwritable", why=error.text)) from error
            return None

    async def closed(self, entry: Entry) -> TextLike:
        """Writes the result of a press; returns when that is on the disk, or why it is not."""
        if entry.outcome == "refused":
            self._refusals.count(entry)
        try:
            await self._wait_for_result(self._add(entry), CLOSED_WITHIN_S)
        except LogError as error:
            return error.text
        return ""

    def add(self, entry: Entry) -> None:
        """Writes the result of a press, when no one waits for it."""
        self._add(entry)

    def allowed(self, origin: Origin) -> bool:
        """Whether a refusal may be an entry; where not, it is left out."""
        return self._refusals.allowed(origin)

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        """Counts a refusal that is no entry, `limited` one that was not even judged; one entry tells of
        those of a while."""
        if self._refusals.suppress(origin, limited):
            self._schedule_summary()

    @property
    def left_out(self) -> int:
        """How many refusals are no entries, since the start."""
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
            self._writer.add(Ticket(entry, self._loop.create_future()), None)

    async def rows(self, wanted: Filter, before: int | None, count: int) -> list[Row]:
        """The newest entries that are wanted before a number; LogError, TooMany."""
        return await self._readers.rows(wanted, before, count)

    def export(
        self, wanted: Filter, before: int | None, gzip: bool, language: str = ENGLISH
    ) -> AbstractAsyncContextManager[ReaderProcess]:
        """All that is wanted before a number, as CSV in a language, while this lasts; LogError,
        TooMany."""
        return self._readers.export(wanted, before, gzip, language)

    def close(self) -> None:
        """The server is about to end: it waits for no one who reads."""
        self._readers.close()

    async def open_presses(self, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
        """Presses of these widgets, not before `since` (ms), of which the end is not known, the newest
        first; LogError when that can't be read, or what was cut off is not closed yet."""
        if self.head is None:
            raise LogError(say("log_unreadable", why=self._fault_reason or say("log_closed")))
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
            raise LogError(say("log_slow", seconds=f"{seconds:g}"))
        if isinstance(ticket.result, Entry):
            return ticket.result
        raise ticket.result

    def _close_abandoned(self, ticket: Ticket) -> None:
        """A press that no one waits for any more may have been written all the same."""
        if isinstance(ticket.result, Entry):
            self._add(ticket.result.follow_up("closed", "refused", say("log_abandoned")))

    def _add(self, entry: Entry) -> Ticket:
        """Hands it to the keeper. Only what starts a press is turned away when too much waits: what
        came of it is bounded by the presses that there are."""
        ticket = Ticket(entry, self._loop.create_future())
        if not self._writer.add(ticket, MOST_WAITING if entry.of is None else None):
            raise LogError(say("log_full_queue"))
        return ticket

    def _post_results(self, results: Results, changed: bool) -> None:
        """On the keeper's threads; wakes the loop only where there is something to tell."""
        if not (results or changed):
            return
        try:
            self._loop.call_soon_threadsafe(self._deliver_results, results, changed)
        except RuntimeError:  # the loop is closed: the process ends
            log.debug("nobody is told of %d entries", len(results))

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
