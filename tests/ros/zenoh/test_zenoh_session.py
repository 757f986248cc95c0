"""The link alone, between two Zenoh sessions of this process."""

import asyncio
import re
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from datetime import UTC, datetime, timedelta
from functools import partial
from pathlib import Path
from typing import Any

import pytest
import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app.cell.robot.state import Sample
from app.ros.dialects import bridge_dialect
from app.ros.messages.names import Qos
from app.ros.zenoh import config as zenoh_config
from app.ros.zenoh.config import BLOCKED_MOST_US, config_from, config_to
from app.ros.zenoh.declarations import Declarations
from app.ros.zenoh.session import ZenohSession
from app.system.errors import SettingsError
from tests.support.builders import DIALECT
from tests.support.parts import free_port, until
from tests.support.processes.signals import send_signal

RENEWALS = 30
BURST = 500
Linked = Callable[[Declarations], ZenohSession]


@pytest.fixture
def linked(peer: tuple[str, zenoh.Session]) -> Iterator[Linked]:
    """Starts links to the peer, and closes them after the test."""
    endpoint, _ = peer
    with ExitStack() as stack:

        def started(declarations: Declarations) -> ZenohSession:
            link = ZenohSession(config_to(endpoint), lambda _: None, DIALECT)
            stack.callback(link.close)
            link.start(declarations)
            return link

        yield started


def matched(publisher: zenoh.Publisher) -> bool:
    """Whether someone is known to listen: an object of Zenoh's, whatever its stub says."""
    status: Any = publisher.matching_status
    return bool(status.matching)


def resident_kb() -> int:
    status = Path("/proc/self/status").read_text()
    return next(int(line.split()[1]) for line in status.splitlines() if line.startswith("VmRSS"))


def declared(subscribe: list[str], publish: list[str], **more: Any) -> Declarations:
    """By keys that are their own key expressions."""
    topics, own = dict(zip(subscribe, subscribe, strict=True)), dict(zip(publish, publish, strict=True))
    return Declarations(subscribe=topics, publish=own, query=own, **more)


def tokens(zid: str, count: int) -> list[str]:
    return [
        bridge_dialect.token(zid, "MP", f"topic{n}", "std_msgs/msg/String", Qos(), "")
        for n in range(count)
    ]


@pytest.mark.parametrize(
    ("content", "why"),
    [
        (None, "No such file or directory"),
        ('{ mode: "pear" }', "unknown variant `pear`"),
        ("{", "line 1, column 2"),
    ],
)
def test_a_configuration_that_can_not_be_used_is_reported_in_the_users_terms(
    tmp_path: Path, content: str | None, why: str
) -> None:
    path = tmp_path / "zenoh.json5"
    if content is not None:
        path.write_text(content)
    with pytest.raises(SettingsError, match=re.escape(why)) as caught:
        config_from(path)
    assert str(path) in str(caught.value)
    assert ".rs:" not in str(caught.value)


@pytest.mark.parametrize(
    ("connect", "endpoints"),
    [
        ('["tcp/127.0.0.1:9", "tcp/127.0.0.1:10"]', ("tcp/127.0.0.1:9", "tcp/127.0.0.1:10")),
        ('{ peer: ["tcp/127.0.0.1:9"], router: ["tcp/127.0.0.1:10"] }', ("tcp/127.0.0.1:9",)),
        ("[]", ()),
    ],
)
def test_a_link_says_where_it_connects(connect: str, endpoints: tuple[str, ...]) -> None:
    config = config_to("tcp/127.0.0.1:9")
    config.insert_json5("connect/endpoints", connect)
    link = ZenohSession(config, lambda _: None, DIALECT)
    assert link.endpoints == endpoints
    link.close()


def test_session_is_renewed_while_samples_arrive(
    peer: tuple[str, zenoh.Session],
) -> None:
    """A token that ended under the link's lock, while Zenoh called back, stopped the process."""
    endpoint, session = peer
    over = threading.Event()

    def flood() -> None:
        while not over.is_set():
            held = [session.liveliness().declare_token(t) for t in tokens(str(session.zid()), 20)]
            for token in held:
                token.undeclare()

    link = ZenohSession(config_to(endpoint), lambda _: None, DIALECT)
    link.start(declared(["a"], ["b"]))

    def renew() -> None:
        for _ in range(RENEWALS):
            link.declare_tokens(tokens(link.zid, 10))
            link.renew()
            link.drain()

    threads = [threading.Thread(target=work, daemon=True) for work in (flood, renew)]
    for thread in threads:
        thread.start()
    threads[1].join(30)
    stuck = threads[1].is_alive()
    over.set()
    assert not stuck, "renewing the session stands still"
    threads[0].join(5)
    link.close()


