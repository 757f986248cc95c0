"""Calls and goals whose robot answers late, wrongly or not at all: without a bridge, at set times."""

import asyncio
import time
from collections.abc import Callable, Coroutine
from dataclasses import replace
from typing import Any

import pytest

from app.cell.commands.goals import GoalTracker
from app.cell.commands.press import PressHandle
from app.cell.commands.services import LATE_S, MAX_VALUE_CHARS, ServiceCalls
from app.cell.permission.verdict import call_blocked
from app.cell.robot.state import RobotState, Sample
from app.panel.model import Panel
from app.panel.widgets.service_action import Action, Call
from app.records.entry import CommandStatus, Outcome
from app.ros.dialects import bridge_dialect
from app.system.errors import LinkError
from app.system.texts import say
from tests.support.builders import BRIDGE, INTERFACES, TRAITS, FakeTransport, panel_of, robot_there
from tests.support.waiting import turns, when
from tests.support.words import coded

TRIGGER = "std_srvs/srv/Trigger"
COUNT = "example_interfaces/action/Fibonacci"
CALL = {"id": "reset", "kind": "call", "label": "Reset", "service": "/reset", "type": TRIGGER}
GOAL = {
    "id": "count",
    "kind": "action",
    "label": "Count",
    "action": "/count",
    "type": COUNT,
    "feedback": "so far {sequence}",
    "result": "{sequence}",
}


class Line(FakeTransport):
    """A link whose queries are answered by hand."""

    def __init__(self) -> None:
        self.queries: list[tuple[str, bytes, asyncio.Future[bytes | None]]] = []
        self.timeouts: list[float] = []
        self.refuses = ""  # the end of the keys that can't be asked

    def query(self, key: str, payload: bytes, timeout_s: float) -> "asyncio.Future[bytes | None]":
        if self.refuses and key.endswith(self.refuses):
            raise LinkError(f"can't ask {key}")
        future: asyncio.Future[bytes | None] = asyncio.get_running_loop().create_future()
        self.queries.append((key, payload, future))
        self.timeouts.append(timeout_s)
        if key.endswith("send_goal"):  # as Zenoh, where no one is waited for any longer
            asyncio.get_running_loop().call_later(timeout_s, give_up, future)
        return future

    def answer(self, type_name: str, number: int = -1, **fields: Any) -> None:
        self.queries[number][2].set_result(INTERFACES.encode(type_name, fields))


def give_up(future: "asyncio.Future[bytes | None]") -> None:
    if not future.done():
        future.set_result(None)


class Bench:
    """A robot that offers a service and an action."""

    def __init__(self) -> None:
        self.panel: Panel = panel_of(
            {**CALL, "timeout_s": 0.05},
            {**GOAL, "goal": {"order": 3}, "progress": "sequence[0]", "timeout_s": 0.05},
        )
        self.robot: RobotState = robot_there(self.panel)
        self.robot.graph.apply_token(bridge_dialect.server_token(BRIDGE, "SS", "reset", TRIGGER), True)
        self.robot.graph.apply_token(bridge_dialect.server_token(BRIDGE, "AS", "count", COUNT), True)
        self.line = Line()
        self.corrected: list[tuple[str, Outcome]] = []
        self.calls = ServiceCalls(INTERFACES, self.robot, self.line, lambda _: None)
        self.shows: list[
            CommandStatus
        ] = []  # what an action's widget had when it was to be shown at once
        self.actions = GoalTracker(
            INTERFACES,
            self.robot,
            self.line,
            lambda _: self.shows.append(self.robot.command_status["count"]),
        )
        call, goal = self.panel.widgets()
        assert isinstance(call, Call)
        assert isinstance(goal, Action)
        self.reset, self.count = call, goal

    def handle(self, press_id: str) -> PressHandle:
        return PressHandle(press_id, lambda answer: self.corrected.append((press_id, answer)))

    def call(self, press_id: str = "p1") -> "asyncio.Task[Outcome]":
        request = INTERFACES.encode(f"{TRIGGER}_Request", {})
        return asyncio.create_task(self.calls.call(self.reset, request, self.handle(press_id)))

    def send_goal(self, press_id: str = "g1") -> "asyncio.Task[Outcome]":
        goal = self.actions.start(self.count, {"order": 3}, self.handle(press_id))
        return asyncio.create_task(goal)

    @property
    def shown(self) -> CommandStatus:
        return self.robot.command_status["count"]

    def answer_goal(self, accepted: bool) -> None:
        response = INTERFACES.action_types(COUNT).send_goal_response
        self.line.answer(response, accepted=accepted, stamp={"sec": 0, "nanosec": 0})

    def lose_the_bridge(self) -> None:
        self.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), False)
        self.calls.on_graph_change()
        self.actions.on_graph_change()


