"""The server's own time, and times and ages as an operator reads them."""

import time
from typing import Final

_START_WALL: Final = time.time()
_START_BOOTTIME: Final = time.clock_gettime(time.CLOCK_BOOTTIME)


def server_now() -> float:
    """Seconds since the epoch: the wall clock at the process's start, and even from there, also while
    the machine sleeps. Heartbeats carry it, and a press returns it."""
    return _START_WALL + time.clock_gettime(time.CLOCK_BOOTTIME) - _START_BOOTTIME


def format_age(seconds: float) -> str:
    """An age as an operator says it: "4 s", "12 min", "3 h"."""
    if seconds < 60:
        return f"{int(seconds)} s"
    if seconds < 3600:
        return f"{int(seconds // 60)} min"
    return f"{int(seconds // 3600)} h"


def format_datetime(wall: float) -> str:
    """Date and time in the server's zone, of seconds since the epoch."""
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(wall))


def format_time(wall: float) -> str:
    """The time of day in the server's zone, of seconds since the epoch."""
    return time.strftime("%H:%M:%S", time.localtime(wall))
