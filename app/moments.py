"""The server's own time: it goes on evenly, whatever is done to the wall clock, and while the machine
sleeps. Heartbeats carry it, and a press says in it when it was pressed."""

import time
from typing import Final

_WALL: Final = time.time()
_BEGAN: Final = time.clock_gettime(time.CLOCK_BOOTTIME)


def now() -> float:
    """Seconds since the epoch, as the wall clock said when the process began."""
    return _WALL + time.clock_gettime(time.CLOCK_BOOTTIME) - _BEGAN
