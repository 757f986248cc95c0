"""The action server /fibonacci, with goals that run side by side and end as a test wants."""

import threading
import time
from dataclasses import dataclass, field
from typing import Any

from cyclone_node import Answer, Node, qos_of
from cyclone_types import (
    UUID,
    CancelGoal_Request,
    CancelGoal_Response,
    Fibonacci_FeedbackMessage,
    Fibonacci_GetResult_Request,
    Fibonacci_GetResult_Response,
    Fibonacci_SendGoal_Request,
    Fibonacci_SendGoal_Response,
    GoalInfo,
    GoalStatus,
    GoalStatusArray,
    Time,
)

UNKNOWN, ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(7)
ENDS = (SUCCEEDED, CANCELED, ABORTED)
CANCEL_OK, CANCEL_REFUSED, CANCEL_UNKNOWN_ID, CANCEL_ENDED = range(4)
EVERY_GOAL = bytes(16)

STATUS_HASH = "RIHS01_6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e"
FEEDBACK_HASH = "RIHS01_c1de71afd52e49a89c53d8262366884185bc0a02f78ce051c4e46b0a7fe59bb2"


@dataclass
class Goal:
    id: bytes
    order: int
    accepted_ns: int
    status: int = ACCEPTED
    sequence: list[int] = field(default_factory=list)
    ending: int = UNKNOWN
    ended_at_s: float = 0.0
    waiting: list[Answer] = field(default_factory=list)

    @property
    def info(self) -> GoalInfo:
        return GoalInfo(UUID(list(self.id)), Time.at(self.accepted_ns))

    @property
    def result(self) -> Fibonacci_GetResult_Response:
        return Fibonacci_GetResult_Response(self.status, self.sequence)


class Fibonacci:
    """A goal of order n ends with n + 1 numbers, one more at each step, each published as feedback."""

    def __init__(self, node: Node, name: str = "/fibonacci") -> None:
        self.step_s = 0.05
        self.refuse_cancels = ""  # as "rclcpp" does, with its return code, or as "rclpy", with 0
        self.answer_goals = True
        self.keep_s = 10.0
        self._goals: dict[bytes, Goal] = {}
        self._changed = threading.Condition()
        for service, request, response, handler in (
            ("send_goal", Fibonacci_SendGoal_Request, Fibonacci_SendGoal_Response, self._send_goal),
            ("get_result", Fibonacci_GetResult_Request, Fibonacci_GetResult_Response, self._get_result),
            ("cancel_goal", CancelGoal_Request, CancelGoal_Response, self._cancel_goal),
        ):
            node.serve(f"{name}/_action/{service}", request, response, handler)
        self._feedback = node.advertise(
            f"{name}/_action/feedback",
            Fibonacci_FeedbackMessage,
            qos_of(user_data=f"typehash={FEEDBACK_HASH};"),
        )
        self._status = node.advertise(
            f"{name}/_action/status",
            GoalStatusArray,
            qos_of(depth=1, durability="transient_local", user_data=f"typehash={STATUS_HASH};"),
        )

    def configure(self, **settings: Any) -> None:
        """step_s, refuse_cancels, answer_goals, keep_s; running goals take a new step time at once."""
        with self._changed:
            for name, value in settings.items():
                if name not in ("step_s", "refuse_cancels", "answer_goals", "keep_s"):
                    raise ValueError(f"no setting {name}")
                setattr(self, name, value)
            self._changed.notify_all()

    def goals(self) -> list[dict[str, Any]]:
        with self._changed:
            return [
                {"id": g.id.hex(), "order": g.order, "status": g.status, "sequence": list(g.sequence)}
                for g in self._goals.values()
            ]

    def end(self, status: int, goal: str = "") -> int:
        """The robot itself ends a goal, or all that run; how many these were."""
        with self._changed:
            running = [
                g for g in self._goals.values() if g.status not in ENDS and goal in ("", g.id.hex())
            ]
            for g in running:
                if status == CANCELED:
                    self._move(g, CANCELING)
                g.ending = status
            self._changed.notify_all()
            return len(running)

    def _send_goal(self, request: Fibonacci_SendGoal_Request, answer: Answer) -> None:
        with self._changed:
            self._forget_old()
            goal = Goal(bytes(request.goal_id.uuid), request.order, time.time_ns())
            accepted = goal.order >= 0 and goal.id not in self._goals
            if accepted:
                self._goals[goal.id] = goal
                self._tell_status()
        if self.answer_goals:
            answer(Fibonacci_SendGoal_Response(accepted, Time.at(goal.accepted_ns)))
        if accepted:
            threading.Thread(target=self._execute, args=(goal,), daemon=True).start()

    def _get_result(self, request: Fibonacci_GetResult_Request, answer: Answer) -> None:
        with self._changed:
            self._forget_old()
            goal = self._goals.get(bytes(request.goal_id.uuid))
            if goal is not None and goal.status not in ENDS:
                goal.waiting.append(answer)
                return
        answer(goal.result if goal else Fibonacci_GetResult_Response(UNKNOWN, []))

    def _cancel_goal(self, request: CancelGoal_Request, answer: Answer) -> None:
        wanted, before = bytes(request.goal_info.goal_id.uuid), request.goal_info.stamp.nanoseconds
        with self._changed:
            self._forget_old()
            known = self._goals.get(wanted)
            running = [g for g in self._goals.values() if g.status in (ACCEPTED, EXECUTING)]
            if wanted == EVERY_GOAL:
                chosen = [g for g in running if not before or g.accepted_ns <= before]
            else:
                chosen = [g for g in running if g is known or g.accepted_ns <= before]
            code = CANCEL_OK
            if wanted != EVERY_GOAL and not chosen:
                code = CANCEL_ENDED if known else CANCEL_UNKNOWN_ID
            elif self.refuse_cancels:
                code = CANCEL_REFUSED if self.refuse_cancels == "rclcpp" else CANCEL_OK
                chosen = []
            for goal in chosen:
                self._move(goal, CANCELING)
                goal.ending = CANCELED
            self._changed.notify_all()
            response = CancelGoal_Response(code, [g.info for g in chosen])
        answer(response)

    def _execute(self, goal: Goal) -> None:
        with self._changed:
            if goal.ending == UNKNOWN:
                self._move(goal, EXECUTING)
            goal.sequence = [0, 1][: goal.order + 1]
            while len(goal.sequence) <= goal.order and self._step(goal):
                goal.sequence.append(goal.sequence[-1] + goal.sequence[-2])
                self._feedback.write(Fibonacci_FeedbackMessage(UUID(list(goal.id)), goal.sequence))
            goal.ended_at_s = time.monotonic()
            self._move(goal, goal.ending or SUCCEEDED)
        for answer in goal.waiting:
            answer(goal.result)

    def _step(self, goal: Goal) -> bool:
        """Waits for one step; whether the goal goes on."""
        since = time.monotonic()
        while not goal.ending and (left := since + self.step_s - time.monotonic()) > 0:
            self._changed.wait(left)
        return not goal.ending

    def _move(self, goal: Goal, status: int) -> None:
        goal.status = status
        self._tell_status()

    def _tell_status(self) -> None:
        self._status.write(
            GoalStatusArray([GoalStatus(g.info, g.status) for g in self._goals.values()])
        )

    def _forget_old(self) -> None:
        """As rcl does: what has ended is known for some time only."""
        oldest = time.monotonic() - self.keep_s
        for goal in list(self._goals.values()):
            if goal.status in ENDS and goal.ended_at_s < oldest:
                del self._goals[goal.id]
