"""The answers to a Zenoh query on the event loop."""

import asyncio
from collections.abc import Callable
from typing import Any

import pytest

from app.transport.zenoh_answers import collected


def test_a_cancel_that_comes_with_the_last_answer_is_not_lost() -> None:
    asyncio.run(_cancelled_as_it_ends())


async def _cancelled_as_it_ends() -> None:
    ends: list[Callable[[], None]] = []

    async def asks_again_and_again() -> None:
        while True:
            await collected(lambda callback: ends.append(callback.drop), 10)

    def end(asking: "asyncio.Task[Any]") -> None:
        ends.pop()()  # its end is handed over, and runs before the cancel
        asyncio.get_running_loop().call_soon(asking.cancel)

    asking = asyncio.create_task(asks_again_and_again())
    await asyncio.sleep(0)
    end(asking)
    with pytest.raises(asyncio.CancelledError):
        async with asyncio.timeout(5):
            await asking
