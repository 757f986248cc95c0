"""Goals of before the server's start: what the log knows of them, what is asked, shown and logged."""

import asyncio
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from app.cell.commands.goals import LOOK_BACK_S, RESULT_S, GoalRecovery, goal_id
from app.cell.commands.services import LATE_S
from app.cell.permission.verdict import call_blocked
from app.records import Entry, Filter, Limits, OpenPress, OperatorLog, Origin, new_entry
from app.records.database import open_presses, rows
from app.records.entry import IDLE
from app.records.press_record import PressLog
from app.records.store import Store
from app.ros.dialects import bridge_dialect
from app.system.errors import LogError
from tests.cell.commands.test_calls_and_goals import COUNT, Bench, queried, sample_of, tell_states
from tests.support.builders import BRIDGE, INTERFACES, TRAITS
from tests.support.waiting import turns, when
from tests.support.words import english

FROM = Origin(address="10.0.0.7")
TYPES = INTERFACES.action_types(COUNT)
GONE = "The operator's log cannot be read: gone."


async def opened(folder: Path) -> OperatorLog:
    log = OperatorLog(folder, Limits())
    await log.start()
    return log


async def pressed(
    log: OperatorLog, press_id: str = "g1", *outcomes: str, robot: str = "", widget: str = "count"
) -> Entry:
    """A press of the server before, with what the log says came of it."""
    about = {"robot": robot, "press": press_id, "widget": widget, "action": "press"}
    entry = await log.pressed(new_entry("pressed", FROM, {}, **about))
    assert entry is not None
    for number, outcome in enumerate(outcomes):
        await log.closed(entry.follow_up("corrected" if number else "closed", outcome, "So."))
    return entry


def open_presses_in(folder: Path, robot: str = "", since: int = 0) -> list[OpenPress]:
    return open_presses(folder, robot, ["count"], since)


def test_log_lists_presses_without_a_final_entry(tmp_path: Path) -> None:
    async def test() -> None:
        log = await opened(tmp_path)
        await pressed(log, "done", "accepted", "succeeded")
        await pressed(log, "refused", "refused")
        await pressed(log, "another", "accepted", widget="drive")
        await pressed(log, "of-another", "accepted", robot="arm")
        await pressed(log, "cut off")
        await pressed(log, "goes on", "accepted", "unknown")
        await pressed(log, "silent", "timed_out")
        about = {"widget": "count", "press": "x", "action": "cancel"}
        await log.pressed(new_entry("pressed", FROM, {}, **about))
        await log.stop()

    asyncio.run(test())
    outcomes = [
        (press.press.press, press.outcome, press.accepted) for press in open_presses_in(tmp_path)
    ]
    assert outcomes == [
        ("silent", "timed_out", False),
        ("goes on", "unknown", True),
        ("cut off", "", False),
    ]
    assert [press.press.press for press in open_presses_in(tmp_path, "arm")] == ["of-another"]
    assert open_presses_in(tmp_path, since=round((time.time() + 1) * 1000)) == []


class Rig:
    """A server that has just started: with the log of the one before, and a robot that offers."""

    def __init__(self, log: OperatorLog, folder: Path) -> None:
        self.bench = Bench()
        self.log = log
        self.folder = folder
        logbook = PressLog(log)
        self.resuming = GoalRecovery(
            self.bench.panel, self.bench.robot, logbook, self.bench.actions, lambda: None, 0.01
        )

    @property
    def lock(self) -> str:
        verdict = call_blocked(self.bench.count, self.bench.robot, time.monotonic())
        return verdict.code if verdict else ""

    async def started(self, questions: int = 1) -> None:
        """Resumed, and the robot was asked as often."""
        await self.resuming.start()
        await queried(self.bench, questions)

    def outcomes(self, press_id: str = "g1") -> list[str]:
        rows_ = reversed(rows(self.folder, Filter(every=True), None, 1000))
        return [row.entry.outcome for row in rows_ if row.entry.press == press_id]

    async def answer(self, number: int = -1, **fields: Any) -> None:
        """The robot's answer to `get_result`, and what comes of it."""
        self.bench.line.answer(
            TYPES.get_result_response, number, **{"result": {"sequence": []}, **fields}
        )
        await self.open()

    async def open(self) -> None:
        await when(lambda: not self.bench.shown.busy)


