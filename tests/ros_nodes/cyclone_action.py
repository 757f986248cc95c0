"""Action servers, with goals that run side by side and end as a test wants: /fibonacci, and those of
Nav2 with its own types."""

import json
import os
import threading
import time
from dataclasses import dataclass, field
from typing import Any, Protocol

from cyclone_node import Answer, Node, qos_of
from cyclone_types import (
    DOCK_ROBOT,
    FIBONACCI,
    FOLLOW_WAYPOINTS,
    NAVIGATE_TO_POSE,
    UUID,
    ActionTypes,
    CancelGoal_Request,
    CancelGoal_Response,
    Duration,
    GoalInfo,
    GoalStatus,
    GoalStatusArray,
    Header,
    MissedWaypoint,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Time,
    plain,
)

UNKNOWN, ACCEPTED, EXECUTING, CANCELING, SUCCEEDED, CANCELED, ABORTED = range(7)
ENDS = (SUCCEEDED, CANCELED, ABORTED)
CANCEL_OK, CANCEL_REFUSED, CANCEL_UNKNOWN_ID, CANCEL_ENDED = range(4)
EVERY_GOAL = bytes(16)

FEEDBACK_HASH = "RIHS01_c1de71afd52e49a89c53d8262366884185bc0a02f78ce051c4e46b0a7fe59bb2"
STATUS_HASH = "RIHS01_6c1684b00f177d37438febe6e709fc4e2b0d4248dca4854946f9ed8b30cda83e"


class Work(Protocol):
    """What a goal does, step by step. Its fields are in the order of the definition."""

    @property
    def is_valid(self) -> bool:
        """Whether the goal is accepted."""

    @property
    def is_done(self) -> bool: ...

    def step(self) -> tuple[Any, ...]:
        """Does a step; the fields of its feedback."""

    def result(self, error: int) -> tuple[Any, ...]:
        """The fields of the result; `error` is the code with which it is aborted, 0 for none."""

    def shown(self) -> dict[str, Any]:
        """What a test asks for."""


class FibonacciWork:
    """A goal of order n ends with n + 1 numbers, one more at each step, each published as feedback."""

    def __init__(self, request: Any) -> None:
        self.order = request.order
        self.is_valid = self.order >= 0
        self.sequence = [0, 1][: self.order + 1]

    @property
    def is_done(self) -> bool:
        return len(self.sequence) > self.order

    def step(self) -> tuple[Any, ...]:
        self.sequence.append(self.sequence[-1] + self.sequence[-2])
        return (self.sequence,)

    def result(self, error: int) -> tuple[Any, ...]:
        return (self.sequence,)

    def shown(self) -> dict[str, Any]:
        return {"order": self.order, "sequence": list(self.sequence)}


STEPS = 8


class Drive:
    """A drive to a pose: metres are left, one less at each step."""

    is_valid = True

    def __init__(self, request: Any) -> None:
        self.pose, self.left = request.pose, STEPS

    @property
    def is_done(self) -> bool:
        return not self.left

    def step(self) -> tuple[Any, ...]:
        self.left -= 1
        here = Pose(Point(float(STEPS - self.left)), Quaternion())
        at = PoseStamped(Header(Time.at(time.time_ns()), "map"), here)
        return at, Duration(STEPS - self.left), Duration(self.left), 0, float(self.left)

    def result(self, error: int) -> tuple[Any, ...]:
        return (error,)

    def shown(self) -> dict[str, Any]:
        return {"pose": plain(self.pose), "left": self.left}


class Docking:
    """A robot that docks: the states of Nav2, one after the other."""

    is_valid = True

    def __init__(self, request: Any) -> None:
        self.request, self.state = request, 0

    @property
    def is_done(self) -> bool:
        return self.state == 4  # WAIT_FOR_CHARGE

    def step(self) -> tuple[Any, ...]:
        self.state += 1
        return self.state, Duration(self.state), 0

    def result(self, error: int) -> tuple[Any, ...]:
        return not error, error, 0

    def shown(self) -> dict[str, Any]:
        return {"dock_id": self.request.dock_id, "state": self.state}


