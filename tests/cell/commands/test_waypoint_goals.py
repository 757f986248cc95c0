"""Goals with several poses at a robot that answers by hand, in the definitions of Nav2: the panel's own
from the press to the result, and those of other programs by what an action publishes."""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Final

import pytest

from app.cell.commands.goals import GoalTracker
from app.cell.commands.press import PressHandle
from app.cell.robot.waypoints import WaypointGoal
from app.panel.widgets.service_action import Action
from app.records.entry import Outcome
from app.ros.dialects import bridge_dialect
from app.ros.messages import load_interfaces
from tests.cell.commands.test_calls_and_goals import Line, queried, sample_of
from tests.support.beside_panel import NAV2
from tests.support.builders import BRIDGE, panel_of, robot_there
from tests.support.waiting import turns

pytestmark = pytest.mark.promise("places")

NAV2_INTERFACES: Final = load_interfaces("jazzy", (NAV2.parent,))
FOLLOW: Final = "nav2_msgs/action/FollowWaypoints"
TYPES: Final = NAV2_INTERFACES.action_types(FOLLOW)
HALL: Final = {"id": "hall", "kind": "map", "label": "Hall"}
TOUR: Final = {"id": "tour", "kind": "tour", "label": "Tour", "map": "hall", "action": "follow"}
ACTION: Final = {
    "id": "follow",
    "kind": "action",
    "label": "Follow",
    "action": "/follow",
    "type": FOLLOW,
    "timeout_s": 0.05,
}
OTHER: Final = b"\7" * 16


class Bench:
    """A robot that offers the action, and a tour that shows its goals."""

    def __init__(self) -> None:
        self.panel = panel_of(HALL, TOUR, ACTION)
        self.robot = robot_there(self.panel, interfaces=NAV2_INTERFACES)
        self.robot.graph.apply_token(bridge_dialect.server_token(BRIDGE, "AS", "follow", FOLLOW), True)
        self.line = Line()
        self.changed: list[str] = []
        self.corrected: list[Outcome] = []
        self.actions = GoalTracker(NAV2_INTERFACES, self.robot, self.line, self.changed.append)
        self.widget = self.panel.widget("follow", Action)

    def send(self, count: int = 3) -> "asyncio.Task[Outcome]":
        poses = [{"header": {"frame_id": "map"}, "pose": {"position": {"x": n}}} for n in range(count)]
        handle = PressHandle("p1", self.corrected.append)
        return asyncio.create_task(self.actions.start(self.widget, {"poses": poses}, handle))

    @property
    def goal(self) -> WaypointGoal | None:
        return self.robot.waypoint_goals.get("/follow")

    @property
    def own_id(self) -> bytes:
        request = NAV2_INTERFACES.decode(TYPES.send_goal_request, self.line.queries[0][1])
        return bytes(request.goal_id.uuid)

    def feed(self, goal_id: bytes, current: int) -> None:
        message = {"goal_id": {"uuid": goal_id}, "feedback": {"current_waypoint": current}}
        self.actions.on_feedback(
            "/follow", sample_of(NAV2_INTERFACES.encode(TYPES.feedback_message, message))
        )

    def tell(self, goal_id: bytes, state: int) -> None:
        info = {"goal_id": {"uuid": goal_id}, "stamp": {"sec": 0, "nanosec": 0}}
        message = {"status_list": [{"goal_info": info, "status": state}]}
        self.actions.on_status("/follow", sample_of(NAV2_INTERFACES.encode(TYPES.status, message)))

    def answer(self, type_name: str, **fields: Any) -> None:
        _, _, future = self.line.queries[-1]
        future.set_result(NAV2_INTERFACES.encode(type_name, fields))

    async def accepted(self, count: int = 3) -> None:
        start = self.send(count)
        await queried(self, 1)  # type: ignore[arg-type]
        self.answer(TYPES.send_goal_response, accepted=True, stamp={"sec": 0, "nanosec": 0})
        assert (await start).outcome == "accepted"
        await queried(self, 2)  # type: ignore[arg-type]


