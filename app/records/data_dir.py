"""The data folder, locked by one server at a time.

The lock is an flock: the system releases it when the process ends, for any reason.
"""

import asyncio
import fcntl
import json
import logging
import os
import shlex
import stat
import sys
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from app.system.errors import FolderInUse
from app.system.texts import Text, say

log = logging.getLogger("kiosk.log")

LOG: Final = "operators-log."  # the beginning of the names of its files
LOCK: Final = "server.lock"
HELD_BY_OTHER_S: Final = 5.0  # a restarted server waits this long for the lock of the old one
RETRY_S: Final = 0.1


class DataDir:
    """A folder for databases, readable by its user only. Call `hold` before anything is written."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._lock = str(path / LOCK)
        self._fd: int | None = None

    def claim(self) -> None:
        """Creates and locks the folder; FolderInUse names the process that has it, OSError if it can't
        be created."""
        if self._fd is not None and self._lock_is_in_place(self._fd):
            return
        self.path.parent.mkdir(parents=True, exist_ok=True)
        self.path.mkdir(mode=0o700, exist_ok=True)
        fd = os.open(self._lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        try:
            fcntl.flock(fd, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise FolderInUse(
                say("disk_folder_in_use", path=str(self.path), by=_read_holder(fd))
            ) from None
        else:
            self.release()
            self._fd, fd = fd, -1
        finally:
            if fd >= 0:
                os.close(fd)
        self._write_holder(self._fd)
        with suppress(OSError):  # such as a file system without modes
            self._make_private()

    def _make_private(self) -> None:
        """Closes the folder to other users, if it is the server's own: it has its log, or nothing."""
        about = os.stat(self.path)
        is_shared = bool(stat.S_IMODE(about.st_mode) & 0o077) and about.st_uid == os.geteuid()
        if not is_shared or about.st_mode & stat.S_ISVTX or self.path == Path.home():
            return
        names = {path.name for path in self.path.iterdir()}
        if names <= {LOCK} or any(name.startswith(LOG) for name in names):
            self.path.chmod(0o700)
            log.info("the data folder %s is now for the server's user only", self.path)

    def check(self) -> None:
        """FolderInUse if the lock file was removed, renamed or replaced: another server may have it."""
        if self._fd is not None and not self._lock_is_in_place(self._fd):
            raise FolderInUse(say("log_file_removed", name=LOCK))

    def _lock_is_in_place(self, fd: int) -> bool:
        try:
            return os.path.samestat(os.fstat(fd), os.stat(self._lock))
        except OSError:
            return False

    async def hold_soon(self) -> None:
        """Like `hold`, but waits up to `HELD_BY_OTHER_S` for another server to end."""
        loop = asyncio.get_running_loop()
        end = loop.time() + HELD_BY_OTHER_S
        while True:
            try:
                return self.claim()
            except FolderInUse:
                if loop.time() > end:
                    raise
            await asyncio.sleep(RETRY_S)

    def release(self) -> None:
        """Releases the lock; the lock file stays."""
        if self._fd is not None:
            os.close(self._fd)
            self._fd = None

    def _write_holder(self, fd: int) -> None:
        since = datetime.now(UTC).isoformat(timespec="seconds")
        about = {"pid": os.getpid(), "since": since, "command": shlex.join(sys.argv)}
        with suppress(OSError):  # the lock holds even on a full disk
            os.ftruncate(fd, 0)
            os.pwrite(fd, json.dumps(about).encode(), 0)


def _read_holder(fd: int) -> Text:
    """The process that has the lock, from the lock file, which may not be written yet."""
    try:
        about = json.loads(os.pread(fd, 4096, 0))
        pid, since, command = str(about["pid"]), str(about["since"]), str(about["command"])
    except (ValueError, KeyError, TypeError):
        return say("disk_used_by_other_process")
    return say("disk_used_by_process", pid=pid, since=since, command=command)
