"""The thread that writes recordings. Samples that it can't write in time are dropped."""

import asyncio
import logging
import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from app.disk_writer import DiskWriter
from app.errors import LogError, os_error_text
from app.i18n import TextLike, say
from app.recording.bounded_folder import RecordingFolder
from app.recording.mcap_file import Channel, McapFile
from app.recording.ring_buffer import OVERHEAD_BYTES, Buffered, times_of

log = logging.getLogger("kiosk.recording")

MAX_QUEUED_BYTES: Final = 128 * 1024 * 1024  # not written yet, of all robots
MAX_RING_BYTES: Final = 64 * 1024 * 1024  # of all robots
STOP_TIMEOUT_S: Final = 5.0  # for the disk at shutdown

Work = Callable[[], None]


class Recordings:
    """The recordings of one panel, from `start` to `stop`.

    `fault` is the sentence for the operator while recordings can't be written, else "".
    """

    def __init__(self, path: Path, max_mb: float, robots: int) -> None:
        """Each of `robots` may have one open file; together they may fill half the folder."""
        most = int(max_mb * 1_000_000)
        self._folder = RecordingFolder(path, most)
        self.file_bytes = most // (2 * (robots + 1))
        self.ring_bytes = min(
            MAX_RING_BYTES // robots, self.file_bytes // 2
        )  # half is for samples after the press
        # One at a time: each holds its samples until it is done.
        self._writer: DiskWriter[Work] = DiskWriter(
            "recordings", self, most=MAX_QUEUED_BYTES, batch_most=1
        )
        self._open = 0
        self.fault: TextLike = ""
        self._listeners: list[Callable[[], None]] = []
        self._loop = asyncio.get_running_loop()

    def start(self) -> None:
        """Starts the thread, which first prepares the folder."""
        self._writer.start()

    def stop(self) -> None:
        """Writes what is queued; blocks for `STOP_TIMEOUT_S` at most."""
        if not self._writer.close(STOP_TIMEOUT_S):
            log.error("the disk is too slow: a recording is left unfinished")

    def add_listener(self, listener: Callable[[], None]) -> None:
        """`listener` is called on the event loop when `fault` has changed."""
        self._listeners.append(listener)

    def enqueue(self, size: int, work: Work) -> bool:
        """Queues `work`, which holds `size` bytes, for the thread; False if the queue is full."""
        return self._writer.put(work, size, bounded=size > 0)

    def begin(
        self, name: str, channels: Mapping[str, Channel], about: Mapping[str, str]
    ) -> "Recording":
        """A new recording; `channels` are by key."""
        return Recording(self, name, channels, about)

    # On the thread: `DiskFile`. A fault ends one recording, and never closes the folder.

    def open(self) -> None:
        """Prepares the folder."""
        try:
            self._folder.open()
        except Exception as error:
            self.report_failure(error)

    def write(self, items: Sequence[Work]) -> None:
        for work in items:
            try:
                work()
            except Exception:  # an error in one recording must not end the others
                log.exception("recording failed")

    def refuse(self, items: Sequence[Work], error: LogError) -> None:
        """`write` never fails."""

    def tidy(self, quiet: bool) -> None:
        """Each new file makes room for itself."""

    def idle_s(self) -> float:
        return math.inf

    def close(self, error: LogError | None) -> None:
        """Each recording closes its file."""

    # Below: on the thread, by recordings.

    def open_file(self, name: str, about: Mapping[str, str]) -> McapFile:
        self._folder.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._folder.make_room((self._open + 1) * self.file_bytes)
        file = McapFile(self._folder.path, name, about)
        self._open += 1
        return file

    def release_file(self) -> None:
        self._open -= 1
        self._folder.make_room(self._open * self.file_bytes)

    def release_abandoned(self) -> None:
        self._open -= 1

    def clear_fault(self) -> None:
        self._set_fault("")

    def report_failure(self, error: Exception) -> None:
        """Sets the fault. The next press starts a new file."""
        why = os_error_text(error) if isinstance(error, OSError) else str(error)
        log.error("recording stopped, in %s: %s", self._folder.path, why)
        self._set_fault(say("recording_failed", why=why))

    def _set_fault(self, fault: TextLike) -> None:
        if fault != self.fault:
            self.fault = fault
            with suppress(RuntimeError):  # the loop is closed
                for listener in self._listeners:
                    self._loop.call_soon_threadsafe(listener)


class Recording:
    """One file, as the event loop uses it: all work is queued for the thread. When it `is_full` it
    takes no more samples, and the next press begins another file."""

    def __init__(
        self,
        all_: Recordings,
        name: str,
        channels: Mapping[str, Channel],
        about: Mapping[str, str],
    ) -> None:
        self._recordings = all_
        self._channels = channels
        self._bytes_left = all_.file_bytes
        self._dropped = 0
        self._file: McapFile | None = None
        self._abandoned = False
        self._accepted = all_.enqueue(
            OVERHEAD_BYTES, lambda: self._run_guarded(lambda: self._open_file(name, about))
        )

    @property
    def is_full(self) -> bool:
        return self._bytes_left <= 0 or self._abandoned or not self._accepted

    def add(self, buffered: Buffered) -> None:
        """Adds a sample."""
        self._bytes_left -= buffered.size
        if self.is_full or not self._recordings.enqueue(
            buffered.size, lambda: self._run_guarded(lambda: self._write_sample(buffered))
        ):
            self._dropped += 1

    def add_press(self, press: Mapping[str, Any], at: int) -> None:
        """Adds a press or its receipt, also to a full file. `at` is in nanoseconds since the epoch."""
        size = OVERHEAD_BYTES + len(str(press))
        self._recordings.enqueue(size, lambda: self._run_guarded(lambda: self._write_press(press, at)))

    def finish(self) -> None:
        self._recordings.enqueue(0, lambda: self._run_guarded(self._finish_file))

    # Below: on the thread.

    def _run_guarded(self, work: Work) -> None:
        try:
            work()
        except Exception as error:
            self._abandoned = True
            if self._file is not None:
                self._file.abandon()
                self._file = None
                self._recordings.release_abandoned()
            self._recordings.report_failure(error)

    def _open_file(self, name: str, about: Mapping[str, str]) -> None:
        self._file = self._recordings.open_file(name, about)

    def _write_sample(self, buffered: Buffered) -> None:
        if self._file is not None:
            sample = buffered.sample
            self._file.add(self._channels[buffered.key], bytes(sample.payload), *times_of(sample))

    def _write_press(self, press: Mapping[str, Any], at: int) -> None:
        if self._file is not None:
            self._file.add_press(press, at)

    def _finish_file(self) -> None:
        if self._file is None:
            return
        if self._dropped:
            self._file.add_metadata("left_out", {"samples": str(self._dropped)})
            log.warning("%d samples were not recorded: too many or too large", self._dropped)
        path = self._file.finish()
        self._file = None
        log.info("recorded %s", path)
        self._recordings.release_file()
        self._recordings.clear_fault()