def run(test: Callable[[Bench], Coroutine[Any, Any, None]]) -> None:
    async def whole() -> None:
        bench = Bench()
        try:
            await test(bench)
        finally:
            await bench.actions.stop()

    asyncio.run(whole())


def test_an_accepted_goal_is_followed_by_its_feedback_to_its_result() -> None:
    async def test(bench: Bench) -> None:
        await bench.accepted()
        goal = bench.goal
        assert goal is not None
        assert (goal.command, goal.total, goal.current, goal.end) == ("follow", 3, 0, 0)
        assert "tour" in bench.changed
        bench.feed(bench.own_id, 1)
        assert [goal.state(index) for index in range(3)] == ["passed", "current", "to_come"]
        bench.changed.clear()
        missed = [{"index": 1, "error_code": 105}]
        bench.answer(TYPES.get_result_response, status=4, result={"missed_waypoints": missed})
        await turns()
        assert (goal.end, goal.missed) == (4, {1: 105})
        assert [goal.state(index) for index in range(3)] == ["reached", "missed", "reached"]
        assert "tour" in bench.changed
        ended = bench.corrected[-1]
        assert ended.outcome == "succeeded"
        assert "1 missed: waypoints 2." in str(ended.text)

    run(test)


def test_a_rejected_goal_is_not_shown() -> None:
    async def test(bench: Bench) -> None:
        start = bench.send()
        await queried(bench, 1)  # type: ignore[arg-type]
        bench.feed(bench.own_id, 0)  # before the answer: it is the panel's own
        assert bench.goal is None
        bench.answer(TYPES.send_goal_response, accepted=False, stamp={"sec": 0, "nanosec": 0})
        assert (await start).outcome == "rejected"
        assert bench.goal is None

    run(test)


def test_a_goal_without_an_answer_is_shown_once_the_robot_reports_it() -> None:
    async def test(bench: Bench) -> None:
        assert (await bench.send()).outcome == "timed_out"
        assert bench.goal is None
        bench.tell(bench.own_id, 2)
        assert bench.goal is not None
        assert bench.goal.total == 3

    run(test)


def test_another_programs_goal_is_shown_until_its_end() -> None:
    async def test(bench: Bench) -> None:
        bench.tell(OTHER, 2)
        assert bench.goal is None  # nothing is known of it yet
        bench.feed(OTHER, 2)
        goal = bench.goal
        assert goal is not None
        assert (goal.command, goal.poses, goal.current) == ("", None, 2)
        bench.tell(b"\1" * 16, 4)
        assert bench.goal is goal
        bench.tell(OTHER, 4)
        assert bench.goal is None
        assert bench.changed == ["tour"]

    run(test)


def test_the_panels_own_goal_is_not_displaced_while_it_runs() -> None:
    async def test(bench: Bench) -> None:
        await bench.accepted()
        bench.feed(OTHER, 2)
        assert bench.goal is not None
        assert (bench.goal.command, bench.goal.current) == ("follow", 0)
        bench.answer(TYPES.get_result_response, status=6, result={})
        await turns()
        assert bench.goal.end == 6
        bench.feed(OTHER, 2)
        assert (bench.goal.command, bench.goal.current) == ("", 2)

    run(test)


@pytest.mark.parametrize("reply", [b"", b"\0\1\0\0", b"\0" * 300_000])
def test_a_result_that_can_not_be_read_marks_nothing_as_missed(reply: bytes) -> None:
    async def test(bench: Bench) -> None:
        assert bench.actions._services.missed(bench.widget, reply) == {}

    run(test)


def test_a_panel_without_a_tour_follows_none() -> None:
    panel = panel_of(HALL, ACTION)
    robot = robot_there(panel, interfaces=NAV2_INTERFACES)
    actions = GoalTracker(NAV2_INTERFACES, robot, Line(), lambda _: None)
    message = {"goal_id": {"uuid": OTHER}, "feedback": {"current_waypoint": 1}}
    actions.on_feedback("/follow", sample_of(NAV2_INTERFACES.encode(TYPES.feedback_message, message)))
    assert robot.waypoint_goals == {}
