"""A thread that owns a file and writes what is queued for it: in batches, in order, with retries. The
event loop never waits for the disk.

What is written through it, and what happens to items that the disk refuses:

- the operator's log: they are handed back, and their presses refused. It may not run behind.
- trends: they are handed back, and stay due in memory.
- recordings: each recording ends by itself; the folder is never closed.
- items that must all be written (`keep`): they wait in the queue until the disk takes them.
"""

import asyncio
import logging
import math
import queue
import threading
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Final, Generic, NamedTuple, Protocol, TypeVar

from app.system.errors import LogError

log = logging.getLogger("kiosk.disk")

REST_SHARE: Final = 2.0  # of the time of a write, it rests until the next
REST_S: Final = (0.03, 0.2)  # at least and at most
RETRY_DELAYS_S: Final = (0.5, 1.0, 2.0, 4.0, 8.0)  # the last one is repeated

Item = TypeVar("Item")
Written = TypeVar("Written", contravariant=True)


class DiskFile(Protocol[Written]):
    """A file as its thread uses it. `open`, `write` and `tidy` raise LogError if the disk refuses; then
    the file is closed, and opened again after a while."""

    def open(self) -> None:
        """Opens the file. It may write first."""

    def write(self, items: Sequence[Written]) -> None:
        """Writes the items in one commit, or none of them."""

    def refuse(self, items: Sequence[Written], error: LogError) -> None:
        """These items are not written, and will not be."""

    def tidy(self, quiet: bool) -> None:
        """Called while the file is open: after each write, and after `idle_s` without one (`quiet`)."""

    def idle_s(self) -> float:
        """Seconds without a write after which `tidy` is called; inf for never."""

    def close(self, error: LogError | None) -> None:
        """Closes the file in any state, after an error or at the end."""


class _Queued(NamedTuple, Generic[Item]):
    item: Item
    size: int


Mark = Callable[[], None]  # called on the thread after all that was queued before it


