"""What waits for the robot can be given up; what does not wait is done."""

import asyncio

import pytest

from app.concurrency import CancellableWaits


async def waits(on: CancellableWaits, event: asyncio.Event) -> str:
    try:
        async with on.cancellable():
            await event.wait()
    except TimeoutError:
        return "given up"
    return "answered"


async def _both_and_a_later_one() -> None:
    mine, event = CancellableWaits(), asyncio.Event()
    first, second = (asyncio.create_task(waits(mine, event)) for _ in range(2))
    await asyncio.sleep(0)
    mine.cancel_all()
    assert list(await asyncio.gather(first, second)) == ["given up", "given up"]
    assert await waits(mine, event) == "given up"
    async with mine.cancellable():
        pass  # nothing in it waits


async def _not_what_was_answered() -> None:
    mine, event = CancellableWaits(), asyncio.Event()
    event.set()
    assert await waits(mine, event) == "answered"
    mine.cancel_all()


async def _who_is_cancelled_is_not_given_up() -> None:
    mine = CancellableWaits()
    task = asyncio.create_task(waits(mine, asyncio.Event()))
    await asyncio.sleep(0)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task


def test_all_that_waits_is_given_up_and_what_comes_later() -> None:
    asyncio.run(_both_and_a_later_one())


def test_what_was_answered_stays_answered() -> None:
    asyncio.run(_not_what_was_answered())


def test_a_cancelled_task_is_cancelled() -> None:
    asyncio.run(_who_is_cancelled_is_not_given_up())
