"""Copies of the operator's log, to a file or a syslog server, and the comparison with a copy."""

import json
import logging
import os
import socket
import ssl
import threading
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, Protocol

from app.records.database import as_log_error, open_read_only
from app.records.entry import FIELDS, Entry
from app.records.store import COLUMNS
from app.system.errors import LogError
from app.system.settings import Settings
from app.system.whole_file import write_whole

# Compares the operator's log with its copy: the file of `KIOSK_LOG_COPY`, or what a syslog server has
# written. A copy has one entry a line, as JSON; other lines are left out.

BEGIN: Final = '{"seq":'
ROTATED: Final = ".1"


def as_line(entry: Entry) -> str:
    """An entry as a line of a copy, without the line's end."""
    return json.dumps(entry._asdict(), ensure_ascii=False, separators=(",", ":"))


def parse_line(line: str) -> Entry | None:
    """The entry in a line, also behind what a syslog server writes before it; None without one."""
    at = line.find(BEGIN)
    if at < 0:
        return None
    try:
        about: Mapping[str, Any] = json.JSONDecoder().raw_decode(line, at)[0]
        return Entry(**{name: about[name] for name in FIELDS})
    except (ValueError, KeyError, TypeError):
        return None


def read_copy(path: Path) -> Iterator[Entry]:
    """The entries of a copy and of its rotated part, in their order; LogError."""
    try:
        for part in (path.with_name(path.name + ROTATED), path):
            if part == path or part.exists():
                with part.open(encoding="utf-8", errors="replace") as file:
                    yield from filter(None, map(parse_line, file))
    except OSError as error:
        raise LogError(f"the copy {path} can't be read: {error.strerror}") from error


class Comparison:
    """Compares entries in turn with those of a copy, which are kept by their hashes."""

    def __init__(self, copied: Iterator[Entry]) -> None:
        self._hashes: dict[int, str] = {}
        self.replaced = 0  # the first number of which the copy has two entries
        for entry in copied:
            known = self._hashes.setdefault(entry.seq, entry.hash)
            if known != entry.hash and not self.replaced:
                self.replaced = entry.seq
        self.count = len(self._hashes)
        self._last = max(self._hashes, default=0)
        self._newest = 0

    def fault(self, entry: Entry) -> str:
        """What is wrong with an entry of the log by the copy, "" if nothing."""
        self._newest = entry.seq
        known = self._hashes.get(entry.seq)
        if known is None or known == entry.hash:
            return ""
        return f"entry {entry.seq} is another than in the copy: the log was rewritten or replaced"

    def end_fault(self) -> str:
        """What is wrong with the whole, after the last entry of the log."""
        if self._last > self._newest:
            return (
                f"the copy has entries up to {self._last}, the log only up to {self._newest}: its"
                " newest entries were removed, or an older copy of the log is in its place"
            )
        if self.replaced:
            return (
                f"the copy has two different entries {self.replaced}: the log was replaced by another"
                " while the copy was made"
            )
        return ""


# The copy of the operator's log in a file, such as on another disk. Blocks; used by one thread.

MOST_BYTES: Final = 512_000_000  # of the file; as much again in its rotated part
TAIL_BYTES: Final = 65_536


class CopyFile:
    """Appends entries to a file that only its user can read."""

    kind: Final = "file"

    def __init__(self, path: Path, most_bytes: int = MOST_BYTES) -> None:
        self.name = str(path)
        self._path = path
        self._rotated = path.with_name(path.name + ROTATED)
        self._most_bytes = most_bytes
        self._fd = -1

    def open(self) -> Entry | None:
        """Opens the file; returns the newest entry in it, None without one. OSError."""
        flags = os.O_RDWR | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC
        self._fd = os.open(self._path, flags, 0o600)
        size = os.fstat(self._fd).st_size
        start = max(0, size - TAIL_BYTES)
        tail = os.pread(self._fd, TAIL_BYTES, start)
        if size and not tail.endswith(b"\n"):
            os.write(self._fd, b"\n")  # a line that a power failure cut
        if not size:
            with suppress(FileNotFoundError):
                tail = self._rotated.read_bytes()[-TAIL_BYTES:]
        lines = tail.decode("utf-8", "replace").splitlines()
        return next(filter(None, map(parse_line, reversed(lines))), None)

    def write(self, entries: Sequence[Entry]) -> None:
        """Writes entries, and waits until they are on the disk. OSError."""
        if os.fstat(self._fd).st_size > self._most_bytes:
            self.close()
            self._path.rename(self._rotated)
            self.open()
        data = "".join(f"{as_line(entry)}\n" for entry in entries).encode("utf-8", "replace")
        if os.stat(self._path).st_ino != os.fstat(self._fd).st_ino:
            raise OSError("the file was replaced")
        while data:
            data = data[os.write(self._fd, data) :]
        os.fdatasync(self._fd)

    def check(self) -> None:
        """A file has nothing to be asked in between."""

    def close(self) -> None:
        if self._fd >= 0:
            os.close(self._fd)
            self._fd = -1


