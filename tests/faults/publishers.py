"""Measures whether a `false` of a new publisher reaches the panel, by kind of publisher.

`python -m tests.faults.publishers [TIMES]` measures all kinds and prints a table.
"""

import sys
import tempfile
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

import zenoh

from app.ros.dialects import bridge_dialect
from tests.faults.rig import kiosk
from tests.support import domains
from tests.support.cyclone import CYCLONE
from tests.support.parts import ROS_PYTHON, TESTS, Bridge, Server, until
from tests.support.processes.commanded import Commanded

Vendor = Literal["fast", "cyclone"]
Outcome = Literal["heard", "locked", "unnoticed"]

TOPIC: Final = "/kept"
KEY: Final = TOPIC[1:]
WIDGET: Final = "guarded"
NEWS_WITHIN_S: Final = 5.0  # Fast DDS announces a participant every 3 s
# The graph says when a publisher is there or gone; only a token that never changes ends the wait.
GONE_WITHIN_S: Final = 240.0
OPENED_BY: Final = 5  # publishers, at most


@dataclass(frozen=True)
class Kind:
    """A kind of publisher: `times` messages, then it ends after `stays` seconds. `matched`: it waits
    for a subscriber before it publishes."""

    name: str
    times: int = 1
    stays: float = 0.1
    durability: str = "volatile"
    matched: bool = True


KINDS: Final = (
    Kind("`--once`"),
    Kind("`--times 3 --rate 10`", times=3),
    Kind("publishes when it has a subscriber, and stays", stays=NEWS_WITHIN_S),
    Kind("publishes at its creation, and stays", stays=NEWS_WITHIN_S, matched=False),
    Kind("latched (transient local)", stays=NEWS_WITHIN_S, durability="transient_local", matched=False),
    Kind("periodic, 10 Hz", times=40),
)


class Publisher(Commanded):
    """See `tests/ros_nodes/publishers.py`."""

    def __init__(self, vendor: Vendor, domain: int) -> None:
        env = {"ROS_DOMAIN_ID": str(domain), "ROS_LOG_DIR": tempfile.gettempdir()}
        env |= {"RMW_IMPLEMENTATION": "rmw_fastrtps_cpp", "ROS_AUTOMATIC_DISCOVERY_RANGE": "LOCALHOST"}
        if vendor == "cyclone":
            env["CYCLONEDDS_URI"] = CYCLONE.format(lease_s=10)
        super().__init__([ROS_PYTHON, TESTS / "ros_nodes/publishers.py", vendor], env)

    def publish(self, value: bool, kind: Kind) -> None:
        """Publishes the value from a new process, as `ros2 topic pub` does."""
        self.end()
        self.start()
        how: Mapping[str, Any] = {"times": kind.times, "durability": kind.durability}
        self("begin", topic=TOPIC, value=value, matched=kind.matched, **how)

    def finish(self, after_s: float) -> None:
        self("finish", after_s=after_s)


class Observer:
    """Receives the topic and its tokens from the bridge, independently of the panel."""

    def __init__(self, endpoint: str) -> None:
        config = zenoh.Config()
        config.insert_json5("mode", '"client"')
        config.insert_json5("connect/endpoints", f'["{endpoint}"]')
        self._session = zenoh.open(config)
        self.values: list[bool] = []
        self.appeared: list[str] = []
        self.present: set[str] = set()
        self._subscribers = (
            self._session.declare_subscriber(KEY, self._sample),
            self._session.liveliness().declare_subscriber(
                bridge_dialect.TOKENS, self._token, history=True
            ),
        )

    def _sample(self, sample: zenoh.Sample) -> None:
        self.values.append(bytes(sample.payload)[4] == 1)

    def _token(self, sample: zenoh.Sample) -> None:
        token = str(sample.key_expr)
        endpoint = bridge_dialect.parsed(token)
        if endpoint is None or (endpoint.role, endpoint.key) != ("MP", KEY):
            return
        if sample.kind == zenoh.SampleKind.PUT:
            self.appeared.append(token)
            self.present.add(token)
        else:
            self.present.discard(token)

    def forget(self) -> None:
        """Clears the received values and publishers."""
        self.values.clear()
        self.appeared.clear()

    def close(self) -> None:
        self._session.close()


