"""The copy of the operator's log in a file, such as on another disk. Blocks; used by one thread."""

import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.audit.copied import ROTATED, as_line, parse_line
from app.audit.entry import Entry

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
