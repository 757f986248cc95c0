"""A task that no one waits for: its failure is logged, its end by the server is none."""

import asyncio
import logging

import pytest

from app.concurrency import spawn_logged
from app.ros_logging import RobotLog

LOG = RobotLog(logging.getLogger("kiosk.tasks"), "Robot 1")


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
