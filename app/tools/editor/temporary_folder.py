"""A folder for as long as a process runs, below the system's folder for temporary files."""

import fcntl
import os
import shutil
import time
from contextlib import suppress
from pathlib import Path
from secrets import token_hex
from tempfile import gettempdir
from typing import Final

PREFIX: Final = "operator-panel-editor-"
LOCKED_WITHIN_S: Final = 60.0  # after it was made


class TemporaryFolder:
    """The folder is there from `create` to `remove`, and is locked for that time: the next process
    removes what a killed one has left."""

    def __init__(self) -> None:
        self.path = Path(gettempdir()) / f"{PREFIX}{token_hex(8)}"
        self._lock: int | None = None

    def create(self) -> None:
        """OSError if it can't be made."""
        _remove_left()
        self.path.mkdir(mode=0o700)
        self._lock = _locked(self.path)

    def remove(self) -> None:
        shutil.rmtree(self.path, ignore_errors=True)
        if self._lock is not None:
            os.close(self._lock)
            self._lock = None


def _remove_left() -> None:
    """Removes the folders of this user that no process has locked."""
    for folder in Path(gettempdir()).glob(f"{PREFIX}*"):
        with suppress(OSError):  # of another user, locked, or gone
            about = folder.lstat()
            if about.st_uid != os.geteuid() or time.time() - about.st_mtime < LOCKED_WITHIN_S:
                continue
            lock = _locked(folder)
            try:
                shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(lock)


def _locked(folder: Path) -> int:
    """The descriptor that keeps the lock. OSError if another process has it."""
    descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        os.close(descriptor)
        raise
    return descriptor