# The copy of the operator's log by syslog: RFC 5424 messages over TLS (RFC 5425). Blocks; used by one
# thread.

PRIORITY: Final = 13 * 8 + 6  # facility "log audit", severity "informational"
TIMEOUT_S: Final = 5.0
ENDS_WITHIN_S: Final = 0.5
REPEATED: Final = 100  # entries that are sent again over a new connection
BOM: Final = "\ufeff"


def message(entry: Entry, host: str, pid: int) -> bytes:
    """An entry as a message of RFC 5424: the entry as JSON, its kind as MSGID."""
    at = datetime.fromtimestamp(entry.at / 1000, UTC).isoformat(timespec="milliseconds")
    head = f"<{PRIORITY}>1 {at.replace('+00:00', 'Z')} {host} operator-panel {pid} {entry.kind} -"
    return f"{head} {BOM}{as_line(entry)}".encode("utf-8", "replace")


class SyslogSink:
    """A connection to a syslog server. The protocol has no acknowledgement: over a new connection the
    last entries are sent again, and a collector knows them by their numbers."""

    kind: Final = "syslog"

    def __init__(self, host: str, port: int, ca: Path | None) -> None:
        self.name = f"{host}:{port}"
        self._address = (host, port)
        self._ca = ca
        self._host = socket.gethostname() or "-"
        self._socket: ssl.SSLSocket | None = None
        self._sent: deque[Entry] = deque(maxlen=REPEATED)

    def open(self) -> Entry | None:
        """Connects; returns the newest entry that was sent before those that are sent again, None
        without one. OSError, which includes errors of certificates."""
        context = ssl.create_default_context(cafile=str(self._ca) if self._ca else None)
        raw = socket.create_connection(self._address, TIMEOUT_S)
        try:
            self._socket = context.wrap_socket(raw, server_hostname=self._address[0])
        except BaseException:
            raw.close()
            raise
        again = tuple(self._sent)
        self._sent.clear()
        if again:
            self.write(again)
        return again[-1] if again else None

    def write(self, entries: Sequence[Entry]) -> None:
        """Sends entries; OSError."""
        assert self._socket is not None  # it is open
        self.check()
        for entry in entries:
            data = message(entry, self._host, os.getpid())
            self._socket.sendall(f"{len(data)} ".encode() + data)
            self._sent.append(entry)

    def check(self) -> None:
        """OSError if the server has closed the connection. It sends nothing in this protocol."""
        assert self._socket is not None  # it is open
        self._socket.settimeout(0)
        try:
            while self._socket.recv(1024):
                pass
        except (ssl.SSLWantReadError, BlockingIOError):
            return
        finally:
            self._socket.settimeout(TIMEOUT_S)
        raise ConnectionResetError("the syslog server has closed the connection")

    def close(self) -> None:
        if self._socket is not None:
            with suppress(OSError, ValueError):
                self._socket.settimeout(ENDS_WITHIN_S)
                self._socket.unwrap()  # says that nothing was cut off
            with suppress(OSError):
                self._socket.close()
            self._socket = None


# The thread that copies the operator's log to another place: what is on the disk is read and written
# there, in order. The log never waits for it: what the other place does not take now is read later.

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
        with suppress(OSError):  # then more entries are sent again
            write_whole(self._path, json.dumps([seq, digest]).encode(), durable=False)


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
