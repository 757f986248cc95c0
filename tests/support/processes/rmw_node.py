"""A ROS 2 node on rmw_zenoh for the tests, driven by the same JSON lines as `tests/ros_nodes/node.py`:
`python -m tests.support.processes.rmw_node NAME ENDPOINT [DOMAIN]`.

It is made of eclipse-zenoh alone. Key expressions, tokens, attachments and hashes are its own, so that
an error of the panel's is none of this node's too. As a real node it ends at what is not whole: it
answers no command any more.
"""

import hashlib
import itertools
import struct
import sys
import threading
import time
from collections.abc import Callable, Iterator
from functools import cache
from typing import Any

import zenoh
from rosbags.typesys import Stores, get_typestore
from zenoh.ext import (
    CacheConfig,
    HistoryConfig,
    MissDetectionConfig,
    RecoveryConfig,
    declare_advanced_publisher,
    declare_advanced_subscriber,
)
from zenoh.handlers import Callback

from app.ros.messages import Interfaces
from tests.ros_nodes.commands import obey

INTERFACES = Interfaces("jazzy")
TYPES = get_typestore(Stores.ROS2_JAZZY)
RELIABILITY = {"": "reliable", "0": "reliable", "1": "reliable", "2": "best_effort"}
DURABILITY = {"": "volatile", "0": "volatile", "1": "transient_local", "2": "volatile"}


def fields_of(value: Any) -> Any:
    """A message as plain JSON values."""
    if isinstance(value, (str, bool, int, float)):
        return value
    if hasattr(value, "__dataclass_fields__"):
        return {name: fields_of(getattr(value, name)) for name in value.__dataclass_fields__}
    if hasattr(value, "__slots__"):
        return {name: fields_of(getattr(value, name)) for name in value.__slots__}
    return [fields_of(item) for item in value]


@cache
def place(type_name: str) -> str:
    """`<type>/<hash>`, as rmw_zenoh's key expressions end."""
    package, kind, name = type_name.split("/")
    return f"{package}::{kind}::dds_::{name}_/{TYPES.hash_rihs01(type_name)}"


class Broken(Exception):
    """Something that ends a node."""


def read_attachment(data: bytes) -> tuple[int, int, bytes]:
    """(number, time, gid) as rmw_zenoh's deserializer takes them."""
    number, at_ns = struct.unpack_from("<qq", data)
    if number < 0 or at_ns < 0 or data[16] != 16 or len(data) != 33:
        raise Broken(f"attachment {data.hex()}")
    return number, at_ns, data[17:]


class Publisher:
    def __init__(self, node: "Commands", topic: str, type_name: str, qos: dict[str, Any]) -> None:
        self.type, self._numbers = type_name, itertools.count(1)
        expression = f"{node.domain}{topic}/{place(type_name)}"
        self._declared: Any
        if qos.get("durability") == "transient_local":
            self._declared = declare_advanced_publisher(
                node.session,
                expression,
                cache=CacheConfig(max_samples=qos.get("depth", 10)),
                publisher_detection=True,
                sample_miss_detection=MissDetectionConfig(heartbeat=None, sporadic_heartbeat=0.5),
            )
        else:
            self._declared = node.session.declare_publisher(expression)
        self._token = node.token("MP", topic, type_name, qos)
        self._gid = hashlib.md5(self._token[0].encode()).digest()

    def put(self, fields: dict[str, Any], instead: str | None = None) -> None:
        """`instead` is another attachment, in hexadecimal digits; "" for none."""
        attachment = struct.pack("<qqB16s", next(self._numbers), time.time_ns(), 16, self._gid)
        attached = attachment if instead is None else bytes.fromhex(instead) or None
        self._declared.put(INTERFACES.encode(self.type, fields), attachment=attached)

    def end(self) -> None:
        self._token[1].undeclare()
        self._declared.undeclare()


