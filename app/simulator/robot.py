"""What the demo robot does, with the time given: pure, so that it can be stepped.

A `system_controller` that permits and forbids operation in turns, echoes what it heard, has a
light, can be reset, counts Fibonacci numbers as an action, and has parameters.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from app.panel.number_range import Range
from app.simulator.parameters import (
    BOOL,
    DOUBLE,
    EVENTS,
    INTEGER,
    NODE,
    STRING,
    NodeParameters,
    Parameter,
)

PERMITTED_S: Final = 20.0
FORBIDDEN_S: Final = 8.0
REPEAT_S: Final = 1.0
COUNT_STEP_S: Final = 0.5
LONGEST_COUNT: Final = 40  # int32 holds no more
KEPT_GOALS: Final = 20

TEXT: Final = "std_msgs/msg/String"
FLAG: Final = "std_msgs/msg/Bool"
LISTENS: Final = {"/operation": TEXT, "/operation1": TEXT, "/operation2": TEXT}
SPEAKS: Final = {"/operation_enabled": FLAG, "/last_heard": TEXT}
SERVES: Final = {"/light": "std_srvs/srv/SetBool", "/reset": "std_srvs/srv/Trigger"}
COUNT: Final = "/count"
COUNT_TYPE: Final = "example_interfaces/action/Fibonacci"

# action_msgs/msg/GoalStatus
EXECUTING, SUCCEEDED, CANCELED = 2, 4, 5
# action_msgs/srv/CancelGoal_Response
CANCEL_OK, CANCEL_UNKNOWN, CANCEL_TOO_LATE = 0, 2, 3

Message = tuple[str, Mapping[str, Any]]
Fields = dict[str, Any]


def own_parameters() -> dict[str, Parameter]:
    """The parameters of the `system_controller`, as at its start."""
    return {
        "speed": Parameter(DOUBLE, 120.0, limits=Range(0.0, 500.0, 10.0)),
        "parts": Parameter(INTEGER, 24, "in a batch", Range(1, 200, 1)),
        "work_light": Parameter(BOOL, False, "follows the door"),
        "batch": Parameter(STRING, "A-17", "printed on the label", empty="a batch needs a name"),
        "serial": Parameter(STRING, "DEMO-0001", "from the factory", read_only=True),
    }


@dataclass(slots=True)
class Goal:
    """A count under way or ended; `next_at` is when its next number comes."""

    order: int
    next_at: float
    sequence: list[int] = field(default_factory=lambda: [0, 1])
    status: int = EXECUTING


def echoed(topic: str, text: str) -> str:
    """The text that it publishes about a received one."""
    return f"{text} ({topic})"


class DemoRobot:
    """The robot: `step` it with the time (seconds, monotonic), and let it hear and serve."""

    def __init__(self) -> None:
        self._began: float | None = None
        self._now = 0.0
        self._published: tuple[bool, float] | None = None
        self._heard: list[Message] = []
        self._goals: dict[bytes, Goal] = {}
        self.parameters = NodeParameters(NODE, own_parameters())

    @property
    def permits(self) -> bool:
        """Whether it permits operation at the time of the last step."""
        began = self._now if self._began is None else self._began
        return (self._now - began) % (PERMITTED_S + FORBIDDEN_S) < PERMITTED_S

    def hear(self, topic: str, text: str) -> None:
        self._heard.append(("/last_heard", {"data": echoed(topic, text)}))

    def serve(self, service: str, request: Any) -> Fields:
        """The response of one of `SERVES`."""
        if service == "/light":
            return {"success": True, "message": f"the light is {'on' if request.data else 'off'}"}
        if self.permits:
            return {"success": True, "message": "reset"}
        return {"success": False, "message": "not while operation is forbidden"}

    def step(self, now: float) -> list[Message]:
        """The messages that it publishes at `now`, as (topic, fields)."""
        if self._began is None:
            self._began = now
        self._now = now
        said, self._heard = self._heard, []
        said += [(EVENTS, event) for event in self.parameters.news()]
        if (
            self._published is None
            or self._published[0] != self.permits
            or now - self._published[1] >= REPEAT_S
        ):
            self._published = (self.permits, now)
            said.append(("/operation_enabled", {"data": self.permits}))
        return said

    def begin(self, goal_id: bytes, order: int) -> bool:
        """Accepts a goal to count to, or rejects it."""
        if goal_id in self._goals or not 0 < order <= LONGEST_COUNT:
            return False
        self._goals[goal_id] = Goal(order, self._now + COUNT_STEP_S)
        for old in list(self._goals)[:-KEPT_GOALS]:
            if self._goals[old].status != EXECUTING:
                del self._goals[old]
        return True

    def cancel(self, goal_id: bytes) -> tuple[int, list[bytes]]:
        """The return code and the goals of `action_msgs/srv/CancelGoal`.

        A count before its last number refuses as a node of rclpy does: with no goal in the list.
        """
        goal = self._goals.get(goal_id)
        if goal is None:
            return CANCEL_UNKNOWN, []
        if goal.status != EXECUTING:
            return CANCEL_TOO_LATE, []
        if len(goal.sequence) >= goal.order:
            return CANCEL_OK, []
        goal.status = CANCELED
        return CANCEL_OK, [goal_id]

    def count(self) -> list[tuple[bytes, list[int]]]:
        """The goals that have a new number since the last call, each with its numbers so far."""
        news = []
        for goal_id, goal in self._goals.items():
            if goal.status == EXECUTING and self._now >= goal.next_at:
                goal.next_at += COUNT_STEP_S
                goal.sequence.append(goal.sequence[-1] + goal.sequence[-2])
                news.append((goal_id, list(goal.sequence)))
                if len(goal.sequence) > goal.order:
                    goal.status = SUCCEEDED
        return news

    def states(self) -> list[tuple[bytes, int]]:
        """The goals that it knows, each with its status."""
        return [(goal_id, goal.status) for goal_id, goal in self._goals.items()]

    def result(self, goal_id: bytes) -> tuple[int, list[int]] | None:
        """(status, numbers) of a goal that has ended, or is unknown (status 0); None until then."""
        goal = self._goals.get(goal_id)
        if goal is None:
            return 0, []
        return None if goal.status == EXECUTING else (goal.status, goal.sequence)
