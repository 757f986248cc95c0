"""The real bridge or node fails: controls are locked in time, and enabled by the robot's next
message."""

import signal
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any, Final

import pytest

from app.ros.dialects.peer_traits import BRIDGE_TRAITS
from tests.support.cyclone import Client
from tests.support.parts import (
    REFERENCE,
    Bridge,
    RosNode,
    Server,
    Stream,
    live,
    publish_until,
    until,
)

pytestmark = [pytest.mark.long("fault"), pytest.mark.promise("locks")]

ENABLED = "operation-enabled-updated"
FREEZES = 5
LONG: Final = 400_000  # bytes of a message
exact = partial(live, EXACT_LIVENESS="1")


def speaking(node: RosNode, value: bool = True) -> None:
    """The robot publishes its permission once, latched."""
    node.advertise("/operation_enabled", "std_msgs/msg/Bool", durability="transient_local", depth=1)
    node.publish("/operation_enabled", {"data": value})


def strict(bridge: Bridge, folder: Path, condition: str, **more: Any) -> Server:
    """A kiosk whose interlock has one more condition."""
    panel = folder / "panel.toml"
    shipped = REFERENCE.read_text()
    panel.write_text(shipped.replace('field = "data"', f'field = "data"\n{condition}', 1))
    return live(bridge.endpoint, folder, KIOSK_PANEL=str(panel), **more)


def permitted(kiosk: Server) -> bool:
    return bool(kiosk.widget("operation1")["enabled"])


def forbidden(kiosk: Server) -> bool:
    return "does not permit" in (kiosk.widget("operation1")["reason"] or "")


def opened(kiosk: Server) -> None:
    until(lambda: permitted(kiosk), "permitted")


def next_lock(stream: Stream) -> tuple[float, str]:
    """The time (monotonic seconds) of the next lock in the stream, and its reason."""
    while True:
        _, data, _ = stream.next(ENABLED)
        if not data["enabled"]:
            return time.monotonic(), data["reason"]


