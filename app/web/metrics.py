"""Counters since the start, and round trips from browsers to the server. `app/web/prometheus.py`
exports the counters."""

import math
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

from app.cell.robot.traffic import RoundTrips, RoundTripSummary
from app.cell.session.fleet import Fleet
from app.system.limits import BoundedDict

if TYPE_CHECKING:
    from app.cell.site.wall import Wall
    from app.cell.stops.oee import ShiftFigures


@dataclass(slots=True)
class Count:
    """How often, and since when, in seconds since the epoch."""

    since: float
    value: int = 0


class Open:
    """How many of a thing are open."""

    def __init__(self) -> None:
        self.count = 0

    @contextmanager
    def another(self) -> Iterator[None]:
        self.count += 1
        try:
            yield
        finally:
            self.count -= 1


class Metrics:
    """Counts of one application since its start."""

    def __init__(
        self,
        fleet: Fleet | None = None,
        left_out: Callable[[], int] = lambda: 0,
        limited: Callable[[], int] = lambda: 0,
        uncopied: Callable[[], Mapping[str, int]] = dict,
        wall: "Wall | None" = None,
    ) -> None:
        """Reports the links and topics of the fleet's robots, or the cells of a wall. `left_out` is how
        many refusals the operator's log only counts, `limited` how many presses, holds and cancels were
        more than their limit, `uncopied` how many of its entries each copy of it lacks."""
        self.fleet = fleet
        self.left_out = left_out
        self.limited = limited
        self.uncopied = uncopied
        self.wall = wall
        self.presses: dict[str, Count] = {}  # by outcome
        self.streams = Open()
        self.shift: dict[str, ShiftFigures] = {}  # by the robot's id; read when they are asked for
        self.shift_at = -math.inf  # when, in seconds since the epoch

    def pressed(self, outcome: str) -> None:
        """The outcome of a press or a hold."""
        self.presses.setdefault(outcome, Count(time.time())).value += 1


# Round trips from browsers to the server, which the scripts of the page of diagnostics measure and
# send.

MOST_BROWSERS: Final = 20  # the one that has sent nothing for longest goes


class PageTrips:
    """The round trips of each browser over the last minutes. Used on the event loop only."""

    def __init__(self) -> None:
        self._browsers = BoundedDict[str, RoundTrips](MOST_BROWSERS)

    def record(self, browser: str, took_s: float, now: float) -> None:
        """A browser has measured a round trip, at `now` (monotonic seconds)."""
        trips = self._browsers[browser] = self._browsers.get(browser) or RoundTrips()
        trips.record(took_s, now)

    def summary(self, browser: str, now: float) -> RoundTripSummary | None:
        """Those of a browser in the last five minutes; None without one."""
        trips = self._browsers.get(browser)
        return trips.summary(now) if trips else None
