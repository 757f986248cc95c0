"""The robot of all peers: one process that publishes by Zenoh, like a bridge, by ROS 2, as a node, and
as a node on rmw_zenoh.

Controlled by JSON lines, see `tests/ros_nodes/commands.py`. It runs in its own environment with rclpy
and eclipse-zenoh. Times are CLOCK_MONOTONIC in nanoseconds, the same clock in all processes of a
machine.
"""

import random
import threading
import time
from collections.abc import Callable, Iterator

from bench.over_zenoh import Load, OverZenoh
from bench.ways import OverRmw, OverRos, Way
from tests.ros_nodes.commands import obey


class Robot:
    """The commands of the harness; `way` is "zenoh", "ros", "rmw", or another robot's namespace."""

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

    def join(self, router: str) -> None:
        """Begins the node on rmw_zenoh."""
        self.leave()
        self._ways["rmw"] = OverRmw(router)

    def leave(self) -> None:
        """Ends the node on rmw_zenoh."""
        if node := self._ways.pop("rmw", None):
            node.close()

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


def main() -> None:
    robot = Robot()
    obey(robot, robot.locator)
    robot.close()


if __name__ == "__main__":
    main()
