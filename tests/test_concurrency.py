"""Tasks and waits: what is in flight is drained, what waits can be cancelled, a failure is logged."""

import asyncio
import logging
import time
from typing import Final

import pytest

from app.concurrency import CancellableWaits, InFlight, spawn_logged
from app.ros_logging import RobotLog
from tests.support.parts import ENOUGH_S

SOON_S: Final = 0.05
LOG = RobotLog(logging.getLogger("kiosk.tasks"), "Robot 1")


def test_draining_waits_for_all_that_is_in_flight() -> None:
    asyncio.run(_drained_when_the_last_one_ends())


async def _drained_when_the_last_one_ends() -> None:
    in_flight = InFlight()
    await in_flight.drained(0)  # nothing is in flight
    with in_flight.track():
        with in_flight.track():
            pass
        drained = asyncio.create_task(in_flight.drained(5))
        await asyncio.sleep(SOON_S)
        assert not drained.done()
    async with asyncio.timeout(1):
        await drained


def test_draining_ends_with_its_time() -> None:
    asyncio.run(_drained_within_its_time())


async def _drained_within_its_time() -> None:
    in_flight = InFlight()
    with in_flight.track():
        began = time.monotonic()
        await in_flight.drained(SOON_S)
        assert SOON_S <= time.monotonic() - began < ENOUGH_S


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


def test_pending_and_later_requests_are_canceled() -> None:
    asyncio.run(_both_and_a_later_one())


def test_finished_task_keeps_its_result() -> None:
    asyncio.run(_not_what_was_answered())


def test_a_cancelled_task_is_cancelled() -> None:
    asyncio.run(_who_is_cancelled_is_not_given_up())


def test_a_failure_is_logged_with_its_robot_and_its_place(caplog: pytest.LogCaptureFixture) -> None:
    async def fails() -> None:
        raise ZeroDivisionError("in vain")

    async def begun() -> None:
        await asyncio.gather(spawn_logged(fails(), LOG, "counting failed"), return_exceptions=True)

    asyncio.run(begun())
    (record,) = caplog.records
    assert record.getMessage() == "Robot 1: counting failed"
    assert record.exc_info is not None
    assert record.exc_info[0] is ZeroDivisionError


def test_an_end_and_a_cancel_are_no_failures(caplog: pytest.LogCaptureFixture) -> None:
    async def begun() -> None:
        task = spawn_logged(asyncio.sleep(0), LOG, "counting failed")
        await task
        task = spawn_logged(asyncio.sleep(60), LOG, "counting failed")
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(begun())
    assert caplog.records == []