def test_a_burst_is_not_dropped(
    peer: tuple[str, zenoh.Session], linked: Linked, monkeypatch: pytest.MonkeyPatch
) -> None:
    """With Zenoh's own queue some of these were lost, more on a busy machine, without an error."""
    monkeypatch.setattr(zenoh_config, "BLOCKED_MOST_US", 10_000_000)
    _, session = peer
    heard: list[bytes] = []

    def hear(sample: zenoh.Sample) -> None:
        heard.append(bytes(sample.payload))

    session.declare_subscriber("b", Callback(hear, indirect=False))
    link = linked(declared([], ["b"]))
    until(lambda: link.has_reader("b"), "the subscriber is known")
    for number in range(BURST):
        link.put("b", str(number).encode())
    until(lambda: len(heard) == BURST, f"all came, of {BURST}: {len(heard)}")
    assert heard == [str(number).encode() for number in range(BURST)]


LISTENER = """
import sys, zenoh
config = zenoh.Config()
config.insert_json5("listen/endpoints", f'["{sys.argv[1]}"]')
config.insert_json5("scouting/multicast/enabled", "false")
session = zenoh.open(config)
listener = session.declare_subscriber("b", lambda sample: None)
print("ready", flush=True)
sys.stdin.read()
"""


@pytest.mark.long("real time")
def test_a_link_that_takes_nothing_stops_the_loop_once_and_not_for_long() -> None:
    """A peer that is frozen: the kernel's buffers fill, and then what is sent, and what is asked."""
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    command = [sys.executable, "-c", LISTENER, endpoint]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as peer:
        assert peer.stdout is not None
        assert peer.stdout.readline() == b"ready\n"
        link = ZenohSession(config_to(endpoint), lambda urgent: None, DIALECT)
        link.start(declared([], ["b"]))
        until(lambda: link.has_reader("b"), "the subscriber is known")
        send_signal(peer.pid, signal.SIGSTOP)
        took = []
        for _ in range(2000):
            began = time.monotonic()
            link.put("b", bytes(20_000))
            took.append(time.monotonic() - began)
        began = time.monotonic()
        asyncio.run(send_query(link))
        took.append(time.monotonic() - began)
        peer.kill()
        link.close()
    long = [seconds for seconds in took if seconds > 0.1]
    assert len(long) == 1, "it waits for room once"
    assert long[0] < 2 * BLOCKED_MOST_US / 1e6


async def send_query(link: ZenohSession) -> None:
    """A question is sent, and not waited for."""
    link.query("b", b"", 0.1).cancel()


def test_closed_sessions_leave_no_objects(linked: Linked) -> None:
    """Zenoh kept a shared memory segment of each: a thousand losses of the link, and no file more."""
    link = linked(declared(["a"], ["b"]))

    def files() -> int:
        return len(list(Path("/proc/self/fd").iterdir()))

    link.renew()
    until(lambda: link.drain().link_up, "linked")
    before = files()
    for _ in range(8):
        link.renew()
    until(lambda: files() <= before, f"no more files than {before}")


def test_new_session_declares_tokens_again(peer: tuple[str, zenoh.Session], linked: Linked) -> None:
    _, session = peer
    link = linked(declared([], []))
    link.declare_tokens(tokens(link.zid, 1))
    link.renew()
    wanted = tokens(link.zid, 2)
    link.declare_tokens(wanted)

    def present() -> set[str]:
        replies = session.liveliness().get(bridge_dialect.TOKENS, timeout=1)
        return {str(reply.ok.key_expr) for reply in replies if reply.ok is not None}

    until(lambda: present() == set(wanted), "the tokens of the new session are there")


