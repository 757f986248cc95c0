"""The answers to a Zenoh query on the event loop."""

import asyncio

import pytest
import zenoh
from zenoh.handlers import Callback

from app.ros.zenoh.answers import collected


def test_a_cancel_that_comes_with_the_last_answer_is_not_lost() -> None:
    asyncio.run(_cancelled_as_it_ends())


async def _cancelled_as_it_ends() -> None:
    handlers: list[Callback[zenoh.Reply]] = []

    async def asks_again_and_again() -> None:
        while True:
            await collected(handlers.append, 10)

    asking = asyncio.create_task(asks_again_and_again())
    await asyncio.sleep(0)
    drop = handlers.pop().drop
    assert drop is not None
    drop()  # its end is handed over, and runs before the cancel
    asyncio.get_running_loop().call_soon(asking.cancel)
    with pytest.raises(asyncio.CancelledError):
        async with asyncio.timeout(5):
            await asking
