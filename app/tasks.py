"""Tasks that nobody waits for."""

import asyncio
import logging
from collections.abc import Coroutine
from typing import Any

from app.logs import RobotLog


def told(
    work: Coroutine[Any, Any, None], log: logging.Logger | RobotLog, failure: str
) -> "asyncio.Task[None]":
    """A task whose failure is logged, not lost."""

    def done(task: "asyncio.Task[None]") -> None:
        if not task.cancelled() and (error := task.exception()):
            log.error(failure, exc_info=error)

    task = asyncio.get_running_loop().create_task(work)
    task.add_done_callback(done)
    return task
