"""An operator's log in a separate event loop of the test."""

import asyncio
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Final

from app.records import Entry, Limits, OperatorLog, Origin, new_entry
from app.records import log as audit_log
from tests.support.waiting import when

LIMITS: Final = Limits()
DISK_WITHIN_S: Final = 8.0


def wait_for_the_disk() -> None:
    """Lets presses in this process wait longer for their entries: the disk of a machine that runs tests
    may stall for some seconds. Tests of that wait set another time."""
    vars(audit_log).update(PRESSED_WITHIN_S=DISK_WITHIN_S, CLOSED_WITHIN_S=DISK_WITHIN_S)


def run(
    folder: Path, work: Callable[[OperatorLog], Awaitable[object]], limits: Limits = LIMITS
) -> None:
    """Runs with a log that is started before and always stopped afterwards."""

    async def opened() -> None:
        log = OperatorLog(folder, limits)
        await log.start()
        try:
            await work(log)
        finally:
            await log.stop()

    asyncio.run(opened())


async def until_good(log: OperatorLog) -> None:
    """Waits until the log can be written."""
    await when(lambda: not log.fault)


def pressed(number: int = 1) -> Entry:
    return new_entry("pressed", Origin(address="10.0.0.7"), {}, press=f"p{number}", action="press")


def sent(entry: Entry | None) -> Entry:
    """The entry that follows one of a press."""
    assert entry is not None
    return entry.follow_up("closed", "published", "Sent.")