Test = Callable[[Bench], Coroutine[Any, Any, None]]


def run(test: Test) -> None:
    asyncio.run(test(Bench()))


async def queried(bench: Bench, count: int) -> None:
    while len(bench.line.queries) < count:
        await asyncio.sleep(0)


def test_an_answer_that_can_not_be_read_is_unknown() -> None:
    async def test(bench: Bench) -> None:
        call = bench.call()
        await queried(bench, 1)
        bench.line.queries[0][2].set_result(b"\0\1\0\0")
        answer = await call
        assert answer.outcome == "unknown"
        assert coded(answer.text, "wanted") == ("call_response_unreadable", TRIGGER)

    run(test)


def test_control_characters_in_a_reply_are_shown_as_escapes() -> None:
    async def test(bench: Bench) -> None:
        call = bench.call()
        await queried(bench, 1)
        bench.line.answer(
            f"{TRIGGER}_Response", success=False, message="no \u202e\x1b[2J\x1b[1;31mon\x1b[0m"
        )
        assert str((await call).text).endswith(": no \\u202eon")

    run(test)


def test_first_timeout_hints_at_cyclone_and_later_timeouts_do_not() -> None:
    async def test(bench: Bench) -> None:
        first = await bench.call()
        assert first.outcome == "timed_out"
        assert "Cyclone DDS" in str(first.text)
        call = bench.call("p2")
        await queried(bench, 2)
        bench.line.answer(f"{TRIGGER}_Response", success=True, message="")
        assert (await call).outcome == "succeeded"
        assert "Cyclone DDS" not in str((await bench.call("p3")).text)

    run(test)


def test_a_query_that_ends_without_an_answer_is_unknown() -> None:
    async def test(bench: Bench) -> None:
        call = bench.call()
        await queried(bench, 1)
        bench.line.queries[0][2].set_result(None)
        answer = await call
        assert answer.outcome == "unknown"
        assert coded(answer.text, "service") == ("call_no_reply_from_bridge", "/reset")

    run(test)


def test_calls_without_an_answer_are_bounded_and_forgotten() -> None:
    async def test(bench: Bench) -> None:
        for number in range(TRAITS.max_unanswered):
            assert (await bench.call(f"p{number}")).outcome == "timed_out"
        one_more = await bench.call("too many")
        assert one_more.outcome == "refused"
        assert len(bench.line.queries) == TRAITS.max_unanswered
        for _, _, future in bench.line.queries:
            future.set_result(None)
        await asyncio.sleep(0)
        assert bench.calls.unanswered("reset") == 0

    run(test)


def test_late_reply_corrects_its_own_press_only() -> None:
    async def test(bench: Bench) -> None:
        await bench.call("p1")
        second = bench.call("p2")
        await queried(bench, 2)
        bench.line.answer(f"{TRIGGER}_Response", 1, success=True, message="second")
        await second
        bench.line.answer(f"{TRIGGER}_Response", 0, success=False, message="first")
        await when(lambda: bench.corrected)
        ((press_id, answer),) = bench.corrected
        assert (press_id, answer.outcome) == ("p1", "rejected")
        assert "second" in str(bench.robot.command_status["reset"].text)

    run(test)


