"""The robot of all peers: one process that publishes by Zenoh, like a bridge, and by ROS 2, as a node.

Controlled by JSON lines, see `tests/ros/commands.py`. It runs in its own environment with rclpy and
eclipse-zenoh. Times are CLOCK_MONOTONIC in nanoseconds, the same clock in all processes of a machine.
"""

import contextlib
import json
import random
import socket
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any, Final, Protocol

import rclpy
import zenoh
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool, String
from zenoh.handlers import Callback

from tests.ros.commands import obey

ENABLED: Final = "/operation_enabled"
COMMAND: Final = "/operation1"
HEADER: Final = b"\x00\x01\x00\x00"  # CDR, little-endian
DEEP: Final = QoSProfile(depth=1000)
TICK_S: Final = 0.001


def text_of(number: int, size: int) -> str:
    """A text of at least `size` bytes that begins with its number."""
    return f"#{number:09d}#".ljust(size, "x")


class Way(Protocol):
    """A transport between the robot and the peers."""

    heard: list[tuple[int, str]]  # (time, text) of each command received

    def enable(self, value: bool) -> None: ...
    def offer(self, topic: str) -> None: ...
    def say(self, topic: str, text: str) -> None: ...
    def close(self) -> None: ...


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


class OverRos:
    """A ROS 2 node on rclpy."""

    def __init__(self) -> None:
        self.heard: list[tuple[int, str]] = []
        rclpy.init()
        self._node = rclpy.create_node("bench_robot")
        self._enabled = self._node.create_publisher(Bool, ENABLED, 10)
        self._texts: dict[str, Any] = {}
        self._node.create_subscription(String, COMMAND, self._hear, DEEP)
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(self._node)
        self._thread = threading.Thread(target=self._spin)
        self._thread.start()

    def _spin(self) -> None:
        with contextlib.suppress(ExternalShutdownException):
            self._executor.spin()

    def _hear(self, message: Any) -> None:
        self.heard.append((time.monotonic_ns(), message.data))

    def offer(self, topic: str) -> None:
        if topic not in self._texts:
            self._texts[topic] = self._node.create_publisher(String, topic, 10)

    def enable(self, value: bool) -> None:
        self._enabled.publish(Bool(data=value))

    def say(self, topic: str, text: str) -> None:
        self._texts[topic].publish(String(data=text))

    def close(self) -> None:
        self._executor.shutdown()
        self._thread.join()
        self._node.destroy_node()
        rclpy.shutdown()


class Load:
    """Publishes texts on several topics, at `hz` on each, until `end`."""

    def __init__(self, say: list[Callable[[str], None]], hz: float, size: int) -> None:
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


class Robot:
    """The commands of the harness; `way` is "zenoh", "ros", or another robot's namespace."""

    def __init__(self) -> None:
        first = OverZenoh()
        self._more: dict[str, OverZenoh] = {}
        self._ways: dict[str, Way] = {"zenoh": first, "ros": OverRos()}
        self._loads: list[Load] = []
        self._repeats: list[Repeat] = []
        self.locator = first.locator

    def robots(self, namespaces: list[str]) -> list[str]:
        """Runs further robots with these namespaces, and ends others; returns their locators."""
        for gone in set(self._more) - set(namespaces):
            self._more.pop(gone).close()
            self._ways.pop(gone)
        for namespace in namespaces:
            if namespace not in self._more:
                self._ways[namespace] = self._more[namespace] = OverZenoh(namespace)
        return [self._more[namespace].locator for namespace in namespaces]

    def offer(self, way: str, topics: list[str]) -> None:
        for topic in topics:
            self._ways[way].offer(topic)

    def enable(self, way: str, value: bool) -> int:
        at = time.monotonic_ns()
        self._ways[way].enable(value)
        return at

    def repeat(self, way: str, values: list[bool], period_s: float) -> None:
        """Publishes these permissions in turn, one per period, until `quiet`."""
        self._repeats.append(Repeat(self._ways[way].enable, values, period_s))

    def toggle(self, way: str, count: int, least_s: float, most_s: float) -> list[tuple[int, bool]]:
        """Publishes false and true in turn, at random intervals; returns (time, value) of each."""
        said = []
        for value in toggles(count):
            time.sleep(random.uniform(least_s, most_s))
            said.append((time.monotonic_ns(), value))
            self._ways[way].enable(value)
        return said

    def load(self, ways: list[str], topics: list[str], hz: float, size: int) -> None:
        def saying(way: str, topic: str) -> Callable[[str], None]:
            self._ways[way].offer(topic)
            return lambda text: self._ways[way].say(topic, text)

        says = [saying(way, topic) for way in ways for topic in topics]
        self._loads.append(Load(says, hz, size))

    def quiet(self) -> list[list[int]]:
        """Ends all repeats and loads; returns the times of each load's numbers."""
        for repeat in self._repeats:
            repeat.end()
        put_at = [load.end() for load in self._loads]
        self._repeats, self._loads = [], []
        return put_at

    def close(self) -> None:
        self.quiet()
        for way in self._ways.values():
            way.close()

    def heard(self, way: str) -> list[tuple[int, str]]:
        """The commands received since the last call."""
        all_of_them = self._ways[way].heard
        count = len(all_of_them)
        heard = all_of_them[:count]
        del all_of_them[:count]
        return heard


class Repeat:
    def __init__(self, enable: Callable[[bool], None], values: list[bool], period_s: float) -> None:
        self._ends = threading.Event()
        self._thread = threading.Thread(target=self._run, args=(enable, values, period_s), daemon=True)
        self._thread.start()

    def _run(self, enable: Callable[[bool], None], values: list[bool], period_s: float) -> None:
        turn = 0
        while not self._ends.wait(period_s):
            enable(values[turn % len(values)])
            turn += 1

    def end(self) -> None:
        self._ends.set()
        self._thread.join()


def toggles(count: int) -> Iterator[bool]:
    """False first, True last."""
    return (number % 2 == 1 for number in range(count - count % 2))


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


def main() -> None:
    robot = Robot()
    obey(robot, robot.locator)
    robot.close()


if __name__ == "__main__":
    main()
