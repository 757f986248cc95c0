"""The server's clock, and times and ages as text."""

import time
from functools import lru_cache
from typing import Final

from app.i18n import Text, date_and_time, say, time_of_day

_START_WALL: Final = time.time()
_START_BOOTTIME: Final = time.clock_gettime(time.CLOCK_BOOTTIME)


def server_now() -> float:
    """Seconds since the epoch: the wall clock at the start of the process plus the boot-time clock
    since then. It never jumps. Heartbeats carry it, and a press returns it."""
    return _START_WALL + time.clock_gettime(time.CLOCK_BOOTTIME) - _START_BOOTTIME


def format_age(seconds: float) -> Text:
    """An age: "4 s", "12 min", "3 h"."""
    if seconds < 60:
        return say("age_seconds", number=int(seconds))
    if seconds < 3600:
        return say("age_minutes", number=int(seconds // 60))
    return say("age_hours", number=int(seconds // 3600))


def age_changes_at(at: float, now: float) -> float:
    """When the text of the age of what happened at `at` changes next; all in monotonic seconds."""
    step = 1 if now - at < 60 else 60
    return at + ((now - at) // step + 1) * step


def format_datetime(wall: float) -> Text:
    """Date and time of `wall` (seconds since the epoch) in the server's time zone."""
    return date_and_time(time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(wall)))


def format_time(wall: float) -> Text:
    """Time of day of `wall` (seconds since the epoch) in the server's time zone."""
    return _time(int(wall), time.timezone)


@lru_cache(maxsize=1000)
def _time(second: int, _: int) -> Text:
    """What is shown at a time has the same one many times over."""
    return time_of_day(time.strftime("%H:%M:%S", time.localtime(second)))
