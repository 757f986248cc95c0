"""The demo robot: a `system_controller` behind a bridge of its own, as a separate Zenoh peer.

It has the keys, CDR bytes, liveliness tokens and admin space that a real robot has behind
zenoh-bridge-ros2dds, so that the kiosk can't tell the difference; it knows nothing of the server.
`python -m app.simulator [ENDPOINT]` runs it alone, where the shipped zenoh.json5 connects.
"""

import signal
import sys
import tempfile
import threading
import time
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Final

import zenoh
from zenoh.ext import CacheConfig, declare_advanced_publisher
from zenoh.handlers import Callback

from app import keys
from app.errors import DecodeError
from app.interfaces import Interfaces, interfaces_of
from app.keys import Qos

ENDPOINT: Final = "tcp/127.0.0.1:7447"
STEP_S: Final = 0.1
PERMITTED_S: Final = 20.0
FORBIDDEN_S: Final = 8.0
REPEAT_S: Final = 1.0

TEXT: Final = "std_msgs/msg/String"
FLAG: Final = "std_msgs/msg/Bool"
LISTENS: Final = {"/operation": TEXT, "/operation1": TEXT, "/operation2": TEXT}
SPEAKS: Final = {"/operation_enabled": FLAG, "/last_heard": TEXT}
LATCHED: Final = Qos(transient_local=True, depth=1)

Message = tuple[str, Mapping[str, Any]]


class DemoRobot:
    """What the robot does, with the time given: it permits, forbids, and tells what it heard."""

    def __init__(self) -> None:
        self._began: float | None = None
        self._told: tuple[bool, float] | None = None
        self._heard: list[Message] = []

    def hear(self, topic: str, text: str) -> None:
        self._heard.append(("/last_heard", {"data": f"{text} ({topic})"}))

    def step(self, now: float) -> list[Message]:
        """What the robot says at `now` (seconds, monotonic), as (topic, fields)."""
        if self._began is None:
            self._began = now
        permitted = (now - self._began) % (PERMITTED_S + FORBIDDEN_S) < PERMITTED_S
        said, self._heard = self._heard, []
        if self._told is None or self._told[0] != permitted or now - self._told[1] >= REPEAT_S:
            self._told = (permitted, now)
            said.append(("/operation_enabled", {"data": permitted}))
        return said


class Simulator:
    """The demo robot on Zenoh, listening at one endpoint; opened and closed as a context."""

    def __init__(self, endpoint: str, namespace: str = "", distro: str = "jazzy") -> None:
        self._interfaces: Interfaces = interfaces_of(distro)
        self._namespace = namespace
        self._robot = DemoRobot()
        self._lock = threading.Lock()
        self._ends = threading.Event()
        self._session = zenoh.open(_listening(endpoint))
        self._publishers = {topic: self._publisher(topic) for topic in SPEAKS}
        self._declared = [*self._subscribers(), *self._graph()]
        self._thread = threading.Thread(target=self._run, name="demo-robot", daemon=True)

    def __enter__(self) -> "Simulator":
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ends.set()
        self._thread.join()
        self._session.close()

    def _key(self, topic: str) -> str:
        return keys.key_of(topic, self._namespace)

    def _publisher(self, topic: str) -> Any:
        return declare_advanced_publisher(
            self._session,
            self._key(topic),
            cache=CacheConfig(max_samples=1),
            publisher_detection=True,
        )

    def _subscribers(self) -> Iterator[Any]:
        for topic, type_name in LISTENS.items():

            def on_sample(sample: zenoh.Sample, topic: str = topic, name: str = type_name) -> None:
                try:
                    message = self._interfaces.decode(name, sample.payload.to_bytes())
                except DecodeError:
                    return  # as a ROS node that can't read a message: nothing happens
                with self._lock:
                    self._robot.hear(topic, message.data)

            yield self._session.declare_subscriber(
                self._key(topic), Callback(on_sample, indirect=False)
            )

    def _graph(self) -> Iterator[Any]:
        zid = str(self._session.zid())

        def on_query(query: zenoh.Query) -> None:
            with query:
                query.reply(keys.version(zid), keys.DEMO_VERSION.encode())

        yield self._session.declare_queryable(
            keys.version(zid), Callback(on_query, indirect=False), complete=True
        )
        liveliness = self._session.liveliness()
        ends: list[tuple[keys.TopicRole, Mapping[str, str], Qos]] = [
            ("MS", LISTENS, Qos()),
            ("MP", SPEAKS, LATCHED),
        ]
        for role, topics, qos in ends:
            for topic, name in topics.items():
                type_hash = self._interfaces.type_hash(name)
                yield liveliness.declare_token(
                    keys.token(zid, role, self._key(topic), name, qos, type_hash)
                )
        yield liveliness.declare_token(keys.bridge_token(zid))

    def _run(self) -> None:
        while not self._ends.wait(STEP_S):
            with self._lock:
                said = self._robot.step(time.monotonic())
            for topic, fields in said:
                self._publishers[topic].put(self._interfaces.encode(SPEAKS[topic], fields))


def _listening(endpoint: str) -> zenoh.Config:
    config = zenoh.Config()
    for place, value in {
        "mode": '"peer"',
        "listen/endpoints": f'["{endpoint}"]',
        "scouting/multicast/enabled": "false",
        "scouting/gossip/enabled": "false",
        "timestamping/enabled": "true",
    }.items():
        config.insert_json5(place, value)
    return config


@contextmanager
def in_process(namespace: str, distro: str) -> Iterator[str]:
    """A demo robot for this process alone; yields the endpoint to connect to."""
    with tempfile.TemporaryDirectory(prefix="demo-robot-") as folder:
        endpoint = f"unixsock-stream/{Path(folder) / 'zenoh'}"
        with Simulator(endpoint, namespace, distro):
            yield endpoint


def main(arguments: list[str]) -> int:
    endpoint = arguments[0] if arguments else ENDPOINT
    ends = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ends.set())
    try:
        with Simulator(endpoint):
            print(f"demo robot: listening at {endpoint}", file=sys.stderr)
            ends.wait()
    except zenoh.ZError as error:
        print(f"demo robot: can't listen at {endpoint}: {error}", file=sys.stderr)
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