class Commands:
    def __init__(self, name: str, endpoint: str, domain: int = 0) -> None:
        self.name, self.domain = name, domain
        config = zenoh.Config()
        for path, value in {
            "mode": '"peer"',
            "listen/endpoints": '["tcp/localhost:0"]',
            "connect/endpoints": f'["{endpoint}"]',
            "scouting/multicast/enabled": "false",
            "timestamping/enabled": "true",
            "adminspace/enabled": "true",
        }.items():
            config.insert_json5(path, value)
        self.session = zenoh.open(config)
        self.zid = str(self.session.zid())
        self._ids = itertools.count(1)
        self._tokens: set[str] = set()
        self._watch = self.session.liveliness().declare_subscriber(
            f"@ros2_lv/{domain}/**", Callback(self._see, indirect=False), history=True
        )
        self._kept: list[Any] = [
            self.session.liveliness().declare_token(f"@ros2_lv/{domain}/{self.zid}/0/0/NN/%/%/{name}")
        ]
        self.heard_on: dict[str, list[dict[str, Any]]] = {}
        self.subscribed: set[tuple[str, str]] = set()
        self.came_at: dict[str, list[float]] = {}
        self.publishers: dict[str, Publisher] = {}
        self.timers: dict[str, threading.Event] = {}
        self.broken_by: list[str] = []

    def _see(self, sample: zenoh.Sample) -> None:
        change = self._tokens.add if sample.kind == zenoh.SampleKind.PUT else self._tokens.discard
        change(str(sample.key_expr))

    def _parts(self) -> list[list[str]]:
        """The parts of each token that is there."""
        return [token.split("/") for token in sorted(self._tokens)]

    def token(
        self, kind: str, topic: str, type_name: str, qos: dict[str, Any]
    ) -> tuple[str, zenoh.LivelinessToken]:
        reliability = "2" if qos.get("reliability") == "best_effort" else ""
        durability = "1" if qos.get("durability") == "transient_local" else ""
        text = (
            f"@ros2_lv/{self.domain}/{self.zid}/0/{next(self._ids)}/{kind}/%/%/{self.name}"
            f"/{topic.replace('/', '%')}/{place(type_name)}"
            f"/{reliability}:{durability}:,{qos.get('depth', 10)}:,:,:,,"
        )
        return text, self.session.liveliness().declare_token(text)

    def _whole(self, read: Callable[[zenoh.Sample], None]) -> Callable[[zenoh.Sample], None]:
        def take(sample: zenoh.Sample) -> None:
            try:
                if sample.kind != zenoh.SampleKind.PUT or sample.attachment is None:
                    raise Broken(f"{sample.kind} on {sample.key_expr}")
                read_attachment(sample.attachment.to_bytes())
                read(sample)
            except Exception as error:  # a real node ends by it
                self.broken_by.append(f"{type(error).__name__}: {error}")

        return take

    def broken(self) -> list[str]:
        """What would have ended the node."""
        return self.broken_by

    def hold(self, token: str) -> None:
        """Holds one more liveliness token."""
        self._kept.append(self.session.liveliness().declare_token(token))

    def subscribe(self, topic: str, type: str, **qos: Any) -> None:
        if (topic, type) in self.subscribed:
            return
        self.subscribed.add((topic, type))
        heard = self.heard_on.setdefault(topic, [])
        came_at = self.came_at.setdefault(topic, [])

        def hear(sample: zenoh.Sample) -> None:
            came_at.append(time.monotonic())
            heard.append(fields_of(INTERFACES.decode(type, sample.payload.to_bytes())))

        expression = f"{self.domain}{topic}/{place(type)}"
        handler = Callback(self._whole(hear), indirect=False)
        if qos.get("durability") == "transient_local":
            declared: Any = declare_advanced_subscriber(
                self.session,
                expression,
                handler,
                history=HistoryConfig(detect_late_publishers=True, max_samples=1),
                recovery=RecoveryConfig(periodic_queries=None, heartbeat=True),
                subscriber_detection=True,
            )
        else:
            declared = self.session.declare_subscriber(expression, handler)
        self._kept += [declared, self.token("MS", topic, type, qos)[1]]

    def heard(self, topic: str) -> list[dict[str, Any]]:
        return self.heard_on[topic]

    def heard_at(self, topic: str) -> list[float]:
        return self.came_at[topic]

    def arrivals(self, topic: str) -> list[tuple[float, Any]]:
        heard = [message["data"] for message in self.heard_on[topic]]
        return list(zip(self.came_at[topic], heard, strict=False))

    def advertise(self, topic: str, type: str, **qos: Any) -> None:
        if topic in self.publishers:
            self.withdraw(topic)
        self.publishers[topic] = Publisher(self, topic, type, qos)

    def publish(self, topic: str, fields: dict[str, Any], instead: str | None = None) -> None:
        self.publishers[topic].put(fields, instead)

    def every(self, topic: str, fields: dict[str, Any], period_s: float) -> None:
        ends = self.timers[topic] = threading.Event()

        def run() -> None:
            while not ends.wait(period_s):
                self.publish(topic, fields)

        threading.Thread(target=run, daemon=True).start()

    def once(self, topic: str, type: str, fields: dict[str, Any], timeout_s: float = 15) -> None:
        """`ros2 topic pub --once`: advertise, wait for a subscriber, publish, go away."""
        self.advertise(topic, type)
        end = time.monotonic() + timeout_s
        while self.subscribers(topic) == 0:
            if time.monotonic() > end:
                raise TimeoutError(f"no node subscribes to {topic}")
            time.sleep(0.01)
        time.sleep(0.1)
        self.publish(topic, fields)
        time.sleep(0.1)
        self.withdraw(topic)

    def withdraw(self, topic: str) -> None:
        if (timer := self.timers.pop(topic, None)) is not None:
            timer.set()
        self.publishers.pop(topic).end()

    def subscribers(self, topic: str) -> int:
        return len(list(self._of_topic(topic, "MS")))

    def nodes(self) -> list[str]:
        nodes = [parts for parts in self._parts() if parts[5] == "NN"]
        return [f"{parts[7].replace('%', '/').rstrip('/')}/{parts[8]}" for parts in nodes]

    def topics(self) -> dict[str, list[str]]:
        known: dict[str, set[str]] = {}
        for parts in self._parts():
            if parts[5] in ("MP", "MS"):
                name = parts[10].removesuffix("_").replace("::dds_::", "/").replace("::", "/")
                known.setdefault(parts[9].replace("%", "/"), set()).add(name)
        return {topic: sorted(types) for topic, types in known.items()}

    def clients(self) -> list[str]:
        """The services of which a client is there."""
        clients = [parts for parts in self._parts() if parts[5] == "SC"]
        return sorted(parts[9].replace("%", "/") for parts in clients)

    def endpoints(self, topic: str) -> list[dict[str, Any]]:
        """The publishers of a topic."""
        return [
            {
                "node": parts[8],
                "type": parts[10].removesuffix("_").replace("::dds_::", "/").replace("::", "/"),
                "hash": parts[11],
                "reliability": RELIABILITY[parts[12].split(":")[0]],
                "durability": DURABILITY[parts[12].split(":")[1]],
            }
            for parts in self._of_topic(topic, "MP")
        ]

    def _of_topic(self, topic: str, kind: str) -> Iterator[list[str]]:
        for parts in self._parts():
            if parts[5] == kind and parts[9].replace("%", "/") == topic:
                yield parts

    def close(self) -> None:
        self.session.close()


def main() -> None:
    name, endpoint, *more = sys.argv[1:]
    commands = Commands(name, endpoint, int(more[0]) if more else 0)
    obey(commands)
    commands.close()


if __name__ == "__main__":
    main()
