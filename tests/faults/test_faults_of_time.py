"""The wall clock is set while the server runs: time limits are not affected."""

import time
from datetime import datetime
from pathlib import Path

import pytest

from tests.faults import fixtures
from tests.faults.clock import Clock
from tests.faults.presser import Presser, accounted
from tests.faults.results import ms, record
from tests.faults.rig import MAX_AGE_S, PANEL, Rig, limit
from tests.faults.trial import presses_work
from tests.faults.watch import Watch, answering
from tests.support.parts import Server, until

pytestmark = pytest.mark.long("fault")

rig = fixtures.rig

HOUR_S = 3600
# Longer than any stall of the machine, and shorter than the change of the clock.
PATIENT = PANEL.replace(f"max_age_s = {MAX_AGE_S}", "max_age_s = 600")


def off_s(server: Server) -> float:
    """How far the server's receipts are from the true time."""
    at = datetime.fromisoformat(server.press("free", "time").json()["at"])
    return at.timestamp() - time.time()


def is_off(server: Server, off: int) -> None:
    until(lambda: abs(off_s(server) - off) < 5, "the server's clock is set")


def test_a_clock_that_is_set_back_and_forward(rig: Rig, tmp_path: Path) -> None:
    assert PATIENT != PANEL
    clock = Clock(tmp_path)
    with rig.serving(tmp_path, panel=PATIENT, **clock.environment) as server:
        watch, presser = Watch(server), Presser(server, "paced")
        with answering(server):
            for off in (-HOUR_S, HOUR_S, 0):
                clock.set(off)
                is_off(server, off)
                presses_work(presser)
        presses = presser.end()
        watch.end()
    clock.clean(server.process.pid)
    assert [state for state in watch.states["pulsed"] if "older than" in (state.reason or "")] == []
    account = accounted(presses, lambda: rig.arrivals("paced"), lambda _: True, limit(2.0))
    record(
        "wall clock set an hour back, then forward",
        locked="not by the clock",
        presses=account,
        latest=ms(account.latest_s),
    )


def test_a_node_that_hangs_as_the_clock_is_set_back(rig: Rig, tmp_path: Path) -> None:
    clock = Clock(tmp_path)
    with rig.serving(tmp_path, **clock.environment) as server:
        watch = Watch(server)
        is_off(server, 0)
        rig.robot.freeze()
        hung_at = time.monotonic()
        clock.set(-HOUR_S)
        locked_s = watch.locked_after(
            hung_at, "pulsed", limit(MAX_AGE_S + 1.0), f"older than {MAX_AGE_S} s"
        )
        is_off(server, -HOUR_S)
        rig.robot.thaw()
        watch.opened("pulsed")
        watch.end()
    clock.clean(server.process.pid)
    record(
        "a node hung, and the wall clock set an hour back",
        locked=f"{ms(locked_s)} by the node (max_age_s = {MAX_AGE_S})",
    )
