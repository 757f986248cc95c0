"""The server's clock, and times and ages as text."""

import time
from typing import Final

_START_WALL: Final = time.time()
_START_BOOTTIME: Final = time.clock_gettime(time.CLOCK_BOOTTIME)


def server_now() -> float:
    """Seconds since the epoch: the wall clock at the start of the process plus the boot-time clock
    since then. It never jumps. Heartbeats carry it, and a press returns it."""
    return _START_WALL + time.clock_gettime(time.CLOCK_BOOTTIME) - _START_BOOTTIME


def format_age(seconds: float) -> str:
    """An age as text: "4 s", "12 min", "3 h"."""
    if seconds < 60:
        return f"{int(seconds)} s"
    if seconds < 3600:
        return f"{int(seconds // 60)} min"
    return f"{int(seconds // 3600)} h"


def format_datetime(wall: float) -> str:
    """Date and time of `wall` (seconds since the epoch) in the server's time zone."""
    return time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(wall))


def format_time(wall: float) -> str:
    """Time of day of `wall` (seconds since the epoch) in the server's time zone."""
    return time.strftime("%H:%M:%S", time.localtime(wall))
