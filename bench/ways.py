"""How the benchmark's robot reaches the peers: by Zenoh like a bridge, as a ROS 2 node on DDS, and as a
node on rmw_zenoh."""

import contextlib
import hashlib
import itertools
import struct
import threading
import time
from typing import Any, Final, Protocol

import rclpy
import zenoh
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import QoSProfile
from std_msgs.msg import Bool, String
from zenoh.handlers import Callback

from bench.over_zenoh import COMMAND, ENABLED, HEADER, listening

DEEP: Final = QoSProfile(depth=1000)
# Types and hashes, as rmw_zenoh's key expressions end.
TYPES: Final = {
    "Bool": "std_msgs::msg::dds_::Bool_/RIHS01_"
    "feb91e995ff9ebd09c0cb3d2aed18b11077585839fb5db80193b62d74528f6c9",
    "String": "std_msgs::msg::dds_::String_/RIHS01_"
    "df668c740482bbd48fb39d76a70dfd4bd59db1288021743503259e948f6b1a18",
}


class Way(Protocol):
    """A transport between the robot and the peers."""

    heard: list[tuple[int, str]]  # (time, text) of each command received

    def enable(self, value: bool) -> None: ...
    def offer(self, topic: str) -> None: ...
    def say(self, topic: str, text: str) -> None: ...
    def close(self) -> None: ...


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


class OverRmw:
    """A node on rmw_zenoh, of the domain 0: its keys, tokens and attachments. `router` is its router's
    locator."""

    def __init__(self, router: str) -> None:
        self.heard: list[tuple[int, str]] = []
        config = listening("tcp/127.0.0.1:0")
        config.insert_json5("connect/endpoints", f'["{router}"]')
        self._session = zenoh.open(config)
        self._node = f"@ros2_lv/0/{self._session.zid()}/0"
        self._ids = itertools.count(1)
        self._publishers: dict[str, Any] = {}
        self._kept = [
            self._session.liveliness().declare_token(f"{self._node}/0/NN/%/%/bench_robot"),
            self._session.declare_subscriber(
                f"0{COMMAND}/{TYPES['String']}", Callback(self._hear, indirect=False)
            ),
            self._session.liveliness().declare_token(self._token("MS", COMMAND, "String")),
        ]
        self._offer(ENABLED, "Bool")

    def _hear(self, sample: zenoh.Sample) -> None:
        at = time.monotonic_ns()
        self.heard.append((at, sample.payload.to_bytes()[8:].split(b"\0")[0].decode()))

    def _token(self, role: str, topic: str, type_name: str) -> str:
        place = f"{topic.replace('/', '%')}/{TYPES[type_name]}"
        return f"{self._node}/{next(self._ids)}/{role}/%/%/bench_robot/{place}/::,10:,:,:,,"

    def _offer(self, topic: str, type_name: str) -> None:
        if topic not in self._publishers:
            token = self._token("MP", topic, type_name)
            publisher = self._session.declare_publisher(
                f"0{topic}/{TYPES[type_name]}",
                congestion_control=zenoh.CongestionControl.DROP,
                express=True,
            )
            gid = hashlib.md5(token.encode()).digest()
            self._publishers[topic] = (publisher, itertools.count(1), gid)
            self._kept.append(self._session.liveliness().declare_token(token))

    def _put(self, topic: str, payload: bytes) -> None:
        publisher, numbers, gid = self._publishers[topic]
        attachment = struct.pack("<qqB16s", next(numbers), time.time_ns(), len(gid), gid)
        publisher.put(HEADER + payload, attachment=attachment)

    def offer(self, topic: str) -> None:
        self._offer(topic, "String")

    def enable(self, value: bool) -> None:
        self._put(ENABLED, bytes([value]))

    def say(self, topic: str, text: str) -> None:
        data = text.encode() + b"\0"
        self._put(topic, len(data).to_bytes(4, "little") + data)

    def close(self) -> None:
        self._session.close()
