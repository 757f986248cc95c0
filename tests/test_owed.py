"""Answers on sockets are waited for when the server ends, and not for ever."""

import asyncio
import time
from typing import Final

from app.concurrency import InFlight
from tests.support.parts import ENOUGH_S

SOON_S: Final = 0.05


def test_it_waits_until_all_are_told() -> None:
    asyncio.run(_until_all_are_told())


async def _until_all_are_told() -> None:
    owed = InFlight()
    await owed.drained(0)  # no one waits
    with owed.track():
        with owed.track():
            pass
        told = asyncio.create_task(owed.drained(5))
        await asyncio.sleep(SOON_S)
        assert not told.done()
    async with asyncio.timeout(1):
        await told


def test_it_waits_no_longer_than_it_may() -> None:
    asyncio.run(_no_longer_than_it_may())


async def _no_longer_than_it_may() -> None:
    owed = InFlight()
    with owed.track():
        began = time.monotonic()
        await owed.drained(SOON_S)
        assert SOON_S <= time.monotonic() - began < ENOUGH_S
