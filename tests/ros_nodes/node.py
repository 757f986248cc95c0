"""A ROS 2 node (rclpy) for the tests, driven by JSON lines: see `commands.py`.

It runs in an environment of its own, with rclpy and nothing of the kiosk. What a subscription hears is
kept until `heard` asks.
"""

import contextlib
import itertools
import queue
import re
import sys
import threading
import time
from collections.abc import Callable
from importlib import import_module
from typing import Any

import rclpy
from commands import obey
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.qos import DurabilityPolicy, QoSProfile, ReliabilityPolicy
from rclpy.serialization import serialize_message
from type_description_interfaces.srv import GetTypeDescription

GONE_S = 20.0  # within which what is destroyed is gone


def type_named(name: str) -> Any:
    package, kind, message = name.split("/")
    return getattr(import_module(f"{package}.{kind}"), message)


def fields_of(value: Any) -> Any:
    """A message as plain JSON values."""
    if hasattr(value, "get_fields_and_field_types"):
        return {name: fields_of(getattr(value, name)) for name in value.get_fields_and_field_types()}
    if isinstance(value, (str, bool, int, float)):
        return value
    return [fields_of(item) for item in value]


def filled(message: Any, fields: dict[str, Any]) -> Any:
    types = message.get_fields_and_field_types()
    for name, value in fields.items():
        setattr(message, name, made(getattr(message, name), value, types[name]))
    return message


def made(inner: Any, value: Any, type_name: str) -> Any:
    """A field from its JSON value; its type is named as rclpy names it."""
    if isinstance(value, dict):
        return filled(inner, value)
    if type_name == "octet":
        return bytes([value])
    if isinstance(value, list) and value and isinstance(value[0], dict):
        package, _, name = type_name.removeprefix("sequence<").partition("/")
        element = type_named(f"{package}/msg/{re.split('[,>]', name)[0]}")
        return [filled(element(), item) for item in value]
    return value


def qos_of(settings: dict[str, Any]) -> QoSProfile:
    return QoSProfile(
        depth=settings.get("depth", 10),
        durability=DurabilityPolicy[settings.get("durability", "volatile").upper()],
        reliability=ReliabilityPolicy[settings.get("reliability", "reliable").upper()],
    )


