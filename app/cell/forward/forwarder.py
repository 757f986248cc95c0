"""The forwarder: reads what the stores of the cell have, and sends it to the centre. Runs in a
process beside the server, or as `operator-panel forward --once`.

One batch is in memory at a time. The cursor moves after the commit: a batch whose commit is not known
is sent again, and the centre leaves the rows that it has. A row is sent when it was there at the look
before: by then it is on the disk, and a power failure at the cell takes nothing back that the centre
has.
"""

import fcntl
import logging
import os
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from app.cell.forward.centre import Batch, Centre, CentreError
from app.cell.forward.config import ForwardConfig, read_forward
from app.cell.forward.cursors import Position, resume
from app.cell.forward.details import Answer
from app.cell.forward.spool import Cursor, Spool, folder_bytes, process_use, uptime_s
from app.cell.forward.status import ForwardStatus
from app.cell.forward.streams import STREAMS, Backlog, Mark, Stream, StreamRow
from app.records.log_key import load_key
from app.system.errors import KioskError, LogError
from app.system.texts import TextLike, number, say
from app.system.version import installed_version

log = logging.getLogger("kiosk.forward")

LOCK: Final = "forward.lock"
RETRY_S: Final = (2.0, 5.0, 15.0, 30.0)  # the last one is repeated
MEASURE_EVERY_S: Final = 10.0
SETTLE_S: Final = 1.0  # by then, what was there is on the disk
HEALTH_EVERY_S: Final = 60.0
REMOVE_EVERY_S: Final = 600.0
SLOW_S: Final = 5.0  # a longer commit is reported
LONGEST_REST_S: Final = 1.0
ALIVE_S: Final = 10.0  # the longest time between two reports of the status
REQUESTS_EVERY_S: Final = 10.0  # between two looks whether details are asked for
MOST_SLICES: Final = 20  # batches of one stream before the others have their turn
REMOVED: Final = "removed in the cell before it was sent"
REFUSED: Final = "refused by the database: "


@dataclass(slots=True)
class _Sending:
    """A stream while the centre is connected; `mark` is of the last row that was sent on this
    connection."""

    stream: Stream
    cursor: Cursor
    begins: bool
    mark: Mark | None = None


