"""The folder of recordings: bounded, and without halves of an earlier start."""

import logging
import time
from datetime import UTC, datetime
from pathlib import Path
from typing import Final

from app.recording.mcap_file import SUFFIX, UNFINISHED, recover

log = logging.getLogger("kiosk.recording")


CLOCK_SKEW_S: Final = 60.0  # a file from later than that was written while the clock was wrong


def recording_name(moment: float, robot: str, widget: str) -> str:
    """A file's name without its ending, sorted by time; `moment` is in seconds since the epoch."""
    at = datetime.fromtimestamp(moment, UTC).strftime("%Y%m%dT%H%M%S.%f")[:-3] + "Z"
    return "-".join(filter(None, (at, robot, widget)))


class RecordingDirectory:
    """OSError where it can't be used."""

    def __init__(self, path: Path, most: int) -> None:
        """`most` is in bytes, for all that is finished and all that is being written."""
        self.path = path
        self._max_bytes = most

    def open(self) -> None:
        """Makes it, and finishes what an earlier process left unfinished."""
        self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
        self.make_room(0)
        for left in sorted(self.path.glob(f"*{UNFINISHED}")):
            if left.name.endswith(f".recovered{UNFINISHED}"):
                left.unlink()  # made again from what it was made of
        for left in sorted(self.path.glob(f"*{UNFINISHED}")):
            if found := recover(self.path, left):
                log.warning("%s was left unfinished and is recovered as far as it goes", found)
        self.make_room(0)

    def make_room(self, size: int) -> None:
        """Removes the oldest recordings until `size` more bytes fit in. Where the clock was set back,
        those from the future are taken for the oldest, and what is new stays."""
        latest = recording_name(time.time() + CLOCK_SKEW_S, "", "")
        files = sorted(self.path.glob(f"*{SUFFIX}"), key=lambda file: (file.name < latest, file.name))
        sizes = [file.stat().st_size for file in files]
        total = sum(sizes)
        for file, bytes_ in zip(files, sizes, strict=True):
            if total + size <= self._max_bytes:
                return
            file.unlink(missing_ok=True)
            total -= bytes_
            log.info("removed %s: recordings take %.0f MB at most", file.name, self._max_bytes / 1e6)
