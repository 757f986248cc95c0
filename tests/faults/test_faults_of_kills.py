"""The server is killed during presses: nothing is sent twice, late, or after a refusal."""

import random
import secrets
from pathlib import Path

import pytest

from tests.faults import fixtures
from tests.faults.kills import Life, kill_at_random_moments
from tests.faults.presser import accounted
from tests.faults.results import ms, record
from tests.faults.rig import Rig, kiosk, limit
from tests.faults.trial import UNDER_WAY_S
from tests.support.form import several
from tests.support.parts import free_port

pytestmark = [pytest.mark.long("fault"), pytest.mark.promise("receipt")]

rig = fixtures.rig

KILLS = several(3, 200)
LIFE_AT_MOST_S = 10.0
LATE_S = 1.0


@pytest.mark.timeout(300 + KILLS * LIFE_AT_MOST_S)
def test_a_server_killed_at_random_moments(rig: Rig, tmp_path: Path) -> None:
    seed = secrets.randbits(32)
    port = free_port()
    lives: list[Life] = list(
        kill_at_random_moments(
            lambda: kiosk(rig.endpoint, tmp_path, port), KILLS, "guarded", random.Random(seed)
        )
    )
    life_of = {press.text: life for life in lives for press in life.presses}
    presses = [press for life in lives for press in life.presses]
    account = accounted(
        presses,
        lambda: rig.arrivals("guarded"),
        lambda press: life_of[press.text].whole(press, UNDER_WAY_S),
        limit(LATE_S),
    )
    assert account.received, f"seed {seed}"
    unanswered = sum(not press.outcome for press in presses)
    record(
        f"server killed {KILLS} times at random moments",
        presses=f"{account}, {unanswered} without an answer",
        latest=ms(account.latest_s),
    )
