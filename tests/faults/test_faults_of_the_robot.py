"""The robot's nodes fail, send invalid data or flood topics during continuous presses."""

import json
import random
import secrets
import time
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import pytest
import zenoh

from tests.faults import fixtures
from tests.faults.presser import Account, Presser, accounted
from tests.faults.results import ms, record
from tests.faults.rig import BOOL, LISTENED_TO, MAX_AGE_S, TEXT, Rig, limit, permitting
from tests.faults.trial import presses_work, recorded, try_fault
from tests.faults.watch import Resources, Watch, answering, resources, until_released
from tests.support.form import several
from tests.support.parts import ENOUGH_S, RosNode, Server, until

pytestmark = [pytest.mark.long("fault"), pytest.mark.promise("locks")]

rig = fixtures.rig
server = fixtures.server

RESTARTS = several(3, 100)
RESTART_AT_MOST_S = 20.0
FLOOD_S = several(2, 30)
FLOOD_PER_S = 2000.0
LONG_MESSAGES = several(6, 60)
LONG_MESSAGE = 10_000_000
GARBAGE = several(3_000, 100_000)
SHOWN_WITHIN_S = 1.0
MARGIN_MB = 40.0


def replace_robot(rig: Rig) -> None:
    """Starts a node with another name: the graph shows the old one for some more seconds."""
    rig.robot.end()
    rig.robot = RosNode(rig.bridge.domain, f"robot_{secrets.token_hex(2)}")
    permitting(rig.robot)


def test_a_killed_node(rig: Rig, server: Server) -> None:
    trial = try_fault(
        rig,
        server,
        rig.robot.kill,
        lambda: replace_robot(rig),
        locks_within_s=MAX_AGE_S + 0.5,
        interlock="pulsed",
        widget="paced",
        because="older than 0.5 s",
    )
    recorded("node killed (max_age_s = 0.5), another started", trial)


def test_a_hung_node(rig: Rig, server: Server) -> None:
    trial = try_fault(
        rig,
        server,
        rig.robot.freeze,
        rig.robot.thaw,
        locks_within_s=MAX_AGE_S + 0.5,
        lasts_s=2.0,
        interlock="pulsed",
        widget="paced",
        because="older than 0.5 s",
    )
    recorded("node hung for 2 s (max_age_s = 0.5)", trial)


def test_publisher_replaced_by_another_type_locks(rig: Rig, server: Server) -> None:
    def replaced() -> None:
        rig.robot.withdraw("/pulsed")
        rig.robot.advertise("/pulsed", TEXT)
        rig.robot.every("/pulsed", {"data": "true"}, 0.1)

    def right_again() -> None:
        until(
            lambda: "std_msgs/msg/String" in (server.widget("paced")["reason"] or ""),
            "the wrong type is shown",
        )
        rig.robot.withdraw("/pulsed")
        rig.robot.advertise("/pulsed", BOOL)
        rig.robot.every("/pulsed", {"data": True}, 0.1)

    trial = try_fault(
        rig, server, replaced, right_again, locks_within_s=1.0, interlock="pulsed", widget="paced"
    )
    recorded("publisher replaced by one of another type, and back", trial)


@pytest.mark.timeout(300 + RESTARTS * RESTART_AT_MOST_S)
def test_a_robot_that_restarts_again_and_again(rig: Rig, server: Server) -> None:
    """Bridge and node are killed together; nothing accumulates over the restarts."""
    before: Resources | None = None
    latest = longest = 0.0
    for life in range(RESTARTS):

        def off() -> None:
            rig.bridge.kill()
            rig.robot.kill()

        def on() -> None:
            rig.bridge.start()
            replace_robot(rig)

        trial = try_fault(rig, server, off, on, locks_within_s=1.0)
        latest, longest = max(latest, trial.account.latest_s), max(longest, trial.locked_s)
        if life == 1:  # memory grows to its usual size until then
            before = resources(server.process.pid)
    assert before is not None
    after = until_released(server.process.pid, before, MARGIN_MB)
    record(
        f"robot (bridge and node) killed and started {RESTARTS} times",
        locked=f"{ms(longest)} at most",
        presses="none twice, none though refused",
        latest=ms(latest),
        after=grown(before, after),
    )


def grown(before: Resources, after: Resources) -> str:
    return f"{after.rss_mb - before.rss_mb:+.0f} MB, no more threads, no more files"


@contextmanager
def shouting(domain: int) -> Iterator[RosNode]:
    node = RosNode(domain, "shouter")
    try:
        yield node
    finally:
        node.end()


def flooded(
    rig: Rig, server: Server, topic: str, node: RosNode, fields: dict[str, Any]
) -> tuple[Account, int, Watch]:
    """The account of presses during a flood of `FLOOD_PER_S` messages, and the number of messages."""
    until(lambda: node.subscribers(topic), "the bridge listens")
    watch = Watch(server)
    before = resources(server.process.pid)
    presser = Presser(server, "guarded")
    with answering(server), ThreadPoolExecutor(1) as pool:
        presses_work(presser)
        said = pool.submit(node.flood, topic, fields, FLOOD_PER_S, FLOOD_S)
        until(said.done, "the flood ends", FLOOD_S + ENOUGH_S)
        presses_work(presser)
    presses = presser.end()
    account = accounted(presses, lambda: rig.arrivals("guarded"), lambda _: True, limit(2.0))
    until_released(server.process.pid, before, MARGIN_MB)
    return account, said.result(), watch