@pytest.mark.parametrize("command", ["call", "send_goal"])
def test_a_bridge_that_goes_away_ends_the_waiting_at_once(command: str) -> None:
    async def test(bench: Bench) -> None:
        waiting = getattr(bench, command)()
        await queried(bench, 1)
        bench.lose_the_bridge()
        answer = await waiting
        assert answer.outcome == "unknown"
        assert coded(answer.text) == ("call_connection_lost",)

    run(test)


def test_a_goal_cut_off_is_unknown_until_the_robot_says_its_result() -> None:
    async def test(bench: Bench) -> None:
        types = INTERFACES.action_types(COUNT)
        start = bench.send_goal()
        await queried(bench, 1)
        bench.line.answer(types.send_goal_response, accepted=True, stamp={"sec": 0, "nanosec": 0})
        assert (await start).outcome == "accepted"
        await queried(bench, 2)
        bench.lose_the_bridge()
        await in_doubt(bench)
        outcomes = [bench.shown.outcome]
        bench.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), True)
        assert locked_by(bench) == "goal_may_be_running"
        await queried(bench, 3)
        assert (locked_by(bench), bench.shown.can_cancel) == ("goal_may_be_running", True)
        bench.line.answer(types.get_result_response, status=4, result={"sequence": [0, 1]})
        while bench.robot.command_status["count"].outcome != "succeeded":
            await asyncio.sleep(0)
        outcomes.append(bench.robot.command_status["count"].outcome)
        assert outcomes == ["unknown", "succeeded"]
        assert [answer.outcome for _, answer in bench.corrected] == ["unknown", "succeeded"]
        await bench.actions.stop()

    run(test)


def goal_id(bench: Bench, number: int = 0) -> bytes:
    """The id of the goal that was asked for, as the robot got it."""
    request = INTERFACES.action_types(COUNT).send_goal_request
    return bytes(INTERFACES.decode(request, bench.line.queries[number][1]).goal_id.uuid)


def tell_states(bench: Bench, *states: tuple[bytes, int]) -> None:
    """The action's server publishes the states of its goals."""
    stamp = {"sec": 0, "nanosec": 0}
    listed_states = [
        {"goal_info": {"goal_id": {"uuid": i}, "stamp": stamp}, "status": s} for i, s in states
    ]
    payload = INTERFACES.encode(INTERFACES.action_types(COUNT).status, {"status_list": listed_states})
    bench.actions.on_status("/count", sample_of(payload))


async def accepted(bench: Bench, press_id: str = "g1") -> None:
    count = len(bench.line.queries)
    start = bench.send_goal(press_id)
    await queried(bench, count + 1)
    bench.answer_goal(accepted=True)
    assert (await start).outcome == "accepted"
    await queried(bench, count + 2)


async def cancel_answered(
    bench: Bench, press_id: str, *, return_code: int = 0, listed: bool = True
) -> tuple[Outcome, bytes]:
    """Cancels the goal of a press: what came of that, and the goal that was to be canceled."""
    request, response = INTERFACES.service_types("action_msgs/srv/CancelGoal")
    count = len(bench.line.queries)
    cancel = asyncio.create_task(bench.actions.cancel(bench.count, press_id))
    await queried(bench, count + 1)
    info = INTERFACES.decode(request, bench.line.queries[-1][1]).goal_info
    goal = {"goal_id": {"uuid": info.goal_id.uuid}, "stamp": {"sec": 0, "nanosec": 0}}
    bench.line.answer(response, return_code=return_code, goals_canceling=[goal] if listed else [])
    return await cancel, bytes(info.goal_id.uuid)


async def canceled(bench: Bench, press_id: str, return_code: int = 0) -> bytes:
    """The same, as it has to be; the id."""
    answer, goal = await cancel_answered(
        bench, press_id, return_code=return_code, listed=not return_code
    )
    assert answer.outcome == ("rejected" if return_code else "accepted")
    return goal