class Following:
    """A tour: one pose after the other. It misses those with a y below 0."""

    def __init__(self, request: Any) -> None:
        self.poses, self.current = request.poses, -1
        self.is_valid = bool(self.poses)

    @property
    def is_done(self) -> bool:
        return self.current + 1 >= len(self.poses)

    def step(self) -> tuple[Any, ...]:
        self.current += 1
        return (self.current,)

    def result(self, error: int) -> tuple[Any, ...]:
        missed = [
            MissedWaypoint(index, pose, 105)
            for index, pose in enumerate(self.poses[: self.current + 1])
            if pose.pose.position.y < 0
        ]
        return missed, error

    def shown(self) -> dict[str, Any]:
        return {"poses": [plain(pose) for pose in self.poses], "current": self.current}


WORK: dict[str, type[Any]] = {
    FIBONACCI.name: FibonacciWork,
    NAVIGATE_TO_POSE.name: Drive,
    DOCK_ROBOT.name: Docking,
    FOLLOW_WAYPOINTS.name: Following,
}


@dataclass
class Goal:
    id: bytes
    work: Work
    accepted_ns: int
    status: int = ACCEPTED
    ending: int = UNKNOWN
    error: int = 0
    ended_at_s: float = 0.0
    waiting: list[Answer] = field(default_factory=list)

    @property
    def info(self) -> GoalInfo:
        return GoalInfo(UUID(list(self.id)), Time.at(self.accepted_ns))


class ActionServer:
    """The server of an action, with the types of its definition."""

    def __init__(self, node: Node, name: str, types: ActionTypes) -> None:
        self._types = types
        self.step_s = 0.05
        self.refuse_cancels = ""  # as "rclcpp" does, with its return code, or as "rclpy", with 0
        self.answer_goals = True
        self.keep_s = 10.0
        self._goals: dict[bytes, Goal] = {}
        self._changed = threading.Condition()
        for service, request, response, handler in (
            ("send_goal", types.send_goal, types.accepted, self._send_goal),
            ("get_result", types.get_result, types.result, self._get_result),
            ("cancel_goal", CancelGoal_Request, CancelGoal_Response, self._cancel_goal),
        ):
            node.serve(f"{name}/_action/{service}", request, response, handler)
        self._feedback = node.advertise(
            f"{name}/_action/feedback",
            types.feedback,
            qos_of(user_data=f"typehash={_hash_of(types.name)};"),
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
                {"id": g.id.hex(), "status": g.status, **g.work.shown()} for g in self._goals.values()
            ]

    def end(self, status: int, goal: str = "", error: int = 0) -> int:
        """The robot itself ends a goal, or all that run; how many these were. `error` is the code in
        the result."""
        with self._changed:
            running = [
                g for g in self._goals.values() if g.status not in ENDS and goal in ("", g.id.hex())
            ]
            for g in running:
                if status == CANCELED:
                    self._move(g, CANCELING)
                g.ending, g.error = status, error
            self._changed.notify_all()
            return len(running)

    def _send_goal(self, request: Any, answer: Answer) -> None:
        with self._changed:
            self._forget_old()
            work = WORK[self._types.name](request)
            goal = Goal(bytes(request.goal_id.uuid), work, time.time_ns())
            accepted = work.is_valid and goal.id not in self._goals
            if accepted:
                self._goals[goal.id] = goal
                self._tell_status()
        if self.answer_goals:
            answer(self._types.accepted(accepted, Time.at(goal.accepted_ns)))
        if accepted:
            threading.Thread(target=self._execute, args=(goal,), daemon=True).start()

    def _get_result(self, request: Any, answer: Answer) -> None:
        with self._changed:
            self._forget_old()
            goal = self._goals.get(bytes(request.goal_id.uuid))
            if goal is not None and goal.status not in ENDS:
                goal.waiting.append(answer)
                return
        answer(self._result_of(goal) if goal else self._types.no_result(UNKNOWN))

    def _result_of(self, goal: Goal) -> Any:
        return self._types.result(goal.status, *goal.work.result(goal.error))

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
            while not goal.work.is_done and self._step(goal):
                self._feedback.write(self._types.feedback(UUID(list(goal.id)), *goal.work.step()))
            goal.ended_at_s = time.monotonic()
            self._move(goal, goal.ending or SUCCEEDED)
        for answer in goal.waiting:
            answer(self._result_of(goal))

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


def _hash_of(action: str) -> str:
    """The type hash of an action's feedback, as ROS 2 computes it of the definition."""
    hashes: dict[str, str] = json.loads(os.environ.get("TYPE_HASHES", "{}"))
    return hashes.get(f"{action}_FeedbackMessage", FEEDBACK_HASH)
