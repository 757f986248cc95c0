"""Round trips from browsers to the server, which the scripts of the page of diagnostics measure and
send."""

from collections import OrderedDict
from typing import Final

from app.robot.round_trips import RoundTrips, RoundTripSummary

MOST_BROWSERS: Final = 20  # the one that has sent nothing for longest goes


class PageTrips:
    """The round trips of each browser over the last minutes. Used on the event loop only."""

    def __init__(self) -> None:
        self._browsers: OrderedDict[str, RoundTrips] = OrderedDict()

    def record(self, browser: str, took_s: float, now: float) -> None:
        """A browser has measured a round trip, at `now` (monotonic seconds)."""
        self._browsers.setdefault(browser, RoundTrips()).record(took_s, now)
        self._browsers.move_to_end(browser)
        if len(self._browsers) > MOST_BROWSERS:
            self._browsers.popitem(last=False)

    def summary(self, browser: str, now: float) -> RoundTripSummary | None:
        """Those of a browser in the last five minutes; None without one."""
        trips = self._browsers.get(browser)
        return trips.summary(now) if trips else None
