"""The data folder, and the lock by which one server at a time has it.

The lock is flock's: the system lets go of it when the process ends, however it ends.
"""

import asyncio
import fcntl
import json
import os
import shlex
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from app.errors import FolderInUse
from app.i18n import say

LOCK: Final = "server.lock"
HELD_BY_OTHER_S: Final = 5.0  # a server that is started again waits so long for the old one's lock
RETRY_S: Final = 0.1


class DataDir:
    """A folder for databases, readable by its user alone; `hold` it before anything is written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = str(path / LOCK)
        self._fd: int | None = None

    def hold(self) -> None:
        """Makes and locks the folder; FolderInUse says who has it, OSError that it can't be made."""
        if self._fd is not None and self._lock_is_in_place(self._fd):
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.mkdir(mode=0o700, exist_ok=True)
        fd = os.open(self._lock, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FolderInUse(f"{self.path} is in use by {_read_holder(fd)}: give each server its own "
                              "KIOSK_DATA, and one worker") from None  # fmt: skip
        else:
            self.release()
            self._fd, fd = fd, -1
        finally:
            if fd >= 0:
                os.close(fd)
        self._write_holder(self._fd)

    def check(self) -> None:
        """FolderInUse where its lock was removed, renamed or replaced: another server may have it."""
        if self._fd is not None and not self._lock_is_in_place(self._fd):
            raise FolderInUse(say("log_taken", name=LOCK))

    def _lock_is_in_place(self, fd: int) -> bool:
        try:
            return os.path.samestat(os.fstat(fd), os.stat(self._lock))
        except OSError:
            return False

    async def hold_soon(self) -> None:
        """The same, but waits a while for another server to end."""
        loop = asyncio.get_running_loop()
        end = loop.time() + HELD_BY_OTHER_S
        while True:
            try:
                return self.hold()
            except FolderInUse:
                if loop.time() > end:
                    raise
            await asyncio.sleep(RETRY_S)

    def release(self) -> None:
        """Lets others have it; the file stays."""
        if self._fd is not None:
            os.close(self._fd)
            self._fd = None

    def _write_holder(self, fd: int) -> None:
        since = datetime.now(UTC).isoformat(timespec="seconds")
        about = {"pid": os.getpid(), "since": since, "command": shlex.join(sys.argv)}
        with suppress(OSError):  # on a full disk it has the lock all the same
            os.ftruncate(fd, 0)
            os.pwrite(fd, json.dumps(about).encode(), 0)


def _read_holder(fd: int) -> str:
    """Who has the lock, as it signed; it may be about to."""
    try:
        about = json.loads(os.pread(fd, 4096, 0))
        return f'process {about["pid"]} since {about["since"]} ("{about["command"]}")'
    except (ValueError, KeyError, TypeError):
        return "another process"
