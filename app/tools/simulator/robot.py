"""What the demo robot does, with the time given: pure, so that it can be stepped.

A `system_controller` that permits and forbids operation in turns, echoes what it heard, has a
light, can be reset, counts Fibonacci numbers as an action, and has parameters.
"""

import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from dataclasses import field as dataclass_field
from typing import Any, Final, Protocol

from app.panel.numbers import Range
from app.ros.messages import INTEGER_RANGES, PLACEHOLDER, Interfaces, Structure
from app.ros.messages.definitions import FLOAT_TYPES, STRING_TYPES, Field
from app.ros.messages.names import Qos
from app.tools.simulator.known_types import DEEPEST, GENERATORS, Moment, plausible
from app.tools.simulator.parameters import (
    BOOL,
    DOUBLE,
    EVENTS,
    INTEGER,
    NODE,
    STRING,
    NodeParameters,
    Parameter,
)
from app.tools.simulator.values import NEGATIVE, merged, put, span_of
from app.tools.simulator.values import Fields as MessageFields

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
    sequence: list[int] = dataclass_field(default_factory=lambda: [0, 1])
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


# The goals of a simulated action, of any type: pure, stepped with time.
#
# Source: design.ros2.org ("Actions"), action_msgs/msg/GoalStatus, action_msgs/srv/CancelGoal.

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

    def feedback(self) -> list[tuple[bytes, MessageFields]]:
        """The feedback since the last call, with the goal that it is of."""

    def states(self) -> list[tuple[bytes, int]]:
        """The goals that it knows, each with its status."""

    def result(self, goal_id: bytes) -> tuple[int, MessageFields] | None:
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
        feedback: Callable[[Moment, float], MessageFields],
        result: Callable[[Moment], MessageFields],
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

    def feedback(self) -> list[tuple[bytes, MessageFields]]:
        moment, feedback = self._now, []
        for goal_id, goal in self._goals.items():
            if goal.status == EXECUTING and moment.t - goal.feedback_at >= FEEDBACK_S - 1e-6:
                goal.feedback_at = moment.t
                part = min((moment.t - goal.began) / self._duration_s, 1.0)
                feedback.append((goal_id, self._feedback(moment, part)))
        return feedback

    def states(self) -> list[tuple[bytes, int]]:
        return [(goal_id, goal.status) for goal_id, goal in self._goals.items()]

    def result(self, goal_id: bytes) -> tuple[int, MessageFields] | None:
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

    def feedback(self) -> list[tuple[bytes, MessageFields]]:
        return [(goal_id, {"sequence": numbers}) for goal_id, numbers in self._robot.count()]

    def states(self) -> list[tuple[bytes, int]]:
        return self._robot.states()

    def result(self, goal_id: bytes) -> tuple[int, MessageFields] | None:
        ended = self._robot.result(goal_id)
        return None if ended is None else (ended[0], {"sequence": ended[1]})


# Responses of services, and feedback and results of actions, of any type: pure.

DONE: Final = "done"
CHOICES: Final = ("demo 1", "demo 2", "demo 3")
# Whole numbers for a status: zero is success.
STATUS: Final = re.compile(r"error|code|status|result|reason|flag|id$", re.IGNORECASE)
LEFT: Final = re.compile(r"remain|left|to_go|todo", re.IGNORECASE)
PART: Final = re.compile(r"progress|fraction|complet|done|ratio", re.IGNORECASE)
STEPS: Final = 10


def good_response(
    type_name: str, interfaces: Interfaces, fixed: Mapping[str, Any], paths: Mapping[str, Any]
) -> Callable[[Moment], MessageFields]:
    """Responses of a request that succeeds, with the fields of `[demo]` and values at paths."""
    structure = interfaces.structures[type_name]
    base = plausible(type_name, interfaces)

    def response(moment: Moment) -> MessageFields:
        fields = merged(base(moment), _good(structure, interfaces, 0))
        for path, value in paths.items():
            put(fields, type_name, path, value, interfaces.structures)
        return merged(fields, fixed)

    return response


