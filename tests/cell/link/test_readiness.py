"""Whether the bridges answer now: asked rarely, however many want to know."""

import asyncio
from collections.abc import Awaitable, Callable

from app.cell.link.liveness import LIMIT_S, READY_EVERY_S, CoalescedQuery
from app.system.errors import LinkError
from tests.support.waiting import pass_time, turns


class Bridges:
    """Bridges that answer when they are let; the questions are counted."""

    def __init__(self) -> None:
        self.questions = 0
        self.asked_at: list[float] = []
        self.answer: bool | LinkError = True
        self.asleep = False

    async def ask(self) -> bool:
        self.questions += 1
        self.asked_at.append(asyncio.get_running_loop().time())
        await asyncio.sleep(60 if self.asleep else 0)
        if isinstance(self.answer, LinkError):
            raise self.answer
        return self.answer


def run(test: Callable[[Bridges, CoalescedQuery], Awaitable[None]]) -> None:
    async def both() -> None:
        bridges = Bridges()
        readiness = CoalescedQuery(bridges.ask)
        await test(bridges, readiness)
        await readiness.stop()

    asyncio.run(both())


def test_concurrent_queries_share_one_request() -> None:
    async def test(bridges: Bridges, readiness: CoalescedQuery) -> None:
        assert await asyncio.gather(*(readiness.answers() for _ in range(100))) == [True] * 100
        assert bridges.questions == 1

    run(test)


def test_there_are_two_questions_a_second_at_most() -> None:
    async def test(bridges: Bridges, readiness: CoalescedQuery) -> None:
        loop = asyncio.get_running_loop()
        wanted_at: list[float] = []  # just before each question: a gap begins there, not later
        while bridges.questions < 3:
            before, questions = loop.time(), bridges.questions
            assert await readiness.answers()
            if bridges.questions > questions:
                wanted_at.append(before)
            await pass_time(0.01)
        gaps = [after - before for before, after in zip(wanted_at, bridges.asked_at[1:], strict=False)]
        assert len(gaps) == 2
        assert min(gaps) >= READY_EVERY_S

    run(test)


def test_an_answer_is_not_older_than_that() -> None:
    async def test(bridges: Bridges, readiness: CoalescedQuery) -> None:
        assert await readiness.answers()
        bridges.answer = False
        await pass_time(READY_EVERY_S)
        assert not await readiness.answers()

    run(test)


def test_missing_reply_takes_a_second_and_a_leaving_waiter_stops_no_other() -> None:
    async def test(bridges: Bridges, readiness: CoalescedQuery) -> None:
        bridges.asleep = True
        leaving, staying = (asyncio.ensure_future(readiness.answers()) for _ in range(2))
        await pass_time(LIMIT_S / 2)
        leaving.cancel()
        await turns()
        assert not staying.done()
        await pass_time(LIMIT_S / 2)
        assert await staying is False
        assert bridges.questions == 1

    run(test)


def test_a_link_that_can_not_ask_has_no_answer() -> None:
    async def test(bridges: Bridges, readiness: CoalescedQuery) -> None:
        bridges.answer = LinkError("no session")
        assert not await readiness.answers()

    run(test)
