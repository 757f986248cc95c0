"""A robot without a bridge fails during continuous presses: its router, a node, the cable."""

import statistics
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Final

import pytest

from tests.faults import fixtures
from tests.faults.net import ROBOT_IP, Cable
from tests.faults.results import ms, record
from tests.faults.rig import limit
from tests.faults.rmw_rig import RmwRig
from tests.faults.trial import recorded, try_fault
from tests.faults.watch import Watch
from tests.support.form import LONG, several
from tests.support.parts import Server

pytestmark = [pytest.mark.long("fault"), pytest.mark.promise("dialects")]

cable = fixtures.cable

NOTICED_S: Final = 1.0
KILLED_S: Final = 0.05
CUT_S: Final = 30 if LONG else 5


@pytest.fixture(scope="module")
def rig(domain: int) -> Iterator[RmwRig]:
    mine = RmwRig()
    yield mine
    mine.end()


@pytest.fixture
def server(rig: RmwRig, tmp_path: Path) -> Iterator[Server]:
    with rig.serving(tmp_path) as mine:
        yield mine


@pytest.fixture
def far_rig(domain: int, cable: Cable) -> Iterator[RmwRig]:
    """A robot at the other end of a cable."""
    with cable.robot.inside():
        mine = RmwRig(ROBOT_IP)
    yield mine
    mine.end()


def test_a_killed_router(rig: RmwRig, server: Server) -> None:
    trial = try_fault(rig, server, rig.bridge.kill, rig.bridge.start, locks_within_s=NOTICED_S)
    recorded("rmw_zenoh: router killed and started again", trial)


def test_a_frozen_router(rig: RmwRig, server: Server) -> None:
    trial = try_fault(
        rig,
        server,
        rig.bridge.freeze,
        rig.bridge.thaw,
        locks_within_s=NOTICED_S,
        lasts_s=4.0,
        late_s=5.0,
    )
    assert trial.claimed == 0
    recorded("rmw_zenoh: router frozen for 4 s", trial)


@pytest.mark.long("real time")
def test_a_killed_node_locks_at_once(rig: RmwRig, server: Server) -> None:
    """The median: one that the scheduler held back does not count."""
    watch = Watch(server)
    locked_s = []
    for _ in range(several(5, 20)):
        watch.opened("kept")
        killed_at = time.monotonic()
        rig.robot.kill()
        locked_s.append(watch.locked_after(killed_at, "kept", limit(NOTICED_S), ""))
        rig.robot = rig.another_robot()
    watch.opened("kept")
    watch.end()
    median_s = statistics.median(locked_s)
    assert median_s < limit(KILLED_S), locked_s
    record(
        f"rmw_zenoh: node killed {len(locked_s)} times, another started",
        locked=f"{ms(median_s)} median, {ms(max(locked_s))} at most",
    )


def test_a_cable_between_router_and_panel_that_is_cut(
    cable: Cable, far_rig: RmwRig, tmp_path: Path
) -> None:
    with far_rig.serving(tmp_path) as server:
        trial = try_fault(
            far_rig,
            server,
            cable.cut,
            cable.restore,
            locks_within_s=NOTICED_S,
            lasts_s=CUT_S,
            late_s=3.0,
        )
    assert trial.claimed == 0
    recorded(f"rmw_zenoh: cable between router and panel cut for {CUT_S} s", trial)
