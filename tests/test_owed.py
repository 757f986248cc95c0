"""Answers on sockets are waited for when the server ends, and not for ever."""

import asyncio
import faulthandler
import signal
import time
from types import FrameType
from typing import Final

from app.main import _on_end
from app.owed import Owed

SOON_S: Final = 0.05


def test_it_waits_until_all_are_told() -> None:
    asyncio.run(_until_all_are_told())


async def _until_all_are_told() -> None:
    owed = Owed()
    await owed.told(0)  # nobody waits
    with owed.one():
        with owed.one():
            pass
        told = asyncio.create_task(owed.told(5))
        await asyncio.sleep(SOON_S)
        assert not told.done()
    async with asyncio.timeout(1):
        await told


def test_it_waits_no_longer_than_it_may() -> None:
    asyncio.run(_no_longer_than_it_may())


async def _no_longer_than_it_may() -> None:
    owed = Owed()
    with owed.one():
        began = time.monotonic()
        await owed.told(SOON_S)
        assert SOON_S <= time.monotonic() - began < 1


def test_who_listened_is_told_after_it_and_the_second_time_at_once() -> None:
    heard: list[int] = []

    def listener(number: int, frame: FrameType | None) -> None:
        heard.append(number)

    before = signal.signal(signal.SIGTERM, listener)
    try:
        asyncio.run(_told_twice(heard))
        assert signal.getsignal(signal.SIGTERM) is listener
    finally:
        faulthandler.cancel_dump_traceback_later()
        signal.signal(signal.SIGTERM, before)


async def _told_twice(heard: list[int]) -> None:
    ending, ended = asyncio.Event(), asyncio.Event()

    async def end() -> None:
        ending.set()
        await ended.wait()

    with _on_end(asyncio.get_running_loop(), end):
        signal.raise_signal(signal.SIGTERM)
        async with asyncio.timeout(1):
            await ending.wait()
        assert heard == []
        signal.raise_signal(signal.SIGTERM)
        assert heard == [signal.SIGTERM]
        ended.set()
        await asyncio.sleep(SOON_S)
        assert heard == [signal.SIGTERM] * 2