class Forwarder:
    """The forwarding of one data folder. `now` is in seconds since the epoch."""

    def __init__(
        self,
        config: ForwardConfig,
        folder: Path,
        now: Callable[[], float] = time.time,
        server: int = 0,
        rests: bool = False,
    ) -> None:
        """`server` is the process whose health is sent, 0 for none. `rests`: after each batch for as
        long as it took, so that a long backlog takes no more than half of a core from presses.
        LogError if another process sends for this folder."""
        self.status = ForwardStatus(address=config.connection.address)
        self._config = config
        self._folder = folder
        self._now = now
        self._server = server
        self._rests = rests
        self._fd = _lock(folder)
        self._spool: Spool | None = None
        self._centre: Centre | None = None
        self._positions: dict[str, Position] = {}
        self._sending: dict[str, _Sending] = {}
        self._seen: dict[str, int] = {}  # the last row of each stream at the newest look
        self._settled: dict[str, int] = {}  # and at the one before
        self._store_fault: TextLike = ""
        self._clock_ahead_s: float | None = None
        self._failures = 0
        self._is_behind = False
        self._answer: Answer | None = None
        # In monotonic seconds, when it is due.
        self._retry_at = self._measure_at = self._health_at = self._remove_at = 0.0
        self._requests_at = 0.0

    @property
    def _streams(self) -> list[Stream]:
        return [STREAMS[name] for name in self._config.streams]

    def close(self) -> None:
        self._disconnect()
        if self._spool is not None:
            with suppress(LogError):
                self._spool.close()
            self._spool = None
        os.close(self._fd)

    def step(self) -> None:
        """One look: makes what the cell itself keeps, sends what is due, and sets `status`."""
        self._store_fault = ""
        self._is_behind = False
        try:
            if self._spool is None:
                self._spool = Spool(self._folder)
            self._keep(self._spool)
            self._look()
            if time.monotonic() >= self._retry_at:
                self._send_due(self._spool)
        except CentreError as error:
            self._disconnect()
            self._fail(error)
        except LogError as error:
            self._fail(LogError(say("forward_store", why=error.text)))
        if time.monotonic() >= self._measure_at or (self.status.connected and not self._is_behind):
            self._measure()

    @property
    def pause_s(self) -> float:
        """Until the next step."""
        return 0.0 if self._is_behind else self._config.every_s

    @property
    def has_sent_all(self) -> bool:
        """Whether the centre has all that was there at the look before the last."""
        return self.status.connected and not self._is_behind and not self._store_fault

    @contextmanager
    def _tolerating(self) -> Iterator[None]:
        """A store that can't be read or written is reported; the other streams go on."""
        try:
            yield
        except LogError as error:
            fault = say("forward_store", why=error.text)
            if fault != self._store_fault and fault != self.status.note:
                log.error("%s", fault)
            self._store_fault = fault

    def _keep(self, spool: Spool) -> None:
        """Minutes of trends and the panel's health, also while the centre is away."""
        now, at = self._now(), time.monotonic()
        with self._tolerating():
            if "trends" in self._config.streams:
                spool.make_minutes(now)
            if "health" in self._config.streams and at >= self._health_at:
                self._health_at = at + HEALTH_EVERY_S
                spool.add_health(now, self._health(spool, now))
            if at >= self._remove_at:
                self._remove_at = at + REMOVE_EVERY_S
                spool.remove_old(self._config.keep_days, self._config.keep_mb, now)

    def _look(self) -> None:
        """Only what was there at the look before is sent now."""
        self._settled = dict(self._seen)
        for stream in self._streams:
            with self._tolerating():
                self._seen[stream.name] = stream.ends(self._folder)[1]

    def _send_due(self, spool: Spool) -> None:
        centre = self._connected()
        for stream in self._streams:
            with self._tolerating():
                self._send_stream(centre, spool, stream)
        if not self._is_behind and centre.has_requests:
            with self._tolerating():
                self._send_details(centre)
        self._failures = 0
        if not self.status.connected:
            self.status.connected, self.status.since = True, self._now()
            log.info("entries are sent to %s", self.status.address)
        slow = say("forward_slow", seconds=number(f"{self.status.took_s:.0f}", "s"))
        is_slow = self.status.took_s >= SLOW_S
        self.status.fault, self.status.note = "", self._store_fault or (slow if is_slow else "")

    def _connected(self) -> Centre:
        if self._centre is not None:
            return self._centre
        key = load_key(self._folder)
        if key is None:
            raise CentreError(say("forward_no_key"))
        centre = Centre(self._config.connection)
        try:
            centre.register(self._config.panel, self._config.site, key.public)
            self._clock_ahead_s = self._now() - centre.clock().timestamp()
            self._positions = centre.positions()
        except BaseException:
            centre.close()
            raise
        self._centre = centre
        return centre

    def _disconnect(self) -> None:
        if self._centre is not None:
            self._centre.close()
            self._centre = None
        self._sending.clear()
        self._answer, self._requests_at = None, 0.0

    def _send_stream(self, centre: Centre, spool: Spool, stream: Stream) -> None:
        """Sends some batches of a stream."""
        sending = self._resumed(centre, spool, stream)
        until = self._settled.get(stream.name, 0)
        if sending is None:
            return
        for _ in range(MOST_SLICES):
            if until <= sending.cursor.seq or not self._send_batch(centre, spool, sending, until):
                return
            if self._rests:
                time.sleep(min(self.status.took_s, LONGEST_REST_S))
        self._is_behind = True

    def _resumed(self, centre: Centre, spool: Spool, stream: Stream) -> _Sending | None:
        """Where a stream goes on; None while the cell has no row of it."""
        first, last = stream.ends(self._folder)
        sending = self._sending.get(stream.name)
        if not last:
            return None
        if sending is not None:
            if self._is_same_store(sending, first, last):
                return sending
            self._positions = centre.positions()  # the store was replaced under the open connection
        known = self._positions.get(stream.name)
        where = resume(
            spool.cursor(stream.name),
            known,
            first,
            last,
            lambda seq: stream.row_before(self._folder, seq),
            lambda generation, seq: centre.mark(stream.name, generation, seq),
        )
        if where.went_back:
            log.warning(
                "%s: the centre has rows up to %d: the later ones are sent again",
                stream.name,
                where.cursor.seq,
            )
        cursor = where.cursor
        if stream.own and known is not None and where.begins:
            # Its file was lost and made again: the centre has the minutes up to its last one.
            made = stream.last_until(self._folder, known.mark.at)
            cursor = cursor._replace(seq=max(cursor.seq, made))
        self._move(spool, stream, cursor)
        self._sending[stream.name] = _Sending(stream, cursor, where.begins)
        return self._sending[stream.name]

    def _is_same_store(self, sending: _Sending, first: int, last: int) -> bool:
        seq = sending.cursor.seq
        if sending.mark is None or seq < first:
            return seq <= last
        return sending.stream.row_before(self._folder, seq) == (seq, sending.mark)

    def _move(self, spool: Spool, stream: Stream, cursor: Cursor) -> None:
        """Where the disk refuses it, the centre knows how far the stream is."""
        with self._tolerating():
            spool.move(stream.name, cursor)

    def _send_batch(self, centre: Centre, spool: Spool, sending: _Sending, until: int) -> bool:
        """Sends the next rows; returns whether there may be more."""
        stream, cursor = sending.stream, sending.cursor
        rows = stream.rows(self._folder, cursor.seq, until, self._config.batch)
        if not rows:
            return False
        batch = self._batch(spool, sending, rows)
        began = time.monotonic()
        try:
            cursor = centre.send(batch)
        except CentreError as error:
            if not error.data or error.lost:
                raise
            cursor = self._send_singly(centre, batch)
        sending.cursor, sending.mark, sending.begins = cursor, rows[-1].mark, False
        self._move(spool, stream, cursor)
        self.status.sent += len(rows)
        self.status.sent_at, self.status.took_s = self._now(), time.monotonic() - began
        return True

    def _send_details(self, centre: Centre) -> None:
        """Sends some batches of the details that the cell is asked for."""
        answer = self._answer or self._next_answer(centre)
        self._answer = None  # one that can't be read begins again
        for _ in range(MOST_SLICES if answer is not None else 0):
            assert answer is not None
            batch = None if answer.refusal else answer.batch(self._config.batch)
            if batch is None:
                self._settle(centre, answer)
                return
            began = time.monotonic()
            centre.send_details(*batch)
            answer.done(batch[1])
            if self._rests:
                time.sleep(min(time.monotonic() - began, LONGEST_REST_S))
        self._answer = answer
        self._is_behind = answer is not None

    def _settle(self, centre: Centre, answer: Answer) -> None:
        status = "refused" if answer.refusal else "done"
        centre.settle(answer.request, status, answer.refusal or answer.note, answer.sent)
        log.info(
            "request %d of %s for details: %s, %d values sent",
            answer.request.id,
            answer.request.asked_by,
            answer.refusal or status,
            answer.sent,
        )
        self._requests_at, self._is_behind = 0.0, True

    def _next_answer(self, centre: Centre) -> Answer | None:
        """The oldest request whose time span is over, if it is time to look."""
        if time.monotonic() < self._requests_at:
            return None
        self._requests_at = time.monotonic() + REQUESTS_EVERY_S
        now = self._now()
        request = next((request for request in centre.requests() if request.is_due(now)), None)
        if request is None:
            return None
        sends = "trends" in self._config.streams
        return Answer(self._folder, request, centre.known_pens() if sends else ())

    def _batch(self, spool: Spool, sending: _Sending, rows: list[StreamRow]) -> Batch:
        stream, cursor = sending.stream, sending.cursor
        beginning = (rows[0].seq, stream.before(self._folder, rows[0].seq)) if sending.begins else None
        before = rows[0].seq - 1 if sending.begins else cursor.seq
        gaps: list[tuple[int, int, str]] = []
        for row in rows if stream.dense else ():
            if row.seq > before + 1:
                gaps.append((before + 1, row.seq - 1, REMOVED))
            before = row.seq
        pens = spool.pens(row.values[0] for row in rows) if stream.name == "trends" else ()
        return Batch(stream, cursor.generation, rows, beginning, pens, gaps)

    def _send_singly(self, centre: Centre, batch: Batch) -> Cursor:
        """Sends the rows of a batch one by one: the database can't take one of them, which is noted
        there as missing."""
        cursor = Cursor()
        for row in batch.rows:
            single = batch._replace(rows=[row])
            try:
                cursor = centre.send(single)
            except CentreError as error:
                if not error.data or error.lost:
                    raise
                log.error("%s: row %d can't be sent: %s", batch.stream.name, row.seq, error)
                gap = (row.seq, row.seq, f"{REFUSED}{error}"[:300])
                cursor = centre.send(single._replace(rows=(), gaps=(*single.gaps, gap)))
            batch = batch._replace(beginning=None, pens=(), gaps=())
        return cursor

    def _fail(self, error: KioskError) -> None:
        status = self.status
        pause_s = RETRY_S[min(self._failures, len(RETRY_S) - 1)]
        self._failures += 1
        self._retry_at = time.monotonic() + pause_s
        if status.fault != error.text:
            log.error("entries are not sent to %s: %s", status.address, error)
            self._measure_at = 0.0
        if status.connected or not status.since:
            status.since = self._now()
        status.connected, status.fault, status.note = False, error.text, ""

    def _measure(self) -> None:
        """What is not sent."""
        self._measure_at = time.monotonic() + MEASURE_EVERY_S
        with suppress(LogError):
            backlogs = {stream.name: self._backlog(stream) for stream in self._streams}
            oldest = [backlog.oldest for backlog in backlogs.values() if backlog.oldest is not None]
            self.status.rows = sum(backlog.rows for backlog in backlogs.values())
            self.status.size = sum(backlog.size for backlog in backlogs.values())
            self.status.oldest = min(oldest) / 1000 if oldest else None
            self.status.unsent = {name: backlog.rows for name, backlog in backlogs.items()}

    def _backlog(self, stream: Stream) -> Backlog:
        sending = self._sending.get(stream.name)
        cursor = sending.cursor if sending else self._spool.cursor(stream.name) if self._spool else None
        return stream.backlog(self._folder, cursor.seq if cursor else 0)

    def _health(self, spool: Spool, now: float) -> dict[str, Any]:
        usage = os.statvfs(self._folder)
        cpu_s, memory = process_use(self._server)
        sending = self._sending.get("log")
        cursor = sending.cursor if sending else spool.cursor("log") or Cursor()
        return {
            "version": installed_version(),
            "up_s": uptime_s(self._server),
            "cpu_s": cpu_s,
            "memory_bytes": memory,
            "disk_free_bytes": usage.f_bavail * usage.f_frsize,
            "data_bytes": folder_bytes(self._folder),
            "unsent": self.status.rows,
            "lag_s": self.status.lag_s(now),
            "clock_ahead_s": self._clock_ahead_s,
            "log_generation": cursor.generation,
            "log_seq": cursor.seq,
        }


