"""The link to the robot fails during continuous presses: what is shown, and what arrives."""

import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.faults import fixtures
from tests.faults.net import ROBOT_IP, Cable
from tests.faults.presser import Account, Presser, accounted
from tests.faults.results import ms, record
from tests.faults.rig import Rig, limit
from tests.faults.trial import UNDER_WAY_S, presses_work, recorded, try_fault
from tests.faults.watch import Watch, answering
from tests.support.form import LONG, several
from tests.support.parts import Server, until
from tests.support.rmw import Router, router_file

pytestmark = [pytest.mark.long("fault"), pytest.mark.promise("offline")]

rig = fixtures.rig
server = fixtures.server
cable = fixtures.cable

CUT_OFF = "No connection to the robot"
DELAY_S = 0.3
LOSS = 0.1
NOTICED_S = 1.0
LATE_IMPAIRED_S = 5.0
CUTS_S = (1, 5, 30) if LONG else (1, 5)


@pytest.fixture
def far_rig(domain: int, cable: Cable) -> Iterator[Rig]:
    """A robot at the other end of a cable."""
    with cable.robot.inside():
        mine = Rig(domain + 4, ROBOT_IP)
    yield mine
    mine.end()


def test_a_killed_bridge(rig: Rig, server: Server) -> None:
    trial = try_fault(
        rig, server, rig.bridge.kill, rig.bridge.start, locks_within_s=1.0, because=CUT_OFF
    )
    recorded("bridge killed and started again", trial)


def test_a_frozen_bridge(rig: Rig, server: Server) -> None:
    trial = try_fault(
        rig,
        server,
        rig.bridge.freeze,
        rig.bridge.thaw,
        locks_within_s=NOTICED_S,
        lasts_s=4.0,
        late_s=5.0,
        because=CUT_OFF,
    )
    assert trial.claimed == 0
    recorded("bridge frozen for 4 s", trial)


def test_a_bridge_that_comes_back_on_another_domain(rig: Rig, server: Server) -> None:
    """No node of the robot is reachable: a press is sent without a subscriber, and its receipt says
    so."""
    right = rig.bridge.domain

    def moved(domain: int) -> None:
        rig.bridge.kill()
        rig.bridge.domain = domain
        rig.bridge.start()

    def moved_back() -> None:
        until(server.ready, "the bridge of the other domain is joined")
        until(lambda: "is not known yet" in (server.widget("guarded")["reason"] or ""), "it waits")
        until(
            lambda: server.press("free", "no subscriber").json()["outcome"] == "unknown", "it is sent"
        )
        moved(right)

    trial = try_fault(rig, server, lambda: moved(right + 1), moved_back, locks_within_s=1.5)
    recorded("bridge restarted on another domain, and back", trial)


def test_a_router_between_is_killed(rig: Rig, tmp_path: Path) -> None:
    router = Router()
    router.configure(router_file(tmp_path, "between", router.endpoint, [rig.endpoint]))
    router.start()
    try:
        with rig.serving(tmp_path, router.endpoint) as server:
            trial = try_fault(
                rig, server, router.kill, router.start, locks_within_s=1.0, because=CUT_OFF
            )
    finally:
        router.end()
    recorded("Zenoh router between killed and started again", trial)


def test_a_cable_that_is_cut(cable: Cable, far_rig: Rig, tmp_path: Path) -> None:
    """Cuts shorter and longer than the lease after which the link counts as lost."""
    with far_rig.serving(tmp_path) as server:
        for seconds in CUTS_S:
            if seconds < 2:
                short_cut(cable, far_rig, server, seconds)
                continue
            trial = try_fault(
                far_rig,
                server,
                cable.cut,
                cable.restore,
                locks_within_s=NOTICED_S,
                lasts_s=seconds,
                late_s=3.0,
                because=CUT_OFF,
            )
            assert trial.claimed == 0
            recorded(f"cable cut for {seconds} s", trial)


def short_cut(cable: Cable, rig: Rig, server: Server, seconds: float) -> None:
    """The pulse and the bridge's responses are missing at once; the connection survives."""
    trial = try_fault(
        rig,
        server,
        cable.cut,
        cable.restore,
        locks_within_s=1.0,
        lasts_s=seconds,
        late_s=3.0,
        interlock="pulsed",
        widget="paced",
        because="older than 0.5 s|does not respond",
    )
    assert trial.claimed == 0
    recorded(f"cable cut for {seconds} s (interlock with max_age_s = 0.5)", trial)


def test_a_slow_and_lossy_network(cable: Cable, far_rig: Rig, tmp_path: Path) -> None:
    """300 ms each way and every tenth frame lost: everything works, delayed by TCP."""
    with far_rig.serving(tmp_path) as server:
        account, locked = impaired(cable, far_rig, server, several(5, 30))
    record(
        "300 ms delay each way, 10 % of the frames lost",
        locked=f"{locked} times, as pulses came late",
        presses=account,
        latest=ms(account.latest_s),
    )


def impaired(cable: Cable, rig: Rig, server: Server, seconds: float) -> tuple[Account, int]:
    """The account of presses on a bad network, and how often the interlock with a pulse was locked."""
    watch, presser = Watch(server), Presser(server, "guarded")
    with answering(server):
        presses_work(presser)
        began = time.monotonic()
        cable.impair(delay_s=DELAY_S, loss=LOSS)
        until(lambda: time.monotonic() > began + seconds, "the weather lasts", seconds + 1)
        cable.impair()
        watch.opened("kept")
        watch.opened("pulsed")
        cleared_at = time.monotonic()
        presses_work(presser)
    presses = presser.end()
    watch.end()
    held = not any(not state.enabled for state in watch.states["kept"] if state.at > began)
    account = accounted(
        presses,
        lambda: rig.arrivals("guarded"),
        lambda press: held or press.answered_at < began - UNDER_WAY_S or press.at > cleared_at,
        limit(LATE_IMPAIRED_S),
    )
    return account, sum(not state.enabled for state in watch.states["pulsed"] if state.at > began)
