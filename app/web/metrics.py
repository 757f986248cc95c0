"""Counters since the start. app/web/prometheus.py exports them."""

import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass

from app.runtime.fleet import Fleet


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
    ) -> None:
        """Reports the links and topics of the fleet's robots. `left_out` is how many refusals the
        operator's log only counts, `limited` how many presses, holds and cancels were more than their
        limit, `uncopied` how many of its entries each copy of it lacks."""
        self.fleet = fleet
        self.left_out = left_out
        self.limited = limited
        self.uncopied = uncopied
        self.presses: dict[str, Count] = {}  # by outcome
        self.streams = Open()

    def pressed(self, outcome: str) -> None:
        """The outcome of a press or a hold."""
        self.presses.setdefault(outcome, Count(time.time())).value += 1