def test_a_flood_on_an_interlock(rig: Rig, server: Server) -> None:
    """The last message counts, and is shown soon."""
    account, said, watch = flooded(rig, server, "/kept", rig.robot, {"data": True})
    until(lambda: watch.now("kept").enabled, "still permitted")
    published_at = time.monotonic()
    rig.robot.publish("/kept", {"data": False})
    locked_s = watch.locked_after(published_at, "kept", limit(SHOWN_WITHIN_S), "does not permit")
    rig.robot.publish("/kept", {"data": True})
    watch.opened("kept")
    watch.end()
    record(
        f"{said} messages on an interlock's topic",
        locked=f"{ms(locked_s)} after the false that ended it",
        presses=account,
        latest=ms(account.latest_s),
    )


def test_a_flood_on_a_readout(rig: Rig, server: Server) -> None:
    with shouting(rig.bridge.domain) as shouter:
        shouter.advertise("/heard", TEXT)
        account, said, watch = flooded(rig, server, "/heard", shouter, {"data": "loud"})
        last = secrets.token_hex(8)
        shouter.publish("/heard", {"data": last})
        until(
            lambda: watch.widgets["heard"]["text"] == last,
            "the last one is shown",
            limit(SHOWN_WITHIN_S),
        )
        watch.end()
        shouter.withdraw("/heard")
    record(f"{said} messages on a readout's topic", presses=account, latest=ms(account.latest_s))


@pytest.mark.long("real time")
def test_messages_of_ten_megabytes(rig: Rig, server: Server) -> None:
    rig.robot.advertise("/heard", TEXT)
    until(lambda: rig.robot.subscribers("/heard"), "the bridge listens")
    before = resources(server.process.pid)
    watch, presser = Watch(server), Presser(server, "guarded")
    began = time.monotonic()
    with answering(server):
        presses_work(presser)
        for _ in range(LONG_MESSAGES):
            rig.robot.publish_long("/heard", LONG_MESSAGE)
        until(lambda: watch.widgets["heard"]["text"].startswith("xxx"), "it is shown, cut")
        assert len(watch.widgets["heard"]["text"]) <= 200
        presses_work(presser)
    presses = presser.end()
    rig.robot.publish("/heard", {"data": "short"})
    until(lambda: watch.widgets["heard"]["text"] == "short", "shown")
    assert not any(not state.enabled for state in watch.states["kept"] if state.at > began)
    watch.end()
    rig.robot.withdraw("/heard")
    account = accounted(presses, lambda: rig.arrivals("guarded"), lambda _: True, limit(2.0))
    after = until_released(server.process.pid, before, MARGIN_MB)
    record(
        f"{LONG_MESSAGES} messages of 10 MB on a readout's topic",
        presses=account,
        latest=ms(account.latest_s),
        after=grown(before, after),
    )


def client_of(endpoint: str) -> zenoh.Config:
    """In client mode: a bridge forwards everything from a client, but not between peers."""
    config = zenoh.Config()
    for place, value in {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "scouting/multicast/enabled": False,
        "transport/shared_memory/enabled": False,
    }.items():
        config.insert_json5(place, json.dumps(value))
    return config


def over(liar: zenoh.Session, watch: Watch) -> bool:
    """Publishes a last message after all others; whether it is shown."""
    liar.put("heard", b"\0\1\0\0\5\0\0\0over\0")
    return bool(watch.widgets["heard"]["text"] == "over")


def lie(chance: random.Random) -> bytes:
    """Invalid data: an unknown encapsulation, or a body that is too long for a bool and no valid
    text."""
    if chance.random() < 0.5:
        return b"\xff" + chance.randbytes(chance.randrange(200))
    return b"\0\1\0\0" + b"\xff" * 4 + chance.randbytes(chance.randrange(60, 200))


def test_garbage_on_all_that_is_listened_to(rig: Rig, server: Server) -> None:
    """Invalid messages never permit anything, and the next valid one does."""
    before = resources(server.process.pid)
    watch, presser = Watch(server), Presser(server, "guarded")
    chance = random.Random(7)
    with answering(server), zenoh.open(client_of(rig.endpoint)) as liar:
        presses_work(presser)
        lied_at = time.monotonic()
        until(lambda: (liar.put("kept", b"\0\1\0\0"), not watch.now("kept").enabled)[1], "it locks")
        locked_s = watch.locked_after(lied_at, "kept", limit(SHOWN_WITHIN_S), "cannot be read")
        for number in range(GARBAGE):
            liar.put(LISTENED_TO[number % len(LISTENED_TO)], lie(chance))
        until(lambda: "cannot be read" in watch.widgets["heard"]["note"], "the readout says so")
        until(lambda: over(liar, watch), "all of it has come", every_s=0.1)
        assert not watch.was_open("kept", lied_at + locked_s, time.monotonic())
        rig.robot.publish("/kept", {"data": True})
        watch.opened("kept")
        watch.opened("pulsed")
        presses_work(presser)
    presses = presser.end()
    watch.end()
    account = accounted(presses, lambda: rig.arrivals("guarded"), lambda _: True, limit(2.0))
    after = until_released(server.process.pid, before, MARGIN_MB)
    errors = sum("are not a std_msgs/msg/Bool" in line for line in server.process.lines)
    assert errors <= 10, "a line a minute at most"
    record(
        f"{GARBAGE} messages of garbage on all topics",
        locked=ms(locked_s),
        presses=account,
        latest=ms(account.latest_s),
        after=grown(before, after),
    )
