"""`python -m tests.faults.soak`: a soak test of `SOAK_S` seconds (default 3,600).

The robot toggles a permission every second and publishes a value twenty times a second; a client
presses ten times a second; another watches the events. Prints the measurements, and fails if an event
was lost or a press was received twice.
"""

import os
import statistics
import tempfile
import time
from pathlib import Path
from typing import Final

from tests.faults.presser import Account, Presser, accounted
from tests.faults.rig import TEXT, Rig
from tests.faults.watch import Resources, Watch, answering, resources
from tests.support.parts import Server

DOMAIN: Final = 99
LOST_S: Final = 10.0  # a change that is not shown within this time is lost
WARM_S: Final = 30.0
LOOKED_EVERY_S: Final = 5.0


class Soak:
    """One run; `looks` are (seconds since its beginning, resources)."""

    def __init__(self, rig: Rig, server: Server, for_s: float) -> None:
        self._rig = rig
        self._server = server
        self._for_s = for_s
        self.looks: list[tuple[float, Resources]] = []
        self.changes = 0
        self.lost = 0
        self.shown_after_s: list[float] = []

    def run(self) -> Account:
        self._rig.robot.advertise("/heard", TEXT)
        watch, presser = Watch(self._server), Presser(self._server, "free", 0.1)
        began = time.monotonic()
        with answering(self._server):
            while (since := time.monotonic() - began) < self._for_s:
                if since >= len(self.looks) * LOOKED_EVERY_S:
                    self.looks.append((since, resources(self._server.process.pid)))
                self._change(watch)
        presses = presser.end()
        watch.end()
        return accounted(presses, lambda: self._rig.arrivals("free"), lambda _: True, 1.0)

    def _change(self, watch: Watch) -> None:
        """Toggles the permission and waits until that is shown; then publishes values for a second."""
        wanted = self.changes % 2 == 1
        self.changes += 1
        published_at = time.monotonic()
        self._rig.robot.publish("/kept", {"data": wanted})
        while watch.now("kept").enabled != wanted:
            if time.monotonic() > published_at + LOST_S:
                self.lost += 1
                break
            time.sleep(0.002)
        self.shown_after_s.append(time.monotonic() - published_at)
        self._rig.robot.flood("/heard", {"data": f"{self.changes}.{{n}}"}, 20.0, 1.0)

    def slope(self) -> float | None:
        """Memory growth in MB per hour after the warm-up; None if the run was too short."""
        warm = [(at, look.rss_mb) for at, look in self.looks if at >= WARM_S]
        if len(warm) < 3:
            return None
        times, sizes = zip(*warm, strict=True)
        return statistics.linear_regression(times, sizes).slope * 3600

    def __str__(self) -> str:
        first, last = self.looks[0][1], self.looks[-1][1]
        slope = self.slope()
        grown = "too short to tell" if slope is None else f"{slope:+.1f} MB an hour, once warm"
        lines = (
            f"memory: {first.rss_mb:.0f} MB, then {last.rss_mb:.0f} MB; {grown}",
            f"threads: {first.threads}, then {last.threads}",
            f"open files: {first.files}, then {last.files}",
            f"changes of the interlock: {self.changes}, of them lost: {self.lost}; shown after "
            f"{statistics.median(self.shown_after_s) * 1000:.0f} ms (median), "
            f"{max(self.shown_after_s) * 1000:.0f} ms at most",
        )
        return "\n".join(lines)


def main() -> None:
    for_s = float(os.environ.get("SOAK_S") or 3600)
    rig = Rig(DOMAIN)
    try:
        with tempfile.TemporaryDirectory() as folder, rig.serving(Path(folder)) as server:
            soak = Soak(rig, server, for_s)
            account = soak.run()
    finally:
        rig.end()
    print(f"{for_s:g} s\npresses: {account}; twice: 0; latest {account.latest_s * 1000:.0f} ms\n{soak}")
    assert not soak.lost, "an event was lost"


if __name__ == "__main__":
    main()
