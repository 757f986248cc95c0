"""A publisher that takes a permission back and is gone before the bridge hears it: real DDS."""

import time
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.faults.publishers import KINDS, Kind, Publishers
from tests.support.form import several
from tests.support.parts import Bridge, RosNode, Server, live, until

pytestmark = pytest.mark.promise("press")

TRIALS = several(1, 50)  # of each of two kinds
ONCE = KINDS[0]
AT_ONCE = next(kind for kind in KINDS if not kind.matched and kind.durability == "volatile")
NEW_PUBLISHER = "Locked: a new publisher of /kept has not published yet."
LATCHED = next(kind for kind in KINDS if kind.durability == "transient_local")
CLOSED_BY = several(1, 20)


PANEL = """
title = "Cell"
mode = "live"
interlock = [
  { id = "operation", topic = "/operation_enabled", type = "std_msgs/msg/Bool", max_age_s = 30.0 },
]
[[page]]
id = "one"
title = "One"
[[page.widget]]
id = "go"
kind = "publish"
label = "Go"
topic = "/go"
type = "std_msgs/msg/Bool"
message = { data = true }
interlock = "operation"
[[page.widget]]
id = "seen"
kind = "readout"
label = "Seen"
topic = "/operation_enabled"
type = "std_msgs/msg/Bool"
"""
FROZEN_S = 1.2  # longer than what comes after joining is doubted, shorter than the lease of the link


@pytest.fixture
def publishers(domain: int, tmp_path: Path) -> Iterator[Publishers]:
    mine = Publishers(domain + 3, tmp_path)
    yield mine
    mine.close()


def test_false_of_a_new_publisher_is_never_missed_once_its_token_was_seen(
    publishers: Publishers,
) -> None:
    trials = [publishers.trial("fast", kind) for kind in (ONCE, AT_ONCE) for _ in range(TRIALS)]
    assert [trial for trial in trials if trial.permitted and (trial.announced or trial.received)] == []


def test_silent_publisher_locks_until_a_message_arrives(publishers: Publishers) -> None:
    publishers.open()
    silent = Kind("silent", times=0, matched=False)
    with publishers.running("fast", silent):
        publishers.until_reason(f"{NEW_PUBLISHER} /kept is published by /publisher_")
    publishers.until_reason(NEW_PUBLISHER)
    publishers.open()


def test_a_latched_false_always_closes(domain: int, tmp_path: Path) -> None:
    publishers = Publishers(domain + 3, tmp_path, LATCHED.durability)
    try:
        trials = [publishers.trial("fast", LATCHED) for _ in range(CLOSED_BY)]
    finally:
        publishers.close()
    assert [trial.outcome for trial in trials] == ["heard"] * CLOSED_BY


def test_a_latched_value_that_the_bridge_finds_late_does_not_count_as_fresh(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    """The bridge is frozen while a latched publisher permits; then DDS sends it again, and nothing in
    it says how old it is. What a periodic one says next opens."""
    panel = tmp_path / "panel.toml"
    panel.write_text(PANEL)
    kiosk = servers(live(own_bridge.endpoint, tmp_path, KIOSK_PANEL=str(panel), EXACT_LIVENESS="1"))
    until(kiosk.ready, "joined")
    own_bridge.freeze()
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool", durability="transient_local", depth=1)
    own_node.publish("/operation_enabled", {"data": True})
    permitted_at = time.monotonic()
    until(lambda: time.monotonic() > permitted_at + FROZEN_S, "it is old")
    own_bridge.thaw()
    until(lambda: kiosk.widget("seen")["text"] == "true", "it is sent again")
    until(kiosk.ready, "the bridge answers")
    assert not kiosk.widget("go")["enabled"]
    assert kiosk.widget("go")["reason"] == "Locked: /operation_enabled is not known yet."
    own_node.every("/operation_enabled", {"data": True}, 0.2)
    until(lambda: kiosk.widget("go")["enabled"], "a periodic one is believed")
