"""Kills a server repeatedly at random moments during presses.

What the robot received must still match the receipts that were sent.
"""

import random
import signal
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from tests.faults.presser import Press, Presser
from tests.faults.rig import until_permitted
from tests.support.parts import Server

LIVES_AT_MOST_S = 0.8
PRESSED_EVERY_S = 0.01


@dataclass(frozen=True, slots=True)
class Life:
    """One run of a server, from its first press to its kill (monotonic seconds), with its presses."""

    began_at: float
    killed_at: float
    presses: list[Press]

    def whole(self, press: Press, under_way_s: float) -> bool:
        """Whether the response came at least `under_way_s` before the kill, so that nothing was in
        flight."""
        return 0.0 < press.answered_at < self.killed_at - under_way_s


def kill_at_random_moments(
    start: Callable[[], Server], times: int, widget: str, chance: random.Random
) -> Iterator[Life]:
    """Starts a server, presses its widget, kills it in the middle of that; yields each run."""
    for _ in range(times):
        server = start()
        try:
            until_permitted(server)
            began_at = time.monotonic()
            presser = Presser(server, widget, PRESSED_EVERY_S)
            presser.wait_for()
            moment = time.monotonic() + chance.uniform(0, LIVES_AT_MOST_S)
            while time.monotonic() < moment:
                time.sleep(0.0005)
        finally:
            killed_at = time.monotonic()
            server.end(signal.SIGKILL)
        yield Life(began_at, killed_at, presser.end())