Test = Callable[[Rig, Entry], Coroutine[Any, Any, None]]


def run(folder: Path, test: Test, *outcomes: str) -> None:
    """A press of the server before with these outcomes; then the test with the next server."""

    async def whole() -> None:
        before = await opened(folder)
        entry = await pressed(before, "g1", *outcomes)
        await before.stop()
        log = await opened(folder)
        rig = Rig(log, folder)
        try:
            await test(rig, entry)
        finally:
            await rig.resuming.stop()
            await rig.bench.actions.stop()
            await log.stop()

    asyncio.run(whole())


def queried_goal(rig: Rig, number: int = -1) -> bytes:
    key, payload, _ = rig.bench.line.queries[number]
    assert key == "count/_action/get_result"
    return bytes(INTERFACES.decode(TYPES.get_result_request, payload).goal_id.uuid)


def test_an_accepted_goal_is_in_doubt_and_asked_for_by_its_entry(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        shown = rig.bench.shown
        assert "may still be running" in str(shown.text)
        assert (shown.busy, shown.can_cancel, shown.goal, shown.press) == (True, True, "UNKNOWN", "g1")
        assert rig.lock == "goal_may_be_running"
        assert queried_goal(rig) == goal_id(entry.hash).bytes
        assert rig.bench.line.timeouts == [LATE_S]
        tell_states(rig.bench, (bytes(16), 2))
        assert rig.bench.shown == shown
        tell_states(rig.bench, (goal_id(entry.hash).bytes, 2))
        assert (rig.bench.shown.goal, rig.lock) == ("EXECUTING", "press_in_progress")
        await rig.answer(status=4)
        assert str(rig.bench.shown.text).startswith("Succeeded at ")
        assert len(rig.bench.line.queries) == 1
        await rig.log.stop()
        assert rig.outcomes() == ["", "accepted", "unknown", "accepted", "succeeded"]

    run(tmp_path, test, "accepted")


def test_goal_is_queried_until_its_result_is_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("app.cell.commands.goals.ASK_AGAIN_S", 0)

    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        rig.bench.line.queries[0][2].set_result(None)
        await queried(rig.bench, 2)
        assert rig.lock == "goal_may_be_running"
        tell_states(rig.bench, (goal_id(entry.hash).bytes, 2))
        rig.bench.line.queries[1][2].set_result(None)
        await queried(rig.bench, 3)
        assert rig.bench.line.timeouts == [LATE_S, LATE_S, RESULT_S]
        assert rig.lock == "press_in_progress"

    run(tmp_path, test, "accepted")


def test_goal_is_queried_and_canceled_only_while_its_server_is_offered(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        token = bridge_dialect.server_token(BRIDGE, "AS", "count", COUNT)
        rig.bench.robot.graph.apply_token(token, False)
        await rig.started(questions=0)
        assert (rig.bench.shown.busy, rig.bench.shown.can_cancel) == (True, False)
        tell_states(rig.bench, (goal_id(entry.hash).bytes, 2))
        assert rig.bench.shown.goal == "UNKNOWN"
        rig.bench.robot.graph.apply_token(token, True)
        await queried(rig.bench, 1)
        assert rig.bench.shown.goal == "EXECUTING"

    run(tmp_path, test, "accepted")


def test_cut_connection_leaves_the_goal_in_doubt(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        rig.bench.lose_the_bridge()
        assert (rig.bench.shown.busy, rig.bench.shown.can_cancel) == (True, False)
        rig.bench.robot.graph.apply_token(bridge_dialect.bridge_token(BRIDGE), True)
        await queried(rig.bench, 2)
        assert rig.bench.shown.can_cancel
        assert queried_goal(rig) == goal_id(entry.hash).bytes

    run(tmp_path, test, "accepted")


def test_feedback_shows_that_a_goal_is_running(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        goal = {"uuid": goal_id(entry.hash).bytes}
        said = {"goal_id": goal, "feedback": {"sequence": [1]}}
        rig.bench.actions.on_feedback(
            "/count", sample_of(INTERFACES.encode(TYPES.feedback_message, said))
        )
        assert english((rig.bench.shown.goal, rig.bench.shown.text)) == (
            "EXECUTING",
            "In progress. so far [1]",
        )

    run(tmp_path, test, "accepted")


@pytest.mark.parametrize(
    ("before", "words"),
    [(["accepted"], "no longer knows this goal"), ([], "does not know this goal")],
)
def test_goal_unknown_to_the_robot_unlocks_and_is_logged(
    tmp_path: Path, before: list[str], words: str
) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        await rig.answer(status=0)
        assert words in str(rig.bench.shown.text)
        assert rig.lock == ""
        await rig.log.stop()
        assert rig.outcomes() == ["", *before, "unknown", "unknown"]
        assert len(open_presses_in(tmp_path)) == 1
        again = Rig(await opened(tmp_path), tmp_path)
        await again.resuming.start()
        assert "count" not in again.bench.robot.command_status
        await again.log.stop()

    run(tmp_path, test, *before)


def test_goal_that_ended_in_the_meantime_has_no_end_time(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        await rig.answer(status=5)
        assert str(rig.bench.shown.text).startswith("Canceled before ")

    run(tmp_path, test, "accepted")


def test_goal_without_any_response_locks_for_a_limited_time(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        assert rig.bench.line.timeouts == [LATE_S]
        rig.bench.line.queries[0][2].set_result(None)
        await rig.open()
        assert "The robot has not reported on this goal for 60 s" in str(rig.bench.shown.text)
        assert rig.lock == ""

    run(tmp_path, test, "timed_out")


def test_cancel_finds_a_running_goal(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        assert await canceled(rig, 0) == "accepted"
        assert rig.bench.shown.goal == "CANCELING"
        await rig.log.stop()
        assert rig.outcomes()[-1] == "accepted"

    run(tmp_path, test, "accepted")


def test_cancel_of_an_unknown_goal_queries_the_goal_again(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.started()
        assert await canceled(rig, 2) == "rejected"
        await queried(rig.bench, 3)
        assert queried_goal(rig) == goal_id(entry.hash).bytes
        await rig.answer(status=0)
        assert rig.lock == ""

    run(tmp_path, test, "accepted")


async def canceled(rig: Rig, return_code: int) -> str:
    request, response = INTERFACES.service_types("action_msgs/srv/CancelGoal")
    cancel = asyncio.create_task(rig.bench.actions.cancel(rig.bench.count, "g1"))
    await queried(rig.bench, 2)
    info = INTERFACES.decode(request, rig.bench.line.queries[-1][1]).goal_info
    goal = {"goal_id": {"uuid": info.goal_id.uuid}, "stamp": {"sec": 0, "nanosec": 0}}
    goals = [] if return_code else [goal]
    rig.bench.line.answer(response, return_code=return_code, goals_canceling=goals)
    return (await cancel).outcome


def test_a_press_id_that_was_used_twice_is_of_two_goals(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As in logs of before an id was looked up."""
    monkeypatch.setattr(Store, "entries_of_press", lambda *_: [])

    async def test(rig: Rig, entry: Entry) -> None:
        again = await pressed(rig.log, "g1", "accepted")
        await rig.started(questions=2)
        assert {queried_goal(rig, 0), queried_goal(rig, 1)} == {
            goal_id(logged.hash).bytes for logged in (entry, again)
        }

    run(tmp_path, test, "accepted")


def test_no_more_are_asked_for_than_may_be_sent_and_the_newest_is_shown(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        for number in range(TRAITS.max_unanswered + 1):
            await pressed(rig.log, f"n{number}", "timed_out")
        await rig.started(questions=TRAITS.max_unanswered)
        assert rig.bench.shown.press == f"n{TRAITS.max_unanswered}"
        await turns()
        assert len(rig.bench.line.queries) == TRAITS.max_unanswered

    run(tmp_path, test, "accepted")


def test_goals_of_another_robot_or_older_than_a_day_are_not_followed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await pressed(rig.log, "g2", "accepted", robot="arm")
        now = time.time()
        monkeypatch.setattr(time, "time", lambda: now + LOOK_BACK_S + 10)
        await rig.resuming.start()
        assert "count" not in rig.bench.robot.command_status

    run(tmp_path, test, "accepted")


@contextmanager
def unreadable(rig: Rig, monkeypatch: pytest.MonkeyPatch, *, unneeded: bool) -> Iterator[None]:
    """A log that can't be read; `unneeded`: the panel goes on without it."""

    async def gone(*about: Any) -> list[OpenPress]:
        raise LogError(GONE)

    with monkeypatch.context() as broken:
        broken.setattr(rig.log, "open_presses", gone)
        broken.setattr(PressLog, "is_bypassed", unneeded)
        yield


@pytest.mark.parametrize("needed", [True, False])
def test_unreadable_log_is_reported_as_unknown_goals(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, needed: bool
) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        with unreadable(rig, monkeypatch, unneeded=not needed):
            await rig.resuming.start()
            assert str(rig.bench.shown.text).endswith(f"is still running: {GONE}")
            assert (rig.bench.shown.busy, rig.bench.shown.can_cancel) == (needed, False)
            await turns()
            assert rig.bench.line.queries == []
        await queried(rig.bench, 1)
        assert rig.bench.shown.press == "g1"

    run(tmp_path, test, "accepted")


def test_results_during_an_unreadable_log_count(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        with unreadable(rig, monkeypatch, unneeded=False):
            await rig.resuming.start()
            tell_states(rig.bench, (goal_id(entry.hash).bytes, 2))
        await queried(rig.bench, 1)
        assert rig.bench.line.timeouts == [RESULT_S]
        assert (rig.bench.shown.goal, rig.lock) == ("EXECUTING", "press_in_progress")

    run(tmp_path, test)


def test_goals_sent_during_an_unreadable_log_stay_shown(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        with unreadable(rig, monkeypatch, unneeded=True):
            await rig.resuming.start()
            assert rig.lock == ""
            start = rig.bench.send_goal("own")
            await queried(rig.bench, 1)
            rig.bench.answer_goal(accepted=True)
            await start
            await queried(rig.bench, 2)
        await queried(rig.bench, 3)
        assert queried_goal(rig) == goal_id(entry.hash).bytes
        assert (rig.bench.shown.press, rig.bench.shown.goal) == ("own", "ACCEPTED")

    run(tmp_path, test, "accepted")


def test_a_log_that_is_not_open_yet_says_nothing(tmp_path: Path) -> None:
    async def test() -> None:
        log = OperatorLog(tmp_path, Limits())
        with pytest.raises(LogError, match="cannot be read"):
            await log.open_presses("", ["count"], 0)
        await log.start()
        assert await log.open_presses("", ["count"], 0) == []
        await log.stop()

    asyncio.run(test())


def test_a_panel_without_a_goal_of_before_shows_none(tmp_path: Path) -> None:
    async def test(rig: Rig, entry: Entry) -> None:
        await rig.resuming.start()
        assert rig.bench.robot.command_status.get("count", IDLE) == IDLE

    run(tmp_path, test, "accepted", "succeeded")
