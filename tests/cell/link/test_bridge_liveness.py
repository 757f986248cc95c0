"""The bridges' silence: by a clock that the test sets, on a link whose answers the test sets."""

import asyncio
from collections.abc import Callable, Coroutine
from functools import partial
from typing import Any

import pytest

from app.cell.link import liveness
from app.cell.link.bridge import BridgeLiveness
from app.cell.link.liveness import (
    DELAYS_KEPT,
    EVERY_S,
    GOOD,
    LONGEST_S,
    LivenessDetector,
    until_next,
)
from app.cell.permission.interlocks import link_verdict
from app.cell.robot.state import RobotState
from app.ros.dialects import bridge_dialect
from app.system.errors import LinkError
from tests.support.builders import (
    BRIDGE,
    FakeTransport,
    press_widget,
    presses_of,
    robot_there,
    small_panel,
)
from tests.support.waiting import set_ahead, turns, when

LAN_S = 0.001


def network(silence: LivenessDetector, took_s: float, begin: float, count: int) -> float:
    """Questions of which each is answered after so long; returns when the last one was."""
    events = [(begin + n * EVERY_S, None) for n in range(count)]
    heard = [(sent_at + took_s, sent_at) for sent_at, _ in events]
    for now, sent_at in sorted([*events, *heard], key=lambda event: event[0]):
        if sent_at is None:
            silence.on_query(now)
        else:
            silence.on_reply(sent_at, now)
        silence.judge(now)
    return max(now for now, _ in heard)


def test_a_bridge_that_answers_is_not_silent() -> None:
    silence = LivenessDetector()
    network(silence, LAN_S, 0.0, 100)
    assert not silence.silent


def test_no_answer_is_silence_after_its_limit() -> None:
    silence = LivenessDetector()
    end = network(silence, LAN_S, 0.0, 10)
    silence.on_query(end)
    silence.judge(end + silence.limit - 0.01)
    assert not silence.silent
    silence.judge(end + silence.limit + LAN_S)
    assert silence.silent


def test_bridge_without_a_query_is_not_silent() -> None:
    """A server that stood still has not asked in the meantime."""
    silence = LivenessDetector()
    end = network(silence, LAN_S, 0.0, 10)
    silence.judge(end + 60)
    assert not silence.silent


def test_silence_ends_with_timely_replies_to_later_queries() -> None:
    silence = LivenessDetector()
    end = network(silence, LAN_S, 0.0, 10)
    for n in range(20):
        silence.on_query(end + n * EVERY_S)
        silence.judge(end + n * EVERY_S)
    thaw = end + 20 * EVERY_S
    for n in range(18):  # all that waited comes at once
        silence.on_reply(end + n * EVERY_S, thaw)
    assert silence.silent
    for n in range(GOOD):
        assert silence.silent
        silence.on_query(thaw + 1 + n)
        silence.on_reply(thaw + 1 + n, thaw + 1 + n + LAN_S)
    assert not silence.silent