class Commands:
    def __init__(self, name: str) -> None:
        self.node = rclpy.create_node(name)
        self.executor = SingleThreadedExecutor()
        self.executor.add_node(self.node)
        self.heard_on: dict[str, list[dict[str, Any]]] = {}
        self.subscribed: set[tuple[str, str]] = set()
        self.came_at: dict[str, list[float]] = {}
        self.publishers: dict[str, Any] = {}
        self.timers: dict[str, Any] = {}
        self.requests: dict[str, list[dict[str, Any]]] = {}

    def subscribe(self, topic: str, type: str, **qos: Any) -> None:
        """Once, however many files of tests ask for it: each subscription would hear each message."""
        if (topic, type) in self.subscribed:
            return
        self.subscribed.add((topic, type))
        heard = self.heard_on.setdefault(topic, [])
        came_at = self.came_at.setdefault(topic, [])

        def hear(message: Any) -> None:
            came_at.append(time.monotonic())  # the same clock in all processes of one machine
            heard.append(fields_of(message))

        self.node.create_subscription(type_named(type), topic, hear, qos_of(qos))

    def heard(self, topic: str) -> list[dict[str, Any]]:
        return self.heard_on[topic]

    def heard_at(self, topic: str) -> list[float]:
        return self.came_at[topic]

    def arrivals(self, topic: str) -> list[tuple[float, Any]]:
        """(monotonic seconds of this machine, the `data` field) of all that was heard."""
        heard = [message["data"] for message in self.heard_on[topic]]
        return list(zip(self.came_at[topic], heard, strict=False))

    def advertise(self, topic: str, type: str, **qos: Any) -> None:
        if topic in self.publishers:  # the node would keep it for good
            self.withdraw(topic)
        self.publishers[topic] = self.node.create_publisher(type_named(type), topic, qos_of(qos))

    def publish(self, topic: str, fields: dict[str, Any]) -> None:
        publisher = self.publishers[topic]
        publisher.publish(filled(publisher.msg_type(), fields))

    def flood(self, topic: str, fields: dict[str, Any], per_s: float, for_s: float) -> int:
        """Publishes so often for so long, or as often as it can; returns how many went out.

        `{n}` in a text is the number of the message.
        """
        publisher = self.publishers[topic]
        began = time.monotonic()
        sent = 0
        while (spent := time.monotonic() - began) < for_s:
            if sent < spent * per_s:
                numbered = {
                    name: value.format(n=sent) if isinstance(value, str) else value
                    for name, value in fields.items()
                }
                publisher.publish(filled(publisher.msg_type(), numbered))
                sent += 1
            else:
                time.sleep(0.0005)
        return sent

    def publish_long(self, topic: str, length: int) -> None:
        """A text of so many characters."""
        self.publish(topic, {"data": "x" * length})

    def serve(self, service: str, type: str, response: dict[str, Any]) -> None:
        """Offers a service that answers each request with these fields; once for each name."""
        if service in self.requests:
            return
        requests = self.requests[service] = []

        def answer(request: Any, made: Any) -> Any:
            requests.append(fields_of(request))
            return filled(made, response)

        self.node.create_service(type_named(type), service, answer)

    def requested(self, service: str) -> list[dict[str, Any]]:
        return self.requests[service]

    def every(self, topic: str, fields: dict[str, Any], period_s: float) -> None:
        self.timers[topic] = self.node.create_timer(period_s, lambda: self.publish(topic, fields))

    def film(self, topic: str, width: int, height: int, hz: float) -> None:
        """A raw colour picture, made once; each one that goes out has its number in the first bytes."""
        publisher = self.publishers[topic]
        message = publisher.msg_type()
        message.width, message.height, message.encoding = width, height, "rgb8"
        message.step = 3 * width
        message.data = bytes(at % 251 for at in range(3 * width * height))
        numbers = itertools.count()

        def take() -> None:
            message.data[0] = next(numbers) % 256
            publisher.publish(message)

        self.timers[topic] = self.node.create_timer(1 / hz, take)

    def once(self, topic: str, type: str, fields: dict[str, Any], timeout_s: float = 15) -> None:
        """`ros2 topic pub --once`: advertise, wait for a subscriber, publish, go away.

        Like that tool, it lets some time pass between the match and the message: a reader that
        has not discovered this writer yet would miss it, whatever reads.
        """
        self.advertise(topic, type)
        publisher = self.publishers[topic]
        end = time.monotonic() + timeout_s
        while publisher.get_subscription_count() == 0:
            if time.monotonic() > end:
                raise TimeoutError(f"no node subscribes to {topic}")
            time.sleep(0.01)
        time.sleep(0.3)
        self.publish(topic, fields)
        time.sleep(0.1)
        self.withdraw(topic)

    def toggle(self, topic: str, per_s: float, for_s: float) -> int:
        """Publishes true and false in turn, so often for so long; returns how many went out."""
        publisher = self.publishers[topic]
        began, sent = time.monotonic(), 0
        while (spent := time.monotonic() - began) < for_s:
            if sent < spent * per_s:
                publisher.publish(filled(publisher.msg_type(), {"data": sent % 2 == 0}))
                sent += 1
            else:
                time.sleep(0.0005)
        return sent

    def describe(self, type: str, hash: str, timeout_s: float = 15) -> str:
        """What the node's own `get_type_description` answers, as the hexadecimal digits of its CDR."""
        service = f"/{self.node.get_name()}/get_type_description"
        client = self.node.create_client(GetTypeDescription, service)
        try:
            if not client.wait_for_service(timeout_s):
                raise TimeoutError(f"{service} is not there")
            request = GetTypeDescription.Request(type_name=type, type_hash=hash)
            answered = threading.Event()
            answer = client.call_async(request)
            answer.add_done_callback(lambda _: answered.set())
            if not answered.wait(timeout_s):
                raise TimeoutError(f"{service} does not answer")
            return serialize_message(answer.result()).hex()
        finally:
            self._destroy_on_spin_thread(self.node.destroy_client, client)

    def withdraw(self, topic: str) -> None:
        timer = self.timers.pop(topic, None)
        if timer is not None:
            self._destroy_on_spin_thread(self.node.destroy_timer, timer)
        self._destroy_on_spin_thread(self.node.destroy_publisher, self.publishers.pop(topic))

    def _destroy_on_spin_thread(self, destroy: Callable[[Any], Any], entity: Any) -> None:
        """Destroyed elsewhere, an entity that is waited for ends the spinning with an exception."""
        results: queue.SimpleQueue[Exception | None] = queue.SimpleQueue()

        def work() -> None:
            try:
                destroy(entity)
            except Exception as error:
                results.put(error)
            else:
                results.put(None)

        self.executor.create_task(work)
        if error := results.get(timeout=GONE_S):
            raise error

    def subscribers(self, topic: str) -> int:
        return int(self.publishers[topic].get_subscription_count())

    def nodes(self) -> list[str]:
        return [f"{ns.rstrip('/')}/{name}" for name, ns in self.node.get_node_names_and_namespaces()]

    def topics(self) -> dict[str, list[str]]:
        return dict(self.node.get_topic_names_and_types())

    def endpoints(self, topic: str) -> list[dict[str, Any]]:
        return [
            {
                "node": info.node_name,
                "type": info.topic_type,
                "hash": str(info.topic_type_hash),
                "reliability": info.qos_profile.reliability.name.lower(),
                "durability": info.qos_profile.durability.name.lower(),
            }
            for info in self.node.get_publishers_info_by_topic(topic)
        ]


def main() -> None:
    rclpy.init()
    commands = Commands(sys.argv[1])

    def spin() -> None:
        with contextlib.suppress(ExternalShutdownException):
            commands.executor.spin()

    spinning = threading.Thread(target=spin)
    spinning.start()
    obey(commands)
    rclpy.shutdown()  # ends the spinning too
    spinning.join()
    commands.node.destroy_node()


if __name__ == "__main__":
    main()
