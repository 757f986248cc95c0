"""When shifts begin and end, by the server's clock. Pure functions."""

from collections.abc import Sequence
from datetime import datetime, timedelta
from typing import NamedTuple


class Shift(NamedTuple):
    """From when to when it is, in seconds since the epoch."""

    since: float
    until: float


def shift_at(now: float, starts: Sequence[str], back: int = 0) -> Shift:
    """The shift at a time (seconds since the epoch), or that so many before it. `starts` are times of
    day, "06:00", at which shifts begin."""
    today = datetime.fromtimestamp(now).date()
    days = range(-2 - back, 3)
    begins = sorted(
        datetime.fromisoformat(f"{today + timedelta(days=day)}T{start}").timestamp()
        for day in days
        for start in starts
    )
    current = max(n for n, begin in enumerate(begins) if begin <= now)
    return Shift(begins[current - back], begins[current - back + 1])
