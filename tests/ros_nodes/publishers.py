"""Publishers of a Bool that come and go, each in a DDS participant of its own, driven by JSON lines.

`fast` makes them with rclpy, `cyclone` as rmw_cyclonedds does. With `times=1, keep_s=0.1` one is what
`ros2 topic pub --once` makes: it waits for a subscriber, publishes, and goes.
"""

import itertools
import os
import sys
import time
from collections.abc import Callable
from typing import Any

from commands import obey

MATCHED_WITHIN_S = 15.0
NUMBERS = itertools.count()


class Fast:
    """A node of rclpy, in a context of its own."""

    def __init__(self, topic: str, durability: str) -> None:
        import rclpy
        from rclpy.qos import DurabilityPolicy, QoSProfile
        from std_msgs.msg import Bool

        self._rclpy, self._bool = rclpy, Bool
        self._context = rclpy.Context()
        rclpy.init(context=self._context)
        self._node = rclpy.create_node(f"publisher_{next(NUMBERS)}", context=self._context)
        qos = QoSProfile(depth=1, durability=DurabilityPolicy[durability.upper()])
        self._publisher = self._node.create_publisher(Bool, topic, qos)
        self.subscribers: Callable[[], int] = self._publisher.get_subscription_count

    def publish(self, value: bool) -> None:
        self._publisher.publish(self._bool(data=value))

    def close(self) -> None:
        self._node.destroy_node()
        self._rclpy.shutdown(context=self._context)


class Cyclone:
    """A node on Cyclone DDS."""

    def __init__(self, topic: str, durability: str) -> None:
        from cyclone_node import Node, qos_of, subscribers
        from cyclone_types import Bool

        self._bool = Bool
        domain = int(os.environ["ROS_DOMAIN_ID"])
        self._node = Node(f"publisher_{next(NUMBERS)}", domain, lambda *_: None)
        self._writer = self._node.advertise(topic, Bool, qos_of(depth=1, durability=durability))
        self._node.start()
        self.subscribers: Callable[[], int] = lambda: subscribers(self._writer)

    def publish(self, value: bool) -> None:
        self._writer.write(self._bool(value))

    def close(self) -> None:
        self._node.close()


class Commands:
    def __init__(self, make: type[Fast] | type[Cyclone]) -> None:
        self._make = make
        self._publisher: Any = None

    def begin(
        self,
        topic: str,
        value: bool,
        times: int = 1,
        period_s: float = 0.1,
        durability: str = "volatile",
        matched: bool = True,
    ) -> None:
        """A new publisher: it publishes so often, after it has a subscriber where `matched`."""
        self._publisher = self._make(topic, durability)
        end = time.monotonic() + MATCHED_WITHIN_S
        while matched and self._publisher.subscribers() == 0:
            if time.monotonic() > end:
                raise TimeoutError(f"no node subscribes to {topic}")
            time.sleep(0.1)  # as the command line looks
        for number in range(times):
            time.sleep(period_s if number else 0)
            self._publisher.publish(value)

    def finish(self, after_s: float = 0.1) -> None:
        """The publisher goes."""
        time.sleep(after_s)
        self._publisher.close()


if __name__ == "__main__":
    obey(Commands({"fast": Fast, "cyclone": Cyclone}[sys.argv[1]]))