@pytest.fixture
def kiosk(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> Server:
    """A kiosk behind a bridge that the test may end, whose robot permits."""
    speaking(own_node)
    mine = servers(exact(own_bridge.endpoint, tmp_path))
    opened(mine)
    return mine


def lock_after(kiosk: Server, cause: Callable[[], object]) -> tuple[float, str]:
    """Seconds from the begin of a cause to the next lock in the stream, and the reason of that."""
    with kiosk.stream() as stream:
        stream.next("snapshot")
        began = time.monotonic()
        cause()
        locked_at, reason = next_lock(stream)
    return locked_at - began, reason


@pytest.mark.long("real time")
def test_a_killed_bridge_locks_within_a_second_and_its_return_opens(
    own_bridge: Bridge, kiosk: Server
) -> None:
    seconds, reason = lock_after(kiosk, own_bridge.kill)
    assert seconds < 1.0
    assert "No connection to the robot" in reason
    assert not any(kiosk.widget(w)["enabled"] for w in ("operation", "operation1", "operation2"))
    refused = kiosk.press("operation", "into the void")
    assert (refused.status_code, refused.json()["outcome"]) == (503, "refused")
    assert kiosk.http.get("/readyz").status_code == 503
    own_bridge.start()
    opened(kiosk)
    assert kiosk.ready()


def test_after_a_return_an_old_permission_does_not_count(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(live(own_bridge.endpoint, tmp_path))
    until(kiosk.ready, "ready")
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    publish_until(own_node, "/operation_enabled", {"data": True}, lambda: permitted(kiosk))
    own_bridge.kill()
    until(lambda: not permitted(kiosk), "locked")
    own_bridge.start()
    until(kiosk.ready, "the bridge is back")
    assert "is not known yet" in kiosk.widget("operation1")["reason"]
    # Published repeatedly: to the node, the killed bridge is a subscriber for some more seconds.
    own_node.every("/operation_enabled", {"data": True}, 0.1)
    opened(kiosk)


@pytest.mark.long("real time")
def test_a_frozen_bridge_locks_within_a_second_and_opens_when_it_thaws(
    own_bridge: Bridge, kiosk: Server
) -> None:
    seconds, reason = lock_after(kiosk, own_bridge.freeze)
    assert seconds < 1.0
    assert "No connection to the robot" in reason
    own_bridge.thaw()
    opened(kiosk)


def test_change_during_a_frozen_bridge_counts_after_it(
    own_bridge: Bridge, own_node: RosNode, kiosk: Server
) -> None:
    own_bridge.freeze()
    until(lambda: not permitted(kiosk), "locked")
    own_node.publish("/operation_enabled", {"data": False})
    with kiosk.stream() as stream:
        stream.next("snapshot")
        own_bridge.thaw()
        until(
            lambda: "does not permit" in (kiosk.widget("operation1")["reason"] or ""),
            "the robot's message of that time",
        )
        # It was never enabled in between.
        while True:
            _, data, _ = stream.next(ENABLED)
            assert data["enabled"] is False
            if "does not permit" in data["reason"]:
                break


def test_server_starts_without_a_bridge_and_keeps_connecting(
    domain: int, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    late = Bridge(domain + 3)
    kiosk = servers(live(late.endpoint, tmp_path))
    until(
        lambda: "No connection to the robot" in kiosk.widget("operation")["reason"],
        "the start is over, and the lock says what is missing",
    )
    assert "bridge" in kiosk.http.get("/readyz").json()["reason"]
    late.start()
    try:
        until(kiosk.ready, "ready once the bridge is there")
        assert kiosk.widget("operation")["enabled"]
    finally:
        late.end()


def test_a_required_publisher_that_goes_away_locks(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(strict(own_bridge, tmp_path, "require_publisher = true"))
    speaking(own_node)
    opened(kiosk)
    own_node.withdraw("/operation_enabled")
    until(lambda: not permitted(kiosk), "locked")
    assert "no node of the robot publishes operation" in kiosk.widget("operation1")["reason"]


@pytest.mark.long("real time")
def test_stale_value_locks_and_a_fresh_value_unlocks(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(strict(own_bridge, tmp_path, "max_age_s = 0.5"))
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    own_node.every("/operation_enabled", {"data": True}, 0.1)
    opened(kiosk)
    with kiosk.stream() as stream:
        stream.next("snapshot")
        own_node.kill()  # the graph shows it for up to 20 s; `max_age_s` locks sooner
        killed_at = time.monotonic()
        locked_at, reason = next_lock(stream)
    assert locked_at - killed_at < 1.0
    assert "older than 0.5 s" in reason
    refused = kiosk.press("operation1", "too late")
    assert (refused.status_code, refused.json()["outcome"]) == (409, "refused")


def test_messages_count_after_each_of_many_freezes(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    """A session that Zenoh resumed by itself received nothing here after some freezes."""
    speaking(own_node)
    kiosk = servers(exact(own_bridge.endpoint, tmp_path))
    for _ in range(FREEZES):
        own_node.publish("/operation_enabled", {"data": True})
        opened(kiosk)
        own_bridge.freeze()
        until(lambda: not permitted(kiosk), "locked")
        own_bridge.thaw()
        own_node.publish("/operation_enabled", {"data": False})
        until(
            lambda: "does not permit" in (kiosk.widget("operation1")["reason"] or ""), "forbidden", 15
        )
        assert kiosk.press("operation1", "no").json()["outcome"] == "refused"


def test_new_publisher_of_a_required_topic_must_publish_again(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    kiosk = servers(strict(own_bridge, tmp_path, "require_publisher = true"))
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    until(lambda: "is not known yet" in kiosk.widget("operation1")["reason"], "its token is seen")
    until(lambda: own_node.subscribers("/operation_enabled"), "the bridge listens")
    until(lambda: (own_node.publish("/operation_enabled", {"data": True}), permitted(kiosk))[1], "open")
    time.sleep(BRIDGE_TRAITS.token_delay_s)  # no message is under way any more
    own_node.withdraw("/operation_enabled")
    until(lambda: not permitted(kiosk), "locked")
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    until(
        lambda: "no node" not in (kiosk.widget("operation1")["reason"] or ""), "the successor is seen"
    )
    assert not permitted(kiosk)


def test_publisher_replaced_during_a_stall_must_publish_again(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    kiosk = servers(strict(own_bridge, tmp_path, "require_publisher = true", EXACT_LIVENESS="1"))

    def says_so() -> bool:
        own_node.publish("/operation_enabled", {"data": True})
        return permitted(kiosk)

    def announced() -> bool:
        return any(token.startswith("MP/operation_enabled/") for token in client.tokens())

    until(says_so, "permitted", every_s=0.2)
    with closing(Client(own_bridge.endpoint)) as client:
        until(announced, "the bridge announces it")
        kiosk.process.send(signal.SIGSTOP)
        own_node.withdraw("/operation_enabled")
        until(lambda: not announced(), "the bridge knows that it went")
        own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
        until(announced, "the bridge announces its successor")
        kiosk.process.send(signal.SIGCONT)
    until(lambda: not permitted(kiosk), "the permission went with its publisher")
    time.sleep(1.0)
    assert not permitted(kiosk)
    until(says_so, "permitted by the successor", every_s=0.2)


@pytest.mark.parametrize("waiting", [12, 60])
def test_false_during_a_stall_locks_though_many_samples_wait_before_it(
    own_bridge: Bridge,
    own_node: RosNode,
    tmp_path: Path,
    servers: Callable[[Server], Server],
    waiting: int,
) -> None:
    """Not all of 60 long messages fit the queues, and the permission comes last."""
    own_node.advertise("/last_heard", "std_msgs/msg/String")
    own_node.advertise("/operation_enabled", "std_msgs/msg/Bool")
    own_node.subscribe("/operation1", "std_msgs/msg/String")
    kiosk = servers(exact(own_bridge.endpoint, tmp_path))

    def says_so() -> bool:
        own_node.publish("/operation_enabled", {"data": True})
        return permitted(kiosk)

    until(says_so, "permitted", every_s=0.2)
    until(lambda: own_node.subscribers("/last_heard"), "the bridge listens")
    with ThreadPoolExecutor(1) as hand:
        kiosk.process.send(signal.SIGSTOP)
        for _ in range(waiting):
            own_node.publish_long("/last_heard", LONG)
        own_node.publish("/operation_enabled", {"data": False})
        time.sleep(0.7)
        press = hand.submit(kiosk.press, "operation1", "forbidden")
        time.sleep(0.1)
        kiosk.process.send(signal.SIGCONT)
        assert press.result().json()["outcome"] == "refused"
    until(kiosk.ready, "ready again")
    time.sleep(0.5)
    # DDS resends what did not fit the bridge's queue: this took up to 1.7 s on a busy machine.
    until(lambda: not permitted(kiosk), "the last message is not lost")
    assert own_node.heard("/operation1") == []
    until(says_so, "permitted again", every_s=0.2)


def test_old_latched_value_does_not_count_as_fresh(
    own_bridge: Bridge, own_node: RosNode, tmp_path: Path, servers: Callable[[Server], Server]
) -> None:
    speaking(own_node)
    kiosk = servers(strict(own_bridge, tmp_path, "max_age_s = 30"))
    until(kiosk.ready, "ready")
    with kiosk.stream() as stream:
        for _ in range(4):  # two seconds of beats: the latched value has come, and does not count
            stream.next("beat")
    assert "is not known yet" in kiosk.widget("operation1")["reason"]

    def said_again() -> bool:
        own_node.publish("/operation_enabled", {"data": True})
        return permitted(kiosk)

    until(said_again, "what is published from then on counts", every_s=0.5)
