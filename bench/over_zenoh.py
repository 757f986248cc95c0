"""A robot that speaks Zenoh like one behind zenoh-bridge-ros2dds, and its load. It needs no ROS 2."""

import json
import socket
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any, Final

import zenoh
from zenoh.handlers import Callback

ENABLED: Final = "/operation_enabled"
COMMAND: Final = "/operation1"
HEADER: Final = b"\x00\x01\x00\x00"  # CDR, little-endian
TICK_S: Final = 0.001


class OverZenoh:
    """Keys, CDR payloads, tokens and admin space like those of a robot behind zenoh-bridge-ros2dds."""

    def __init__(self, namespace: str = "") -> None:
        self.locator = f"tcp/127.0.0.1:{free_port()}"
        self.heard: list[tuple[int, str]] = []
        self._prefix = f"{namespace[1:]}/" if namespace else ""
        self._session = zenoh.open(listening(self.locator))
        self._zid = str(self._session.zid())
        self._publishers: dict[str, Any] = {}
        self._kept = [
            self._queryable("version", '"1.10.2"'),
            self._queryable("config", json.dumps({"namespace": namespace or "/"})),
            self._session.declare_subscriber(
                self._prefix + COMMAND[1:], Callback(self._hear, indirect=False)
            ),
            self._token("MS", COMMAND, "String"),
            self._session.liveliness().declare_token(f"@/{self._zid}/@ros2_lv"),
        ]
        self._offer(ENABLED, "Bool")

    def _hear(self, sample: zenoh.Sample) -> None:
        at = time.monotonic_ns()
        self.heard.append((at, sample.payload.to_bytes()[8:].split(b"\0")[0].decode()))

    def _queryable(self, entity: str, text: str) -> Any:
        key = f"@/{self._zid}/ros2/{entity}"

        def answer(query: zenoh.Query) -> None:
            with query:
                query.reply(key, text.encode())

        return self._session.declare_queryable(key, Callback(answer, indirect=False), complete=True)

    def _token(self, role: str, topic: str, type_name: str) -> Any:
        key = (self._prefix + topic[1:]).replace("/", "§")
        token = f"@/{self._zid}/@ros2_lv/{role}/{key}/std_msgs§msg§{type_name}/:1:0:0,10"
        return self._session.liveliness().declare_token(token)

    def _offer(self, topic: str, type_name: str) -> None:
        if topic not in self._publishers:
            # As in the bridge for reliable topics; express, because a bridge forwards without batching.
            self._publishers[topic] = self._session.declare_publisher(
                self._prefix + topic[1:], congestion_control=zenoh.CongestionControl.DROP, express=True
            )
            self._kept.append(self._token("MP", topic, type_name))

    def offer(self, topic: str) -> None:
        self._offer(topic, "String")

    def enable(self, value: bool) -> None:
        self._publishers[ENABLED].put(HEADER + bytes([value]))

    def say(self, topic: str, text: str) -> None:
        data = text.encode() + b"\0"
        self._publishers[topic].put(HEADER + len(data).to_bytes(4, "little") + data)

    def close(self) -> None:
        self._session.close()


def free_port() -> int:
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def listening(locator: str) -> zenoh.Config:
    config = zenoh.Config()
    for place, value in {
        "mode": '"peer"',
        "listen/endpoints": f'["{locator}"]',
        "scouting/multicast/enabled": "false",
        "scouting/gossip/enabled": "false",
        "timestamping/enabled": "true",
    }.items():
        config.insert_json5(place, value)
    return config


def text_of(number: int, size: int) -> str:
    """A text of at least `size` bytes that begins with its number."""
    return f"#{number:09d}#".ljust(size, "x")


class Load:
    """Publishes texts on several topics, at `hz` on each, until `end`."""

    def __init__(self, say: Sequence[Callable[[str], None]], hz: float, size: int) -> None:
        self.put_at: list[int] = []  # time by number
        self._say = say
        self._per_s = hz * len(say)
        self._size = size
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        began = time.monotonic()
        while not self._ends.is_set():
            due = (time.monotonic() - began) * self._per_s
            while (number := len(self.put_at)) < due:
                text = text_of(number, self._size)
                self.put_at.append(time.monotonic_ns())
                self._say[number % len(self._say)](text)
            next_s = began + (len(self.put_at)) / self._per_s - time.monotonic()
            self._ends.wait(max(TICK_S, next_s))

    def end(self) -> list[int]:
        self._ends.set()
        self._thread.join()
        return self.put_at
