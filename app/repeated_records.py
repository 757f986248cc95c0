"""Repeated records of a logger are counted in place of being written, so that a client which causes one
again and again does not fill the log."""

import logging
import time
import traceback
from collections.abc import Callable, Hashable
from dataclasses import dataclass
from typing import Final

COUNTED_FOR_S: Final = 60.0
KINDS_MOST: Final = 100
COUNTED: Final = "counted"  # marks the record with the count


@dataclass(slots=True)
class _Kind:
    """Records of a kind: the first was written at `since` (monotonic seconds), `more` were not."""

    since: float
    level: int
    text: str
    more: int = 0


class RepeatedRecords(logging.Filter):
    """Lets the first warning or error of a kind pass, and counts those that follow within
    `COUNTED_FOR_S`. `write_counts` has to be called from time to time."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        super().__init__()
        self._monotonic = monotonic
        self._kinds: dict[Hashable, _Kind] = {}

    def filter(self, record: logging.LogRecord) -> bool:
        if record.levelno < logging.WARNING or getattr(record, COUNTED, False):
            return True
        key, now = kind_of(record), self._monotonic()
        kind = self._kinds.get(key)
        if kind is not None:
            kind.more += 1
            return False
        if len(self._kinds) < KINDS_MOST:
            self._kinds[key] = _Kind(now, record.levelno, record.getMessage().strip())
        return True

    def write_counts(self, log: logging.Logger) -> None:
        """Writes a line for each kind that came more than once in its time."""
        now = self._monotonic()
        for key, kind in list(self._kinds.items()):
            if now - kind.since < COUNTED_FOR_S:
                continue
            del self._kinds[key]
            if kind.more:
                about = {COUNTED: True}
                log.log(kind.level, "%s: %d more in the last minute", kind.text, kind.more, extra=about)


def kind_of(record: logging.LogRecord) -> Hashable:
    """Records are of one kind if their message has the same template and an exception was raised at the
    same place."""
    error = record.exc_info[1] if record.exc_info else None
    if error is None:
        return record.name, record.msg
    frames = traceback.extract_tb(error.__traceback__)
    place = (frames[-1].filename, frames[-1].lineno) if frames else None
    return record.name, record.msg, type(error), place
