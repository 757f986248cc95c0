"""Tasks and waits: what is in flight is drained, what waits can be cancelled, a failure is logged."""

import ast
import asyncio
import gc
import logging
import time
import weakref
from collections.abc import Iterator
from typing import Final, TypeGuard

import pytest

from app.system import concurrency
from app.system.concurrency import CancellableWaits, InFlight, keep_running, spawn_logged
from app.system.log import RobotLog
from tests.support.parts import ENOUGH_S, ROOT
from tests.support.waiting import turns

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
        await turns()
        assert not drained.done()
    async with asyncio.timeout(1):
        await drained


def test_a_spawned_task_that_nothing_else_knows_of_goes_on() -> None:
    """The event loop alone does not keep it: it vanished while it waited."""
    futures: list[weakref.ref[asyncio.Future[None]]] = []

    async def waits() -> None:
        future = asyncio.get_running_loop().create_future()
        futures.append(weakref.ref(future))
        await future
        futures.clear()

    async def scene() -> None:
        spawn_logged(waits(), LOG, "waiting failed")
        await turns()
        gc.collect()
        (kept,) = (future() for future in futures)
        assert kept is not None
        kept.set_result(None)
        await turns()
        assert futures == []

    asyncio.run(scene())


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


def test_what_fails_is_started_again_and_logged_once(
    caplog: pytest.LogCaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(concurrency, "RESTART_S", 0.0)
    failures = iter(["in vain", "in vain", "in vain", "otherwise"])

    async def works() -> None:
        if (failure := next(failures, None)) is not None:
            raise ZeroDivisionError(failure)

    async def begun() -> None:
        await keep_running(works, LOG, "counting failed")

    asyncio.run(begun())
    assert next(failures, None) is None
    assert [str(record.exc_info[1]) for record in caplog.records if record.exc_info] == [
        "in vain",
        "otherwise",
    ]


def test_what_is_kept_running_can_be_cancelled_in_its_pause() -> None:
    began = []

    async def works() -> None:
        began.append(True)
        raise ZeroDivisionError

    async def begun() -> None:
        task = keep_running(works, LOG, "counting failed")
        await asyncio.sleep(0)
        task.cancel()
        await asyncio.gather(task, return_exceptions=True)

    asyncio.run(begun())
    assert began == [True]


SERVER_ROOMS: Final = (
    *("cell/link/*.py", "cell/commands/**/*.py", "cell/session/*.py", "cell/people/*.py"),
    *("ros/zenoh/*.py", "ros/graph/*.py", "system/*.py", "*.py"),
)
MAY_END: Final = {
    ("goals.py", "_track"),  # the goal's result is "unknown" then
    ("concurrency.py", "_restarted"),  # what keeps the others running
}


def test_each_task_that_goes_on_is_kept_running() -> None:
    """A task that ends for ever leaves what it knew as it was: a list that is not asked for again, a
    robot whose silence no one notices."""
    once = set()
    for room in SERVER_ROOMS:
        for file in (ROOT / "app").glob(room):
            tree = ast.parse(file.read_text())
            endless = {node.name for node in ast.walk(tree) if _goes_on(node)}
            once |= {(file.name, name) for name in _started_once(tree) if name in endless}
    assert once == MAY_END


def _goes_on(node: ast.AST) -> TypeGuard[ast.AsyncFunctionDef]:
    """Whether a coroutine has a loop that waits, and no end of its own."""
    if not isinstance(node, ast.AsyncFunctionDef):
        return False
    loops = [each for each in ast.walk(node) if isinstance(each, ast.While)]
    return any(
        isinstance(loop.test, ast.Constant) and any(isinstance(at, ast.Await) for at in ast.walk(loop))
        for loop in loops
    )


def _started_once(tree: ast.AST) -> Iterator[str]:
    """The names of the coroutines that are started as tasks but not kept running."""
    for call in ast.walk(tree):
        if isinstance(call, ast.Call) and _name(call.func) in ("spawn_logged", "create_task"):
            work = call.args[0]
            if isinstance(work, ast.Call):
                yield _name(work.func)


def _name(node: ast.AST) -> str:
    return str(getattr(node, "attr", "") or getattr(node, "id", ""))
