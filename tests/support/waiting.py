"""Waiting in an event loop: for a condition, for what is ready, or by setting its clock ahead. None of
them depends on how busy the machine is."""

import asyncio
from collections.abc import Callable
from typing import Final

ENOUGH_S: Final = 40.0
LOOKS_EVERY_S: Final = 0.002
TURNS: Final = 50


async def when(condition: Callable[[], object], why: str = "") -> None:
    """Waits for a condition, for threads and processes as well; AssertionError if it does not come."""
    try:
        async with asyncio.timeout(ENOUGH_S):
            while not condition():
                await asyncio.sleep(LOOKS_EVERY_S)
    except TimeoutError:
        raise AssertionError(f"not within {ENOUGH_S} s: {why}") from None


async def turns(count: int = TURNS) -> None:
    """Runs all that is ready, and what that makes ready: as many turns of the loop."""
    for _ in range(count):
        await asyncio.sleep(0)


def set_ahead(seconds: float) -> None:
    """Sets the loop's clock ahead; what is due by then runs in the loop's next turn."""
    loop = asyncio.get_running_loop()
    earlier = loop.time
    vars(loop)["time"] = lambda: earlier() + seconds


async def pass_time(seconds: float) -> None:
    """Sets the loop's clock ahead, and runs what is due by then."""
    set_ahead(seconds)
    await turns()
