"""The server's clock, and times and ages as text."""

import time
from datetime import datetime
from functools import lru_cache
from typing import Final

from app.system.texts import Text, date_and_time, say, short_day, time_of_day

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


def format_day(wall: float) -> Text:
    """The day of `wall` (seconds since the epoch) in the server's time zone, as short as it is read."""
    return short_day(time.strftime("%Y-%m-%d", time.localtime(wall)))


def format_datetime(wall: float) -> Text:
    """Date and time of `wall` (seconds since the epoch) in the server's time zone."""
    at = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(wall))
    return date_and_time(f"{at} {offset_if_twice(wall)}".rstrip())


def format_time(wall: float) -> Text:
    """Time of day of `wall` (seconds since the epoch) in the server's time zone, with its offset where
    the clock shows this time twice."""
    return _time(int(wall), time.timezone)


def iso_time(wall: float) -> str:
    """`wall` as ISO 8601 with milliseconds and the offset of the server's time zone."""
    return datetime.fromtimestamp(wall).astimezone().isoformat(timespec="milliseconds")


def offset_text(wall: float) -> str:
    """The offset of the server's time zone from UTC at `wall`: "+02:00"."""
    return datetime.fromtimestamp(int(wall)).astimezone().isoformat()[19:]


def offset_if_twice(wall: float) -> str:
    """The offset from UTC, if the clock shows the time of day of `wall` twice on this day, as at the
    end of summer time; else ""."""
    local = datetime.fromtimestamp(int(wall))
    other = local.replace(fold=1 - local.fold)
    return "" if other.timestamp() == local.timestamp() else offset_text(wall)


@lru_cache(maxsize=1000)
def _time(second: int, _: int) -> Text:
    """What is shown at a time has the same one many times over."""
    at = time.strftime("%H:%M:%S", time.localtime(second))
    return time_of_day(f"{at} {offset_if_twice(second)}".rstrip())
