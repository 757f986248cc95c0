"""The wall clock is set under the running server: nothing that is judged by time notices."""

import time
from datetime import datetime
from pathlib import Path

import pytest

from tests.faults import fixtures
from tests.faults.clock import Clock
from tests.faults.presser import Presser, accounted
from tests.faults.results import ms, record
from tests.faults.rig import MAX_AGE_S, Rig
from tests.faults.trial import well
from tests.faults.watch import Watch, answering
from tests.support.parts import Server, until

pytestmark = pytest.mark.real_time

rig = fixtures.rig

HOUR_S = 3600
TRIES = 5


def off_s(server: Server) -> float:
    """How far the server's receipts are from the true time."""
    at = datetime.fromisoformat(server.press("free", "what time is it?").json()["at"])
    return at.timestamp() - time.time()


def is_off(server: Server, off: int) -> None:
    until(lambda: abs(off_s(server) - off) < 5, "the server's clock is set")


def test_a_clock_that_is_set_back_and_forward(rig: Rig, tmp_path: Path) -> None:
    clock = Clock(tmp_path)
    with rig.serving(tmp_path, **clock.environment) as server:
        watch, presser = Watch(server), Presser(server, "paced")
        with answering(server):
            for _ in range(TRIES):
                began = time.monotonic()
                for off in (0, -HOUR_S, HOUR_S, 0):
                    clock.set(off)
                    is_off(server, off)
                    well(presser)
                locks = [s for s in watch.seen["pulsed"] if s.at > began and not s.enabled]
                if not locks:
                    break  # else the machine stood still; a clock would lock each time
                watch.opened("pulsed")
            assert not locks
            rig.robot.freeze()
            hung_at = time.monotonic()
            clock.set(-HOUR_S)
            locked_s, reason = watch.locked_after(hung_at, "pulsed", MAX_AGE_S + 1.0)
            assert "older than 0.5 s" in reason
            rig.robot.thaw()
            watch.opened("pulsed")
        presses = presser.end()
        watch.end()
    clock.clean(server.process.pid)
    account = accounted(presses, lambda: rig.arrivals("paced"), lambda _: True, 2.0)
    record(
        "wall clock set an hour back, then forward; a node hung after it",
        locked=f"not by the clock; {ms(locked_s)} by the node (max_age_s = 0.5)",
        presses=account,
        latest=ms(account.latest_s),
    )
