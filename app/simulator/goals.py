"""The goals of a simulated action, of any type: pure, stepped with time.

Source: design.ros2.org ("Actions"), action_msgs/msg/GoalStatus, action_msgs/srv/CancelGoal.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Final, Protocol

from app.simulator.robot import (
    CANCEL_OK,
    CANCEL_TOO_LATE,
    CANCEL_UNKNOWN,
    CANCELED,
    EXECUTING,
    KEPT_GOALS,
    SUCCEEDED,
    DemoRobot,
)
from app.simulator.values.known_types import Moment
from app.simulator.values.paths import Fields

DURATION_S: Final = 8.0
FEEDBACK_S: Final = 0.4
EVERY_GOAL: Final = bytes(16)  # the id by which all goals are canceled


class ActionServer(Protocol):
    """A simulated action, as the peer asks it."""

    @property
    def type(self) -> str: ...
    def begin(self, goal_id: bytes, goal: Any) -> bool:
        """Accepts a goal, or rejects it."""

    def cancel(self, goal_id: bytes) -> tuple[int, list[bytes]]:
        """The return code and the goals of `action_msgs/srv/CancelGoal`."""

    def feedback(self) -> list[tuple[bytes, Fields]]:
        """The feedback since the last call, with the goal that it is of."""

    def states(self) -> list[tuple[bytes, int]]:
        """The goals that it knows, each with its status."""

    def result(self, goal_id: bytes) -> tuple[int, Fields] | None:
        """(status, result) of a goal that has ended, or is unknown (status 0); None until then."""


@dataclass(slots=True)
class _Goal:
    began: float
    feedback_at: float  # of the last feedback
    status: int = EXECUTING


class SimulatedAction:
    """Each goal runs for a time, sends feedback and succeeds; several may run at a time."""

    def __init__(
        self,
        type_name: str,
        feedback: Callable[[Moment, float], Fields],
        result: Callable[[Moment], Fields],
        duration_s: float | None = None,
    ) -> None:
        self.type = type_name
        self._feedback = feedback
        self._result = result
        self._duration_s = duration_s or DURATION_S
        self._goals: dict[bytes, _Goal] = {}
        self._now = Moment(0.0, 0)

    def step(self, moment: Moment) -> None:
        self._now = moment
        for goal in self._goals.values():
            if goal.status == EXECUTING and moment.t - goal.began >= self._duration_s:
                goal.status = SUCCEEDED

    def begin(self, goal_id: bytes, goal: Any) -> bool:
        if goal_id in self._goals:
            return False
        self._goals[goal_id] = _Goal(self._now.t, self._now.t)
        for old in list(self._goals)[:-KEPT_GOALS]:
            if self._goals[old].status != EXECUTING:
                del self._goals[old]
        return True

    def cancel(self, goal_id: bytes) -> tuple[int, list[bytes]]:
        running = [goal_id for goal_id, goal in self._goals.items() if goal.status == EXECUTING]
        if goal_id != EVERY_GOAL:
            if goal_id not in self._goals:
                return CANCEL_UNKNOWN, []
            if goal_id not in running:
                return CANCEL_TOO_LATE, []
            running = [goal_id]
        for canceled in running:
            self._goals[canceled].status = CANCELED
        return CANCEL_OK, running

    def feedback(self) -> list[tuple[bytes, Fields]]:
        moment, feedback = self._now, []
        for goal_id, goal in self._goals.items():
            if goal.status == EXECUTING and moment.t - goal.feedback_at >= FEEDBACK_S - 1e-6:
                goal.feedback_at = moment.t
                part = min((moment.t - goal.began) / self._duration_s, 1.0)
                feedback.append((goal_id, self._feedback(moment, part)))
        return feedback

    def states(self) -> list[tuple[bytes, int]]:
        return [(goal_id, goal.status) for goal_id, goal in self._goals.items()]

    def result(self, goal_id: bytes) -> tuple[int, Fields] | None:
        goal = self._goals.get(goal_id)
        if goal is None:
            return 0, {}
        return None if goal.status == EXECUTING else (goal.status, self._result(self._now))


class CountAction:
    """The count of the `system_controller`."""

    def __init__(self, type_name: str, robot: DemoRobot) -> None:
        self.type = type_name
        self._robot = robot

    def begin(self, goal_id: bytes, goal: Any) -> bool:
        return self._robot.begin(goal_id, goal.order)

    def cancel(self, goal_id: bytes) -> tuple[int, list[bytes]]:
        return self._robot.cancel(goal_id)

    def feedback(self) -> list[tuple[bytes, Fields]]:
        return [(goal_id, {"sequence": numbers}) for goal_id, numbers in self._robot.count()]

    def states(self) -> list[tuple[bytes, int]]:
        return self._robot.states()

    def result(self, goal_id: bytes) -> tuple[int, Fields] | None:
        ended = self._robot.result(goal_id)
        return None if ended is None else (ended[0], {"sequence": ended[1]})