def test_lossless_topic_keeps_every_sample_between_two_drains(
    peer: tuple[str, zenoh.Session], linked: Linked
) -> None:
    _, session = peer
    link = linked(declared(["a", "b"], [], lossless=["a"]))
    ends: list[bytes] = []
    link.subscribe_on_demand("end", "end", lambda payload: ends.append(bytes(payload)))
    # What it declared before is known as well.
    until(partial(matched, session.declare_publisher("end")), "it is subscribed")

    def put(key: str, payload: bytes) -> None:
        session.put(key, payload, congestion_control=zenoh.CongestionControl.BLOCK)

    def put_end(end: bytes) -> None:
        """A session's messages come in order: all others have come by then."""
        put("end", end)
        until(lambda: end in ends, "all came")

    said = [b"yes", b"no", b"no", b"yes", *(b"%d" % n for n in range(100)), b"yes"]
    for key in ("a", "b"):
        for payload in said:
            put(key, payload)
    put_end(b"first")
    samples = link.drain().samples
    lossless, other = samples["a"], samples["b"]
    assert bytes(lossless.payload) == bytes(other.payload) == b"yes"
    changes = [b"yes", b"no", b"yes", *(b"%d" % n for n in range(100))]
    assert [bytes(skipped.payload) for skipped in lossless.skipped_payloads] == changes
    assert other.skipped_payloads == ()
    for payload in (b"yes", b"no", b"no", b"yes"):
        put("a", payload)
    put_end(b"second")
    assert [bytes(skipped.payload) for skipped in link.drain().samples["a"].skipped_payloads] == [
        b"yes",
        b"no",
    ]


def test_a_stamp_of_a_clock_that_is_ahead_makes_the_link_deaf_to_nothing(
    peer: tuple[str, zenoh.Session], linked: Linked
) -> None:
    _, session = peer
    link = linked(declared(["a"], [], lossless=["a"]))
    until(partial(matched, publisher := session.declare_publisher("a")), "it is subscribed")
    own = session.new_timestamp().get_id()
    now = datetime.now(UTC)
    for payload, ahead_s in ((b"true", 3600), *((b"false%d" % n, n / 100) for n in range(25))):
        publisher.put(payload, timestamp=zenoh.Timestamp(now + timedelta(seconds=ahead_s), own))
    heard: list[bytes] = []

    def all_heard() -> bool:
        if sample := link.drain().samples.get("a"):
            heard.extend(bytes(skipped.payload) for skipped in sample.skipped_payloads)
            heard.append(bytes(sample.payload))
        return len(heard) >= 26

    until(all_heard, "each value came")
    assert heard == [b"true", *(b"false%d" % n for n in range(25))]


def test_late_link_gets_the_last_cached_value_and_no_older_sample(
    peer: tuple[str, zenoh.Session], linked: Linked
) -> None:
    _, session = peer
    latched = declare_advanced_publisher(
        session, "a", cache=CacheConfig(max_samples=1), publisher_detection=True
    )
    latched.put(b"old")
    latched.put(b"last")
    link = linked(declared(["a"], []))
    heard: list[bytes] = []

    def came(payload: bytes) -> bool:
        if sample := link.drain().samples.get("a"):
            heard.append(bytes(sample.payload))
        return payload in heard

    until(partial(came, b"last"), "the last value came")
    latched.put(b"new")
    until(partial(came, b"new"), "a new value came")
    latched.undeclare()
    again = declare_advanced_publisher(
        session, "a", cache=CacheConfig(max_samples=1), publisher_detection=True
    )
    again.put(b"of the next")
    until(partial(came, b"of the next"), "the next publisher is heard")
    assert heard == [b"last", b"new", b"of the next"]


def test_a_small_message_does_not_keep_all_that_it_was_read_with(
    peer: tuple[str, zenoh.Session], linked: Linked
) -> None:
    """The latest of each topic stays for long: each kept a buffer of 64 kB, of which some was used."""
    _, session = peer
    topics = [f"topic{number}" for number in range(300)]
    publishers = [session.declare_publisher(topic) for topic in topics]
    link = linked(declared(topics, []))
    until(lambda: all(map(matched, publishers)), "each has its subscriber")
    before = resident_kb()
    kept: dict[str, Sample] = {}

    def came() -> int:
        kept.update(link.drain().samples)
        return len(kept)

    for number, publisher in enumerate(publishers, 1):  # each in a message of its own
        publisher.put(b"small")
        until(partial(lambda wanted: came() == wanted, number), f"{publisher.key_expr} came")
    grown_kb = resident_kb() - before
    assert grown_kb < len(topics) * 4