def _lock(folder: Path) -> int:
    """Locks the folder for one forwarder; LogError if another process has it."""
    try:
        fd = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
    except OSError as error:
        raise LogError(say("forward_store", why=error.strerror or str(error))) from error
    try:
        fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        os.close(fd)
        raise LogError(say("forward_running")) from None
    return fd


# In a process beside the server: `app/system/worker.py` calls it.


def run(settings: str, folder: str, server: int) -> Iterator[str]:
    """Forwards for ever; yields the status as JSON when it has changed, and now and then. KioskError if
    it can't begin."""
    forwarder = Forwarder(read_forward(Path(settings)), Path(folder), server=server, rests=True)
    sent, sent_at = "", 0.0
    try:
        while True:
            forwarder.step()
            text = forwarder.status.as_json()
            if text != sent or time.monotonic() - sent_at >= ALIVE_S:
                sent, sent_at = text, time.monotonic()
                yield text
            time.sleep(forwarder.pause_s)
    finally:
        forwarder.close()


# `operator-panel forward`.


def send_all(config: ForwardConfig, folder: Path) -> ForwardStatus:
    """Sends once all that is there now; returns the status at the end. LogError if another process
    sends for this folder."""
    forwarder = Forwarder(config, folder)
    try:
        forwarder.step()
        time.sleep(SETTLE_S)
        forwarder.step()
        while forwarder.status.connected and not forwarder.has_sent_all:
            forwarder.step()
        forwarder._measure()
        return forwarder.status
    finally:
        forwarder.close()