def test_a_goal_that_the_robot_does_not_list_is_not_being_canceled() -> None:
    async def test(bench: Bench) -> None:
        await accepted(bench)
        tell_states(bench, (goal_id(bench), 2))
        answer, _ = await cancel_answered(bench, "g1", listed=False)
        assert (answer.outcome, coded(answer.text)) == ("rejected", ("cancel_refused",))
        assert (bench.shown.goal, bench.shown.can_cancel) == ("EXECUTING", True)
        await canceled(bench, "g1")
        assert bench.shown.goal == "CANCELING"
        again, _ = await cancel_answered(bench, "g1", return_code=3, listed=False)
        assert (again.outcome, again.text) == ("accepted", say("goal_canceling"))
        await bench.actions.stop()

    run(test)


def test_an_answer_to_a_cancel_that_can_not_be_read_is_no_refusal() -> None:
    async def test(bench: Bench) -> None:
        await accepted(bench)
        count = len(bench.line.queries)
        cancel = asyncio.create_task(bench.actions.cancel(bench.count, "g1"))
        await queried(bench, count + 1)
        bench.line.queries[-1][2].set_result(b"broken")
        answer = await cancel
        assert answer.outcome == "unknown"
        assert answer.text == say("call_response_unreadable", wanted="action_msgs/srv/CancelGoal")
        assert bench.shown.goal == "ACCEPTED"
        await bench.actions.stop()

    run(test)


def test_a_late_cancel_does_not_hit_the_next_goal() -> None:
    async def test(bench: Bench) -> None:
        await accepted(bench)
        assert bench.shown.press == "g1"
        result = INTERFACES.action_types(COUNT).get_result_response
        bench.line.answer(result, status=4, result={"sequence": []})
        await settled(bench)
        assert bench.shown.press == ""
        await accepted(bench, "g2")
        late = await bench.actions.cancel(bench.count, "g1")
        assert (late.outcome, late.text) == ("refused", say("cancel_goal_ended"))
        assert bench.shown.goal == "ACCEPTED"
        assert await canceled(bench, "g2") == goal_id(bench, 2)
        assert (bench.shown.goal, bench.shown.press) == ("CANCELING", "g2")
        await bench.actions.stop()

    run(test)


def test_a_goal_of_which_nothing_is_heard_can_still_be_canceled_by_its_press() -> None:
    async def test(bench: Bench) -> None:
        assert (await bench.send_goal()).outcome == "timed_out"
        await accepted(bench, "g2")
        assert await canceled(bench, "g1", return_code=2) == goal_id(bench)
        assert await canceled(bench, "") == goal_id(bench, 2)
        await bench.actions.stop()

    run(test)


def test_a_goals_state_has_its_ros_name_and_only_goes_on() -> None:
    async def test(bench: Bench) -> None:
        await accepted(bench)
        names = [bench.shown.goal]
        for state in (2, 1, 3, 2, 7, -1):
            tell_states(bench, (bytes(16), 6), (goal_id(bench), state))
            names.append(bench.shown.goal)
        assert names == ["ACCEPTED", *["EXECUTING"] * 2, *["CANCELING"] * 4]
        assert bench.shown.text == say("goal_canceling")
        assert bench.shown.can_cancel
        tell_states(bench, (goal_id(bench), 5))
        bench.line.answer(
            INTERFACES.action_types(COUNT).get_result_response, status=5, result={"sequence": []}
        )
        await settled(bench)
        assert (bench.shown.goal, bench.shown.outcome) == ("CANCELED", "canceled")
        tell_states(bench, (goal_id(bench), 6))
        assert bench.shown.goal == "CANCELED"

    run(test)