@dataclass(frozen=True)
class Trial:
    """The result of one `false`: whether the bridge forwarded it, whether it announced the publisher,
    and whether the panel still permits operation."""

    received: bool
    announced: bool
    permitted: bool

    @property
    def outcome(self) -> Outcome:
        return "heard" if self.received else "unnoticed" if self.permitted else "locked"


class Publishers:
    """A bridge, a panel behind it without any permission, and publishers that appear and end, all with
    the same durability: the panel subscribes with that of the first publisher it discovered."""

    def __init__(self, domain: int, folder: Path, durability: str = "volatile") -> None:
        matched = durability == "volatile"
        self._opens = Kind("opens", durability=durability, matched=matched, stays=1.0)
        self._bridge = Bridge(domain)
        self._bridge.start()
        self._server: Server = kiosk(self._bridge.endpoint, folder)
        until(self._server.ready, "ready")
        self._observer = Observer(self._bridge.endpoint)
        self._by: dict[Vendor, Publisher] = {
            "fast": Publisher("fast", domain),
            "cyclone": Publisher("cyclone", domain),
        }

    @property
    def permitted(self) -> bool:
        return bool(self._server.widget(WIDGET)["enabled"])

    def open(self) -> None:
        """A publisher on Cyclone DDS, which loses almost no messages, permits operation and ends."""
        for _ in range(OPENED_BY):
            self._by["cyclone"].publish(True, self._opens)
            self._by["cyclone"].finish(self._opens.stays)
            self._alone()
            if self.permitted:
                return
        raise AssertionError("no publisher could permit it")

    @contextmanager
    def running(self, vendor: Vendor, kind: Kind) -> Iterator[None]:
        """Within the block, a new publisher exists; returns when the bridge has removed it."""
        self._observer.forget()
        self._by[vendor].publish(True, kind)
        until(lambda: self._observer.appeared, "the bridge announces it", within_s=GONE_WITHIN_S)
        yield
        self._by[vendor].finish(0.0)
        self._alone()

    def until_reason(self, reason: str) -> None:
        """Waits until the control is locked for a reason that begins so."""
        until(lambda: (self._server.widget(WIDGET)["reason"] or "").startswith(reason), reason)

    def trial(self, vendor: Vendor, kind: Kind) -> Trial:
        """A new publisher revokes the permission."""
        self.open()
        self._observer.forget()
        self._by[vendor].publish(False, kind)
        self._by[vendor].finish(kind.stays)
        self._news()
        received, announced = False in self._observer.values, bool(self._observer.appeared)
        end = time.monotonic() + 2.0
        while (permitted := self.permitted) and (received or announced) and time.monotonic() < end:
            time.sleep(0.05)
        self._alone()
        return Trial(received, announced, permitted)

    def _news(self) -> None:
        """Waits for the message, or for the publisher's token to appear and end, at most
        `NEWS_WITHIN_S`."""
        end = time.monotonic() + NEWS_WITHIN_S
        observer = self._observer
        while (
            time.monotonic() < end
            and not observer.values
            and not (observer.appeared and not observer.present)
        ):
            time.sleep(0.02)

    def _alone(self) -> None:
        """Waits until the topic has no publisher."""
        until(lambda: not self._observer.present, "its publisher is gone", within_s=GONE_WITHIN_S)

    def close(self) -> None:
        for publisher in self._by.values():
            publisher.end()
        self._observer.close()
        self._server.end()
        self._bridge.end()


def main(times: int = 20) -> None:
    print("| publisher | RMW | times | reached the panel | lost, and locked | lost, and not noticed |")
    print("| --- | --- | --- | --- | --- | --- |")
    with tempfile.TemporaryDirectory() as folder:
        rmws: tuple[tuple[Vendor, str], ...] = (("fast", "Fast DDS"), ("cyclone", "Cyclone DDS"))
        for kind in KINDS:
            with closing(Publishers(domains.first(), Path(folder), kind.durability)) as rig:
                for vendor, rmw in rmws:
                    outcomes = [rig.trial(vendor, kind).outcome for _ in range(times)]
                    counts = [
                        str(outcomes.count(outcome)) for outcome in ("heard", "locked", "unnoticed")
                    ]
                    print(f"| {kind.name} | {rmw} | {times} | {' | '.join(counts)} |", flush=True)


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
