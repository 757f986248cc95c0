"""The recordings of a folder that cover a time: found by their names, read by their summaries. A file
that can't be read is left out."""

import math
import re
from contextlib import suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, NamedTuple

from mcap.reader import make_reader

from app.cell.history.recording import STOP_AFTER_S, STOP_BEFORE_S, SUFFIX, UNFINISHED

NAME: Final = r"[0-9]{8}T[0-9]{6}\.[0-9]{3}Z(?:-[A-Za-z0-9_-]{1,200})?(?:\.recovered)?"
LONGEST_BEFORE_S: Final = 600.0  # a file begins so long before the time in its name, at most
MOST_READ: Final = 20  # files whose summaries are read


class KeptRecording(NamedTuple):
    """A finished file, with the time of its press or stop, the times of its first and its last message
    (seconds since the epoch) and its size in bytes."""

    name: str
    begun: float
    since: float
    until: float
    size: int

    @property
    def path(self) -> str:
        """On the panel's server."""
        return f"/recordings/{self.name}"


def recordings_of(folder: Path, robot: str, since: float, until: float) -> list[KeptRecording]:
    """The recordings of a robot ("" for the only one) that have messages between two times, those first
    whose press or stop is nearest to the later one; none without a folder."""
    candidates: list[tuple[float, float, Path]] = []
    with suppress(OSError):
        for file in folder.glob(f"*{SUFFIX}"):
            begun = _begun(file, robot)
            if begun is not None and begun - LONGEST_BEFORE_S <= until:
                candidates.append((abs(begun - until), begun, file))
    candidates.sort()
    kept = [_read(file, begun, since) for _, begun, file in candidates[:MOST_READ]]
    return [each for each in kept if each and each.since <= until and each.until >= since]


def recording_of(folder: Path, robot: str, stop: float) -> KeptRecording | None:
    """That of a stop at a time: of those that go on until then, or that the stop began, the one with
    the most of what was before. After a lost link there is nothing more to record."""
    kept = recordings_of(folder, robot, stop - STOP_BEFORE_S, stop)
    own = (each for each in kept if each.until >= stop or abs(each.begun - stop) <= STOP_AFTER_S)
    return min(own, key=lambda each: each.since, default=None)


def has_unfinished(folder: Path, robot: str) -> bool:
    """Whether a recording of a robot is being written."""
    with suppress(OSError):
        return any(_is_of(file, robot) for file in folder.glob(f"*{UNFINISHED}"))
    return False


def _is_of(file: Path, robot: str) -> bool:
    name = file.name.split(".mcap")[0]
    rest = name.partition("-")[2]
    return re.fullmatch(NAME, name) is not None and (
        not robot or rest == robot or rest.startswith(f"{robot}-")
    )


def _begun(file: Path, robot: str) -> float | None:
    """The time in the name of a robot's file, in seconds since the epoch; None for another file."""
    if not _is_of(file, robot):
        return None
    with suppress(ValueError):
        begun = datetime.strptime(file.name[:19], "%Y%m%dT%H%M%S.%f")
        return begun.replace(tzinfo=UTC).timestamp()
    return None


def _read(file: Path, begun: float, since: float) -> KeptRecording | None:
    """None for a file without messages or from before a time, and for one that can't be read, whatever
    is in it."""
    with suppress(Exception):
        if file.is_symlink() or file.stat().st_mtime < since:
            return None
        with file.open("rb") as stream:
            summary = make_reader(stream).get_summary()
        about = summary.statistics if summary else None
        if about is not None and about.message_count:
            times = about.message_start_time / 1e9, about.message_end_time / 1e9
            if all(map(math.isfinite, times)):
                return KeptRecording(file.name, begun, *times, file.stat().st_size)
    return None