def test_a_state_that_comes_before_the_answer_counts() -> None:
    async def test(bench: Bench) -> None:
        start = bench.send_goal()
        await queried(bench, 1)
        tell_states(bench, (goal_id(bench), 2))
        assert bench.shown.goal == ""  # the answer is awaited
        bench.answer_goal(accepted=True)
        await start
        assert bench.shown.goal == "EXECUTING"
        await bench.actions.stop()

    run(test)


def test_another_programs_goal_and_a_rejected_one_have_no_state() -> None:
    async def test(bench: Bench) -> None:
        tell_states(bench, (b"\7" * 16, 2))
        assert "count" not in bench.robot.command_status
        start = bench.send_goal()
        await queried(bench, 1)
        bench.answer_goal(accepted=False)
        assert (await start).outcome == "rejected"
        tell_states(bench, (b"\7" * 16, 2))
        assert (bench.shown.goal, bench.shown.busy) == ("", False)

    run(test)


def test_a_goal_that_could_not_be_sent_locks_nothing_and_hides_no_other() -> None:
    async def test(bench: Bench) -> None:
        bench.line.refuses = "send_goal"
        with pytest.raises(LinkError):
            await bench.send_goal()
        assert "count" not in bench.robot.command_status
        bench.line.refuses = ""
        assert (await bench.send_goal()).outcome == "timed_out"
        bench.line.refuses = "send_goal"
        with pytest.raises(LinkError):
            await bench.send_goal()
        tell_states(bench, (goal_id(bench), 2))
        assert (bench.shown.goal, bench.shown.can_cancel) == ("EXECUTING", True)
        await bench.actions.stop()

    run(test)


def test_a_goal_without_an_answer_is_under_way_when_the_robot_says_so() -> None:
    async def test(bench: Bench) -> None:
        assert (await bench.send_goal()).outcome == "timed_out"
        assert (bench.shown.goal, bench.shown.busy) == ("UNKNOWN", False)
        tell_states(bench, (goal_id(bench), 2))
        assert (bench.shown.goal, bench.shown.busy) == ("EXECUTING", True)
        assert [answer.outcome for _, answer in bench.corrected] == ["accepted"]
        await bench.actions.stop()

    run(test)


def test_a_goal_cut_off_before_its_answer_is_asked_for_when_the_bridge_is_back() -> None:
    async def test(bench: Bench) -> None:
        start = bench.send_goal()
        await queried(bench, 1)
        bench.lose_the_bridge()
        assert (await start).outcome == "unknown"
        assert (bench.shown.goal, bench.shown.busy) == ("UNKNOWN", True)
        bench.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), True)
        await queried(bench, 2)
        assert bench.line.queries[1][0].endswith("get_result")
        tell_states(bench, (goal_id(bench), 2))
        assert (bench.shown.goal, bench.shown.can_cancel) == ("EXECUTING", True)
        bench.line.answer(
            INTERFACES.action_types(COUNT).get_result_response, status=4, result={"sequence": [0, 1]}
        )
        await settled(bench)
        assert coded(bench.shown.text) == ("goal_succeeded",)
        assert [answer.outcome for _, answer in bench.corrected] == ["accepted", "succeeded"]

    run(test)


def test_a_goal_shows_no_state_until_its_server_is_offered_again() -> None:
    async def test(bench: Bench) -> None:
        assert (await bench.send_goal()).outcome == "timed_out"
        bench.lose_the_bridge()
        for _ in range(20):  # tasks take their turns, timers do not
            await asyncio.sleep(0)
        tell_states(bench, (goal_id(bench), 2))
        assert (bench.shown.goal, bench.shown.busy) == ("UNKNOWN", False)
        bench.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), True)
        await queried(bench, 3)
        assert (bench.shown.goal, bench.shown.can_cancel) == ("EXECUTING", True)
        assert [answer.outcome for _, answer in bench.corrected] == ["accepted"]
        await bench.actions.stop()

    run(test)