class DiskWriter(Generic[Item]):
    """Writes items to a `DiskFile` on a thread of its own, from `start` to `close`."""

    def __init__(
        self,
        name: str,
        file: DiskFile[Item],
        *,
        most: int,
        batch_most: int | None = None,
        keep: bool = False,
        rests: bool = False,
    ) -> None:
        """`most` limits the sizes of the queued items together, without those that are being written;
        `batch_most` is how many are written at a time, by default all. `keep`: items that the disk
        refuses stay queued, and are refused only at the end. `rests`: it rests after each write, so
        that in a flood few large ones leave the disk to others. What comes after a rest is written
        at once."""
        self.name = name
        self._file = file
        self._most = most
        self._batch_most = batch_most
        self._keeps = keep
        self._rests = rests
        self._rest_until = 0.0  # in monotonic seconds
        self.tried = threading.Event()  # set after the first attempt to open the file
        self._queue: queue.SimpleQueue[_Queued[Item] | Mark | None] = queue.SimpleQueue()  # None wakes
        self._lock = threading.Lock()  # of the next two
        self._waiting = 0  # the sizes of the queued items, and of those that are kept
        self._reported: LogError | None = None
        self._kept: list[_Queued[Item]] = []
        self._is_refused = False  # something, since the last mark
        self._error: LogError | None = None
        self._is_open = False
        self._failures = 0
        self._try_at = 0.0
        self._ended = False
        self._thread = threading.Thread(target=self._run, name=name, daemon=True)

    # On any thread.

    def start(self) -> None:
        """Starts the thread, which opens the file."""
        self._thread.start()

    @property
    def waiting(self) -> int:
        """The sizes of the queued items together."""
        return self._waiting

    def put(self, item: Item, size: int = 1, *, bounded: bool = True) -> bool:
        """Queues an item; False if the queue is full. One that is not `bounded` is always queued."""
        with self._lock:
            if bounded and self._waiting + size > self._most:
                return False
            self._waiting += size
        self._queue.put(_Queued(item, size))
        return True

    async def flushed(self) -> bool:
        """Waits until all that was put before has been tried; whether the disk has taken all since the
        last call. Not after `close`."""
        loop = asyncio.get_running_loop()
        done: asyncio.Future[bool] = loop.create_future()

        def mark() -> None:
            is_written, self._is_refused = not (self._kept or self._is_refused), False
            with suppress(RuntimeError):  # the loop is closed
                loop.call_soon_threadsafe(resolve, is_written)

        def resolve(is_written: bool) -> None:
            if not done.done():
                done.set_result(is_written)

        self._queue.put(mark)
        return await done

    def report(self, error: LogError) -> None:
        """The disk has refused something elsewhere, such as a sync: the file is closed."""
        with self._lock:
            self._reported = error
        self._queue.put(None)

    def close(self, within_s: float) -> bool:
        """Writes what is queued, closes the file and ends the thread; False if that takes longer."""
        self._ended = True
        self._queue.put(None)
        self._thread.join(within_s)
        return not self._thread.is_alive()

    # On the thread.

    def _run(self) -> None:
        while self._turn():
            pass
        if self._kept and self._error is not None:
            self._file.refuse([queued.item for queued in self._kept], self._error)
        self._file.close(None)

    def _turn(self) -> bool:
        """Opens, writes or tidies. Holds no item afterwards. False at the end."""
        if not self._is_open and time.monotonic() >= self._try_at:
            self._open()
        self._rest()
        batch, marks = self._next()
        is_last = self._ended and self._queue.empty()
        with self._lock:
            error, self._reported = self._reported, None
        if error is not None:
            self._fail(error)
        if (batch or self._kept) and not self._is_open and is_last:
            self._open()
        if batch or (self._kept and self._is_open):
            self._write(batch)
        if self._is_open:
            self._guard(lambda: self._file.tidy(not batch))
        for mark in marks:
            mark()
        return not is_last

    def _rest(self) -> None:
        """Waits until the next write may begin; not at the end."""
        while not self._ended and (left_s := self._rest_until - time.monotonic()) > 0:
            time.sleep(min(left_s, REST_S[0]))

    def _next(self) -> tuple[list[_Queued[Item]], list[Mark]]:
        """The items of the next write and the marks behind them, as soon as there is something to
        do."""
        batch: list[_Queued[Item]] = []
        marks: list[Mark] = []
        with suppress(queue.Empty):
            entry = self._queue.get(timeout=self._wait_s())
            while True:
                if isinstance(entry, _Queued):
                    batch.append(entry)
                elif entry is not None:
                    marks.append(entry)
                if len(batch) == self._batch_most:
                    break
                entry = self._queue.get_nowait()
        self._count(batch, -1)
        return batch, marks

    def _count(self, batch: Sequence[_Queued[Item]], sign: int) -> None:
        with self._lock:
            self._waiting += sign * sum(queued.size for queued in batch)

    def _wait_s(self) -> float | None:
        if self._is_open:
            seconds = 0.0 if self._kept else self._file.idle_s()
            return None if seconds == math.inf else max(0.0, seconds)
        return max(0.0, self._try_at - time.monotonic())

    def _open(self) -> None:
        self._is_open = True  # so that a failure closes it
        if self._guard(self._file.open):
            self._failures, self._error = 0, None
        self.tried.set()

    def _write(self, batch: list[_Queued[Item]]) -> None:
        items, began = [queued.item for queued in (*self._kept, *batch)], time.monotonic()
        if self._is_open and self._guard(lambda: self._file.write(items)):
            self._count(self._kept, -1)
            self._kept = []
            if self._rests:
                ended = time.monotonic()
                self._rest_until = ended + min(max(REST_SHARE * (ended - began), REST_S[0]), REST_S[1])
        elif self._keeps:
            self._count(batch, 1)
            self._kept += batch
        else:
            self._is_refused = True
            assert self._error is not None  # it is closed
            self._file.refuse(items, self._error)

    def _guard(self, work: Callable[[], None]) -> bool:
        """Does the work; after an error, whatever it is, closes the file and returns False."""
        try:
            work()
        except LogError as error:
            self._fail(error)
            return False
        except Exception as error:  # the thread goes on
            log.exception("%s: writing failed", self.name)
            self._fail(LogError(str(error) or type(error).__name__))
            return False
        return True

    def _fail(self, error: LogError) -> None:
        """Closes the file. Nothing is written until it is open again."""
        wait = RETRY_DELAYS_S[min(self._failures, len(RETRY_DELAYS_S) - 1)]
        self._failures += 1
        self._try_at = time.monotonic() + wait
        self._error, self._is_open = error, False
        self._file.close(error)
