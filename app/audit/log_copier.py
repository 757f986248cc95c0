"""The thread that copies the operator's log to another place: what is on the disk is read and written
there, in order. The log never waits for it: what the other place does not take now is read later."""

import json
import logging
import os
import threading
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final, Protocol

from app.audit.copy_file import CopyFile
from app.audit.database import as_log_error, open_read_only
from app.audit.entry import Entry
from app.audit.store import COLUMNS
from app.audit.syslog_sink import SyslogSink
from app.errors import LogError
from app.settings import Settings

log = logging.getLogger("kiosk.log")

POLL_S: Final = 1.0
BATCH: Final = 100  # entries that are read at once
RETRY_DELAYS_S: Final = (1.0, 2.0, 5.0, 15.0)  # the last one is repeated
SAVE_AFTER: Final = 1000  # entries
ENDED_WITHIN_S: Final = 5.0


class Place(Protocol):
    """Where a copy is. Every method may raise OSError; then it is closed, and opened again later."""

    name: str

    @property
    def kind(self) -> str:
        """What it is: `file` or `syslog`."""

    def open(self) -> Entry | None:
        """Opens it; returns the newest entry there, None if that is not known."""

    def write(self, entries: Sequence[Entry]) -> None: ...

    def check(self) -> None:
        """Called from time to time without an entry."""

    def close(self) -> None: ...


class Position:
    """How far a copy is, in a file of the data folder, for a place that can't be read."""

    def __init__(self, path: Path) -> None:
        self._path = path

    def load(self) -> tuple[int, str]:
        """Number and hash of the last copied entry; (0, "") without one."""
        try:
            seq, digest = json.loads(self._path.read_bytes())
        except (OSError, ValueError, TypeError):
            return 0, ""
        return int(seq), str(digest)

    def save(self, seq: int, digest: str) -> None:
        new = self._path.with_suffix(".new")
        with suppress(OSError):  # then more entries are sent again
            fd = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW, 0o600)
            with open(fd, "w", encoding="ascii") as file:
                json.dump([seq, digest], file)
            new.replace(self._path)


class LogCopier:
    """Copies from `start` to `stop`. `synced` is the number of the newest entry that is on the disk."""

    def __init__(
        self, folder: Path, where: Place, synced: Callable[[], int], position: Position | None = None
    ) -> None:
        self._folder = folder
        self._where = where
        self._synced = synced
        self._position = position
        self._at = position.load() if position else (0, "")
        self._saved = self._at[0]
        self._is_away = False
        self._failures = 0
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="operators-log-copy", daemon=True)

    @property
    def place(self) -> str:
        """What it copies to: `file` or `syslog`."""
        return self._where.kind

    @property
    def uncopied(self) -> int:
        """How many entries the copy lacks."""
        return max(0, self._synced() - self._at[0])

    def start(self) -> None:
        self._thread.start()

    def stop(self, timeout_s: float = ENDED_WITHIN_S) -> None:
        """Copies what is left, if the place takes it in time. Blocks."""
        self._ended.set()
        self._thread.join(timeout_s)

    def _run(self) -> None:
        while True:
            try:
                self._copy()
            except (OSError, LogError) as error:
                self._report_away(error)
            except Exception as error:  # the thread goes on
                log.exception("the operator's log: copying failed")
                self._report_away(error)
            else:
                return
            finally:
                self._where.close()
                self._save()
            delay = RETRY_DELAYS_S[min(self._failures, len(RETRY_DELAYS_S) - 1)]
            self._failures += 1
            if self._ended.wait(delay):
                return

    def _copy(self) -> None:
        """Copies until the end."""
        newest = self._where.open()
        if newest is not None:
            self._at = newest.seq, newest.hash
        if self._is_away:
            log.info("the operator's log is copied to %s again", self._where.name)
        self._is_away = False
        while True:
            is_last = self._ended.is_set()
            while self._synced() > self._at[0] or self._is_cut():
                entries = self._next()
                if not entries:
                    break
                self._where.write(entries)
                self._at, self._failures = (entries[-1].seq, entries[-1].hash), 0
                if self._at[0] - self._saved >= SAVE_AFTER:
                    self._save()
            if is_last:
                return
            if not self._ended.wait(POLL_S):
                self._where.check()

    def _is_cut(self) -> bool:
        """Whether the log ends before what was copied already."""
        return 0 < self._synced() < self._at[0]

    def _next(self) -> list[Entry]:
        """The next entries that are on the disk. If the log does not go on from the last copied entry,
        all of its entries: the copy then shows that it was replaced or cut off."""
        seq, digest = self._at
        last = _read(self._folder, seq - 1, seq) if seq else []
        if self._is_cut() or (last and last[0].hash != digest):
            log.error(
                "the operator's log is not the one that was copied to %s: entry %d there is not in it",
                self._where.name,
                seq,
            )
            self._at = 0, ""
        return _read(self._folder, self._at[0], self._synced())

    def _report_away(self, error: Exception) -> None:
        if not self._is_away:
            log.error("the operator's log is not copied to %s: %s", self._where.name, error)
        self._is_away = True

    def _save(self) -> None:
        if self._position is not None and self._saved != self._at[0]:
            self._position.save(*self._at)
            self._saved = self._at[0]


def _read(folder: Path, after: int, until: int) -> list[Entry]:
    db = open_read_only(folder)
    try:
        with as_log_error():
            rows = db.execute(
                f"SELECT {COLUMNS} FROM entry WHERE seq > ? AND seq <= ? ORDER BY seq LIMIT {BATCH}",
                (after, until),
            ).fetchall()
    finally:
        db.close()
    return [Entry(*row) for row in rows]


def log_copiers(settings: Settings, folder: Path, synced: Callable[[], int]) -> tuple[LogCopier, ...]:
    """The copiers that the settings ask for."""
    copiers: list[LogCopier] = []
    if settings.log_copy is not None:
        copiers.append(LogCopier(folder, CopyFile(settings.log_copy), synced))
    if settings.syslog is not None:
        sink = SyslogSink(*settings.syslog, settings.syslog_ca)
        copiers.append(LogCopier(folder, sink, synced, Position(folder / "log-sent.json")))
    return tuple(copiers)
