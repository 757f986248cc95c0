"""Round trips to a robot's peer over the last minutes, in memory of a fixed size."""

from collections import deque
from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median
from typing import Final

EVERY_S: Final = 5.0  # a column
KEPT: Final = 60  # columns: five minutes
MOST_IN_COLUMN: Final = 100


@dataclass(frozen=True, slots=True)
class RoundTripSummary:
    """Seconds, over the last minutes; `medians` are those of each `EVERY_S`, the oldest first."""

    least: float
    median: float
    most: float
    last: float
    medians: Sequence[float]


class RoundTrips:
    """The round trips of one robot. Used on the event loop only."""

    def __init__(self) -> None:
        self._columns: deque[tuple[float, list[float]]] = deque(maxlen=KEPT)  # when it began, its times

    def record(self, took_s: float, now: float) -> None:
        """A reply arrived at `now` (monotonic seconds), `took_s` after its query."""
        if not self._columns or now - self._columns[-1][0] >= EVERY_S:
            self._columns.append((now, []))
        times = self._columns[-1][1]
        if len(times) < MOST_IN_COLUMN:
            times.append(took_s)

    def summary(self, now: float) -> RoundTripSummary | None:
        """That of the last five minutes; None without a reply in them."""
        columns = [times for began, times in self._columns if now - began <= KEPT * EVERY_S]
        every = [took for times in columns for took in times]
        if not every:
            return None
        return RoundTripSummary(
            min(every), median(every), max(every), every[-1], [median(times) for times in columns]
        )