def test_a_goal_that_began_and_is_cut_off_before_its_answer_is_unknown() -> None:
    async def test(bench: Bench) -> None:
        start = bench.send_goal()
        await queried(bench, 1)
        tell_states(bench, (goal_id(bench), 2))
        bench.lose_the_bridge()
        assert (await start).outcome == "unknown"
        await in_doubt(bench)
        assert bench.shown.goal == "UNKNOWN"
        await bench.actions.stop()

    run(test)


def test_a_goal_without_an_answer_waits_for_the_news_of_the_cut() -> None:
    async def test(bench: Bench) -> None:
        start = bench.send_goal()
        await queried(bench, 1)
        bench.line.queries[0][2].set_result(None)
        await turns()
        bench.lose_the_bridge()
        assert coded((await start).text) == ("call_connection_lost",)
        await bench.actions.stop()

    run(test)


def test_a_result_that_could_not_be_asked_for_is_asked_for_again(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("app.cell.commands.goals.ASK_AGAIN_S", 0)

    async def test(bench: Bench) -> None:
        bench.line.refuses = "get_result"
        start = bench.send_goal()
        await queried(bench, 1)
        bench.answer_goal(accepted=True)
        await start
        await turns()
        assert (bench.shown.goal, bench.shown.can_cancel) == ("ACCEPTED", True)
        bench.line.refuses = ""
        await queried(bench, 2)
        bench.line.answer(
            INTERFACES.action_types(COUNT).get_result_response, status=4, result={"sequence": []}
        )
        await settled(bench)
        assert [answer.outcome for _, answer in bench.corrected] == ["succeeded"]

    run(test)


def test_error_while_following_a_goal_leaves_its_result_unknown(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def fails(*_: Any) -> str:
        raise ZeroDivisionError

    async def test(bench: Bench) -> None:
        await accepted(bench)
        monkeypatch.setattr("app.cell.commands.goals.with_fields", fails)
        bench.line.answer(
            INTERFACES.action_types(COUNT).get_result_response, status=4, result={"sequence": []}
        )
        await settled(bench)
        assert (bench.shown.goal, bench.shown.busy) == ("UNKNOWN", False)
        assert bench.shown.text == say("goal_server_error")
        assert [answer.outcome for _, answer in bench.corrected] == ["unknown"]

    run(test)


def test_a_goal_without_any_news_is_queried_only_for_a_while() -> None:
    async def test(bench: Bench) -> None:
        bench.robot.traits = replace(TRAITS, loss_delay_s=0.0)
        for number in range(TRAITS.max_unanswered):
            assert (await bench.send_goal()).outcome == "timed_out"
            await queried(bench, 2 * (number + 1))
        assert bench.line.timeouts[1] == LATE_S
        assert (await bench.send_goal()).outcome == "refused"
        assert len(bench.line.queries) == 2 * TRAITS.max_unanswered
        for _, _, future in bench.line.queries:
            if not future.done():
                future.set_result(None)
        await settled(bench)
        assert bench.corrected == []  # what was said of them stands
        assert (await bench.send_goal()).outcome == "timed_out"
        await bench.actions.stop()

    run(test)


def test_goal_of_a_stopped_server_is_unknown_and_queried_when_the_server_returns() -> None:
    async def test(bench: Bench) -> None:
        await accepted(bench)
        token = bridge_dialect.server_token(BRIDGE, "AS", "count", COUNT)
        bench.robot.graph.apply_token(token, False)
        bench.actions.on_graph_change()
        await in_doubt(bench)
        assert (bench.shown.goal, bench.shown.can_cancel) == ("UNKNOWN", False)
        assert bench.shown.text == say("goal_action_gone", name="/count")
        bench.robot.graph.apply_token(token, True)
        await queried(bench, 3)
        assert locked_by(bench) == "goal_may_be_running"
        bench.line.answer(
            INTERFACES.action_types(COUNT).get_result_response, status=0, result={"sequence": []}
        )
        await settled(bench)
        assert bench.shown.text == say("goal_forgotten")
        assert [answer.outcome for _, answer in bench.corrected] == ["unknown", "unknown"]

    run(test)


async def in_doubt(bench: Bench) -> None:
    """It may be under way."""
    while bench.shown.outcome != "unknown":
        await asyncio.sleep(0)
    assert bench.shown.busy


def locked_by(bench: Bench) -> str:
    """Why no goal is sent, long after its server was offered."""
    verdict = call_blocked(bench.count, bench.robot, time.monotonic() + 60)
    return verdict.code if verdict else ""


async def settled(bench: Bench) -> None:
    """Nothing is followed any more."""
    await when(lambda: not bench.actions._results.goals)


def test_feedback_and_results_of_any_length_are_cut() -> None:
    async def test(bench: Bench) -> None:
        types = INTERFACES.action_types(COUNT)
        await accepted(bench)
        long = {"sequence": list(range(300_000))}
        feedback = {"goal_id": {"uuid": goal_id(bench)}, "feedback": long}
        bench.actions.on_feedback(
            "/count", sample_of(INTERFACES.encode(types.feedback_message, feedback))
        )
        bench.line.answer(types.get_result_response, status=4, result=long)
        assert str(bench.shown.text).startswith("In progress. so far [0, 1, 2, ")
        assert len(str(bench.shown.text)) < 2 * MAX_VALUE_CHARS
        await settled(bench)
        assert str(bench.shown.text).endswith("…")
        assert len(str(bench.corrected[0][1].text)) < 2 * MAX_VALUE_CHARS

    run(test)


def test_feedback_and_states_that_can_not_be_read_are_counted_and_fill_no_log(
    caplog: pytest.LogCaptureFixture,
) -> None:
    async def test(bench: Bench) -> None:
        await accepted(bench)
        for number in range(100):
            garbage = Sample(b"\0\1\0\0\xff", number, number / 10, 0.0, BRIDGE)
            bench.actions.on_feedback("/count", garbage)
            bench.actions.on_status("/count", garbage)
        counted = {"count/_action/feedback": 100, "count/_action/status": 100}
        assert bench.robot.traffic.undecodable == counted
        lines = [line for line in caplog.messages if "_action" in line]
        assert len(lines) == len(counted)
        assert bench.shown.goal == "ACCEPTED"
        await bench.actions.stop()

    run(test)


def test_feedback_of_another_programs_goal_is_passed_over() -> None:
    async def test(bench: Bench) -> None:
        types = INTERFACES.action_types(COUNT)
        start = bench.send_goal()
        await queried(bench, 1)
        bench.line.answer(types.send_goal_response, accepted=True, stamp={"sec": 0, "nanosec": 0})
        await start
        before = bench.robot.command_status["count"]
        other = {"goal_id": {"uuid": [7] * 16}, "feedback": {"sequence": [1]}}
        for payload in (INTERFACES.encode(types.feedback_message, other), b"\xff" * 9):
            bench.actions.on_feedback("/count", sample_of(payload))
        assert bench.robot.command_status["count"] == before
        await bench.actions.stop()

    run(test)


def test_feedback_is_taken_in_and_waits_for_the_next_frame() -> None:
    async def test(bench: Bench) -> None:
        types = INTERFACES.action_types(COUNT)
        start = bench.send_goal()
        await queried(bench, 1)
        bench.answer_goal(True)
        await start
        await queried(bench, 2)
        shows = len(bench.shows)
        goal_id = INTERFACES.decode(types.get_result_request, bench.line.queries[1][1]).goal_id.uuid
        for number in range(100):
            feedback = {"goal_id": {"uuid": goal_id}, "feedback": {"sequence": [number]}}
            payload = INTERFACES.encode(types.feedback_message, feedback)
            bench.actions.on_feedback("/count", sample_of(payload))
        assert bench.shown.fraction == 0.99
        assert len(bench.shows) == shows
        await bench.actions.stop()

    run(test)


def sample_of(payload: bytes) -> Sample:
    return Sample(payload, 1, 0.0, 0.0, BRIDGE)