def _good(structure: Structure, interfaces: Interfaces, depth: int) -> MessageFields:
    """The fields of a success."""
    fields: MessageFields = {}
    for field in structure.fields:
        kind = field.type
        if field.name == PLACEHOLDER or kind.container != "one":
            continue
        if kind.is_nested:
            own = kind.name not in GENERATORS and kind.name.startswith(
                f"{structure.name.split('/')[0]}/"
            )
            if own and depth < DEEPEST:
                fields[field.name] = _good(interfaces.structures[kind.name], interfaces, depth + 1)
        elif kind.name == "bool":
            fields[field.name] = not NEGATIVE.search(field.name)
        elif kind.name in STRING_TYPES:
            fields[field.name] = DONE[: kind.bound or None]
        elif kind.name in INTEGER_RANGES and STATUS.search(field.name):
            fields[field.name] = 0
    return fields


def feedback_at(
    type_name: str, interfaces: Interfaces, progress: Mapping[str, tuple[float, float]]
) -> Callable[[Moment, float], MessageFields]:
    """Feedback when a part (0 to 1) of the goal is done; `progress` is path → its values at the start
    and at the end."""
    structure = interfaces.structures[type_name]
    base = plausible(type_name, interfaces)

    def feedback(moment: Moment, part: float) -> MessageFields:
        fields = base(moment)
        for field in structure.fields:
            if (value := _partly(field, part)) is not None:
                fields[field.name] = value
        for path, (first, last) in progress.items():
            kind = interfaces.type_at(type_name, path).name
            value = _number(first + part * (last - first), kind)
            put(fields, type_name, path, value, interfaces.structures)
        return fields

    return feedback


def _partly(field: Field, part: float) -> Any:
    """A field of feedback; None if its plausible value is used."""
    kind, name = field.type, field.name
    if kind.name == "builtin_interfaces/msg/Duration" and kind.container == "one":
        return {"sec": round(STEPS * (1 - part if LEFT.search(name) else part))}
    if kind.is_nested or (kind.name not in INTEGER_RANGES and kind.name not in FLOAT_TYPES):
        return None
    if kind.container == "sequence":
        length = min(round(part * STEPS), kind.size or STEPS)
        return [_number(index, kind.name) for index in range(length + 1)][: kind.size or None]
    if kind.container == "array":
        return None
    done = 1 - part if LEFT.search(name) else part
    if "percent" in name:
        return _number(100 * done, kind.name)
    if PART.search(name):
        return _number(done if kind.name in FLOAT_TYPES else 100 * done, kind.name)
    span = span_of("", name)
    return _number(done * (STEPS if span.shape == "count" else span.high or STEPS), kind.name)


def _number(value: float, kind: str) -> int | float:
    if kind in FLOAT_TYPES:
        return float(value)
    low, high = INTEGER_RANGES[kind]
    return min(max(round(value), low), high)


# The protocol of a simulated robot that a Zenoh peer plays.


@dataclass(frozen=True, slots=True)
class SimulatedTopic:
    """A topic that a robot publishes or subscribes to; `type_hash` is "" where it is not known."""

    type: str
    qos: Qos = dataclass_field(default_factory=Qos)
    type_hash: str = ""


class SimulatedRobot(Protocol):
    """A robot without Zenoh: bytes and time in, bytes out. Names are without the namespace."""

    @property
    def step_s(self) -> float:
        """How often it is stepped, in seconds."""

    @property
    def publishes(self) -> Mapping[str, SimulatedTopic]: ...
    @property
    def subscribes(self) -> Mapping[str, SimulatedTopic]: ...
    @property
    def services(self) -> Mapping[str, str]:
        """Service → type."""

    @property
    def actions(self) -> Mapping[str, ActionServer]: ...
    def receive(self, topic: str, payload: bytes) -> None:
        """A message on a topic that it subscribes to."""

    def serve(self, service: str, payload: bytes) -> bytes | None:
        """The response to a request; None for what is no request."""

    def step(self, moment: Moment) -> Iterable[tuple[str, bytes]]:
        """The messages that it publishes now, as (topic, CDR)."""
