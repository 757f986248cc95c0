"""The folder of recordings: limits its size and finishes files of an earlier process."""

import logging
import time
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from app.recording.mcap_file import SUFFIX, UNFINISHED, recover

log = logging.getLogger("kiosk.recording")


CLOCK_SKEW_S: Final = 60.0  # a file further in the future was written while the clock was wrong


def recording_name(moment: float, robot: str, widget: str) -> str:
    """A file's name without its suffix. Names sort by time. `moment` is in seconds since the epoch."""
    at = datetime.fromtimestamp(moment, UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3] + "Z"
    return "-".join(filter(None, (at, robot, widget)))


class RecordingFolder:
    """The folder of recordings. Its methods raise OSError if it can't be used."""

    def __init__(self, path: Path, max_bytes: int) -> None:
        """`max_bytes` is the limit for finished and unfinished files together."""
        self.path = path
        self._max_bytes = max_bytes

    def open(self) -> None:
        """Creates the folder, and finishes the files that an earlier process left."""
        self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.make_room(0)
        for left in sorted(self.path.glob(f"*{UNFINISHED}")):
            if left.name.endswith(f".recovered{UNFINISHED}"):
                left.unlink()  # recovered again from its source below
        for left in sorted(self.path.glob(f"*{UNFINISHED}")):
            if recovered := recover(self.path, left):
                log.warning("%s was unfinished; its readable part is recovered", recovered)
        self.make_room(0)

    def make_room(self, size: int) -> None:
        """Removes the oldest recordings until `size` more bytes fit. Recordings from the future (the
        clock was set back) count as the oldest."""
        latest = recording_name(time.time() + CLOCK_SKEW_S, "", "")
        files = sorted(self.path.glob(f"*{SUFFIX}"), key=lambda file: (file.name < latest, file.name))
        sizes = [_size(file) for file in files]
        total = sum(sizes)
        for file, bytes_ in zip(files, sizes, strict=True):
            if total + size <= self._max_bytes:
                return
            file.unlink(missing_ok=True)
            total -= bytes_
            log.info("removed %s: recordings take %.0f MB at most", file.name, self._max_bytes / 1e6)


def _size(file: Path) -> int:
    """In bytes; 0 if someone has just removed the file."""
    with suppress(FileNotFoundError):
        return file.stat().st_size
    return 0
