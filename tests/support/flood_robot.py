"""A robot that floods the panel with alarms, as a process of its own: `python -m
tests.support.flood_robot`. It prints its endpoint.

`/level` (Float64) is 6, and falls below every limit of the panel's alarms with the limit 5 when the
parent process writes a line to its standard input, then rises again with the next line. `/diagnostics`
has `STATUSES` statuses at 10 Hz, with values that change each time; each second another tenth of them
is not OK.
"""

import sys
from collections.abc import Iterable, Mapping
from typing import Any, Final

from app.ros.messages import load_interfaces
from app.tools.simulator.known_types import Moment
from app.tools.simulator.robot import ActionServer, SimulatedTopic
from app.tools.simulator.zenoh import ANY_PORT, Simulator

STATUSES: Final = 300
STEP_S: Final = 0.1
LEVEL: Final = "std_msgs/msg/Float64"
DIAGNOSTICS: Final = "diagnostic_msgs/msg/DiagnosticArray"
BOOL: Final = "std_msgs/msg/Bool"


class FloodRobot:
    """See `app.tools.simulator.robot.SimulatedRobot`."""

    step_s = STEP_S
    services: Mapping[str, str] = {}
    actions: Mapping[str, ActionServer] = {}
    publishes: Mapping[str, SimulatedTopic] = {
        "/level": SimulatedTopic(LEVEL),
        "/permit": SimulatedTopic(BOOL),
        "/diagnostics": SimulatedTopic(DIAGNOSTICS),
    }
    subscribes: Mapping[str, SimulatedTopic] = {
        "/pressed": SimulatedTopic(BOOL),
        "/held": SimulatedTopic(BOOL),
    }

    def __init__(self) -> None:
        self.interfaces = load_interfaces("jazzy")
        self.is_low = False
        self.diagnoses = False
        self._steps = 0

    def receive(self, topic: str, payload: bytes) -> None:
        """Nothing happens."""

    def serve(self, service: str, payload: bytes) -> bytes | None:
        return None

    def step(self, moment: Moment) -> Iterable[tuple[str, bytes]]:
        self._steps += 1
        level = {"data": 4.0 if self.is_low else 6.0}
        yield "/permit", self.interfaces.encode(BOOL, {"data": True})
        yield "/level", self.interfaces.encode(LEVEL, level)
        if self.diagnoses:
            statuses = [self._status(number) for number in range(STATUSES)]
            yield "/diagnostics", self.interfaces.encode(DIAGNOSTICS, {"status": statuses})

    def _status(self, number: int) -> dict[str, Any]:
        is_wrong = (number + self._steps // 10) % 10 == 0
        values = [{"key": f"value {i}", "value": f"{self._steps + i}"} for i in range(5)]
        name = f"part {number}"
        message = "too warm" if is_wrong else "OK"
        return {
            "level": int(is_wrong),
            "name": name,
            "message": message,
            "hardware_id": name,
            "values": values,
        }


def main() -> None:
    robot = FloodRobot()
    with Simulator(ANY_PORT, {"": robot}, robot.interfaces) as simulator:
        print(simulator.endpoint, flush=True)
        for line in sys.stdin:
            match line.strip():
                case "low":
                    robot.is_low = True
                case "high":
                    robot.is_low = False
                case "diagnostics":
                    robot.diagnoses = not robot.diagnoses


if __name__ == "__main__":
    main()