def test_a_slow_network_is_silence_until_it_is_known_to_be_slow() -> None:
    silence = LivenessDetector()
    end = network(silence, LAN_S, 0.0, 50)
    end = network(silence, 0.7, end, DELAYS_KEPT // 2)
    assert silence.silent
    end = network(silence, 0.7, end, DELAYS_KEPT + 10)
    assert not silence.silent
    network(silence, LAN_S, end, DELAYS_KEPT)
    assert silence.limit < liveness.SILENT_S + 0.01


def test_a_loop_that_stood_still_is_no_slow_network() -> None:
    silence = LivenessDetector()
    end = network(silence, LAN_S, 0.0, DELAYS_KEPT)
    silence.on_query(end)
    silence.on_reply(end, end + 2.0)  # no one judged in the meantime
    assert not silence.silent
    assert silence.limit < liveness.SILENT_S + 0.01


@pytest.mark.parametrize(
    ("now", "pause"),
    [(10.0, 0.2), (10.05, 0.15), (10.15, 0.05), (10.199, 0.201), (10.201, 0.199)],
)
def test_robots_are_asked_together(now: float, pause: float) -> None:
    """At multiples of the interval, whenever each began; a timer that fires early asks no second
    time."""
    assert until_next(now, 0.2) == pytest.approx(pause)


class Line(FakeTransport):
    """A link on which each question waits until the test answers it."""

    def __init__(self) -> None:
        self.queries: list[tuple[str, asyncio.Future[bool]]] = []
        self.answers = True
        self.frozen = ""  # a bridge that does not answer
        self.fails = False

    async def query_all(self, selector: str, timeout_s: float = 2.0) -> list[tuple[str, bytes]]:
        if self.fails:
            raise LinkError("no session")
        assert timeout_s == LONGEST_S
        answered = asyncio.get_running_loop().create_future()
        self.queries.append((selector, answered))
        if self.answers and not (self.frozen and selector == bridge_dialect.version(self.frozen)):
            answered.set_result(True)
        return [(selector, b"1")] if await answered else []

    async def asked(self, selector: str, count: int) -> None:
        """Waits for so many more questions."""
        before = self._questions(selector)
        await when(lambda: self._questions(selector) >= before + count)

    def _questions(self, selector: str) -> int:
        return sum(asked == selector for asked, _ in self.queries)

    def put(self, key: str, payload: bytes) -> None: ...


def run(
    test: Callable[[Line, RobotState, BridgeLiveness, list[bool]], Coroutine[Any, Any, None]],
) -> None:
    async def benched() -> None:
        line, robot = Line(), robot_there(small_panel())
        changes: list[bool] = []
        mine = BridgeLiveness(robot, line, lambda: changes.append(robot.is_responding))
        mine.start()
        try:
            await test(line, robot, mine, changes)
        finally:
            await mine.stop()
        assert len(asyncio.all_tasks()) == 1

    asyncio.run(benched())


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(liveness, "EVERY_S", 0.02)
    monkeypatch.setattr(liveness, "SILENT_S", 0.1)
    monkeypatch.setattr(liveness, "STALLED_S", 60.0)


def test_each_bridge_is_asked_again_and_again() -> None:
    async def test(line: Line, robot: RobotState, mine: BridgeLiveness, changes: list[bool]) -> None:
        await when(lambda: len(line.queries) > 5)
        assert {selector for selector, _ in line.queries} == {bridge_dialect.version(BRIDGE)}
        assert (robot.is_responding, changes) == (True, [])

    run(test)


def test_silence_is_reported_and_its_end() -> None:
    async def test(line: Line, robot: RobotState, mine: BridgeLiveness, changes: list[bool]) -> None:
        line.answers = False
        await when(lambda: not robot.is_responding)
        line.answers = True
        await when(lambda: robot.is_responding)
        assert changes == [False, True]

    run(test)


def test_a_robot_that_hangs_does_not_delay_the_questions_to_others() -> None:
    async def benched() -> None:
        lines, robots = (Line(), Line()), (robot_there(small_panel()), robot_there(small_panel()))
        changes: list[int] = []
        asked = [
            BridgeLiveness(robot, line, partial(changes.append, number))
            for number, (robot, line) in enumerate(zip(robots, lines, strict=True))
        ]
        lines[0].answers = False
        for each in asked:
            each.start()
        await when(lambda: not robots[0].is_responding)
        count = len(lines[1].queries)
        await when(lambda: len(lines[1].queries) > count + 5)
        assert (robots[1].is_responding, changes) == (True, [0])
        for each in asked:
            await each.stop()

    asyncio.run(benched())


def test_reply_of_another_bridge_does_not_end_the_silence() -> None:
    async def test(line: Line, robot: RobotState, mine: BridgeLiveness, changes: list[bool]) -> None:
        line.answers = False
        await when(lambda: not robot.is_responding)
        robot.mark_link_lost()
        await when(lambda: robot.is_responding)

    run(test)


def test_without_a_session_nothing_is_asked_and_nothing_arrives() -> None:
    async def test(line: Line, robot: RobotState, mine: BridgeLiveness, changes: list[bool]) -> None:
        line.fails = True
        assert not await mine.flushed()

    run(test)


def test_a_loop_that_stood_still_is_no_silence(monkeypatch: pytest.MonkeyPatch) -> None:
    """The answer came in time, and was only looked at late."""
    clock = 0.0

    async def benched() -> None:
        nonlocal clock
        line, robot = Line(), robot_there(small_panel())
        mine = BridgeLiveness(robot, line, lambda: None, lambda: clock)
        line.answers = False
        mine.start()
        loop = asyncio.get_running_loop()
        await when(lambda: line.queries)

        def stand_still() -> None:
            """Its time is up before anyone looks at the answer."""
            nonlocal clock
            set_ahead(3.0)
            clock = 3.0
            line.queries[0][1].set_result(True)

        loop.call_soon(stand_still)
        await turns()
        assert robot.is_responding
        await mine.stop()

    asyncio.run(benched())


def test_a_press_is_published_when_the_bridge_has_answered_after_it() -> None:
    async def test(line: Line, robot: RobotState, mine: BridgeLiveness, changes: list[bool]) -> None:
        presses = presses_of(small_panel(), robot, line, flushed=mine.flushed)

        async def press(press_id: str) -> str:
            receipt = await press_widget(presses, "free", {"message": "hi"}, press_id)
            return f"{receipt.outcome}: {receipt.reason}"

        assert (await press("p1")).startswith("published: Sent at")
        line.answers = False
        receipt = await press("p2")
        assert receipt.startswith("unknown: Sent at")
        assert "has not responded since" in receipt

    run(test)


def test_a_frozen_bridge_stays_silent_when_another_comes_or_goes() -> None:
    async def test(line: Line, robot: RobotState, mine: BridgeLiveness, changes: list[bool]) -> None:
        robot.graph.apply_token(bridge_dialect.bridge_token("b2"), True)
        await when(lambda: bridge_dialect.version("b2") in {selector for selector, _ in line.queries})
        line.frozen = BRIDGE
        await when(lambda: changes == [False])
        robot.graph.apply_token(bridge_dialect.bridge_token("b2"), False)
        await line.asked(bridge_dialect.version(BRIDGE), 5)
        robot.graph.apply_token(bridge_dialect.bridge_token("b3"), True)
        await line.asked(bridge_dialect.version(BRIDGE), 5)
        assert changes == [False]
        line.frozen = ""
        await when(lambda: changes == [False, True])

    run(test)


def test_after_a_standstill_all_that_waited_is_taken_in_first(monkeypatch: pytest.MonkeyPatch) -> None:
    """What was asked before it is answered before what waited; so is what was asked at its end."""
    monkeypatch.setattr(liveness, "STALLED_S", 0.1)
    clock = 0.0

    async def benched() -> None:
        nonlocal clock
        line, robot = Line(), robot_there(small_panel())
        changes: list[str] = []

        def tell() -> None:
            changes.append(link_verdict(robot, clock).code)

        mine = BridgeLiveness(robot, line, tell, lambda: clock)
        line.answers = False
        mine.start()

        async def queried(count: int) -> None:
            await when(lambda: len(line.queries) >= count)

        def answer(number: int) -> None:
            line.queries[number - 1][1].set_result(True)

        await queried(1)
        clock += 0.1
        mine.check_stall()
        assert robot.is_caught_up
        clock += 3.0
        mine.check_stall()  # as it is before each press is judged
        before = len(line.queries)
        assert changes == ["link_catching_up"]
        answer(1)
        await queried(before + 1)
        answer(before + 1)
        await queried(before + 2)
        assert not robot.is_caught_up
        clock += 0.01
        later = len(line.queries)
        await queried(later + 1)
        answer(later + 1)
        await when(lambda: robot.is_caught_up)
        await mine.stop()

    asyncio.run(benched())
