"""The first signal waits for the answers that are due; a second Ctrl+C ends at once, no other does."""

import asyncio
import faulthandler
import logging
import signal
from collections.abc import Iterator
from contextlib import ExitStack
from types import FrameType

import pytest

from app.system.process.shutdown import graceful_shutdown

INT, TERM, HUP = signal.SIGINT, signal.SIGTERM, signal.SIGHUP


@pytest.fixture
def heard() -> Iterator[list[int]]:
    """What a listener of before hears."""
    signals: list[int] = []

    def listener(number: int, frame: FrameType | None) -> None:
        signals.append(number)

    before = {n: signal.signal(n, listener) for n in (INT, TERM)} | {
        HUP: signal.signal(HUP, signal.SIG_DFL)
    }
    yield signals
    assert signal.getsignal(TERM) is listener
    for number, handler in before.items():
        signal.signal(number, handler)
    faulthandler.cancel_dump_traceback_later()


class EndingProcess:
    """A process after a signal to end, with answers that are still due."""

    def __init__(self) -> None:
        self.ending, self.may_end = asyncio.Event(), asyncio.Event()
        self.is_over = asyncio.Event()

    async def end(self) -> None:
        self.ending.set()
        await self.may_end.wait()
        self.is_over.set()

    async def by(self, number: signal.Signals, stack: ExitStack) -> None:
        stack.enter_context(graceful_shutdown(asyncio.get_running_loop(), self.end))
        signal.raise_signal(number)
        async with asyncio.timeout(1):
            await self.ending.wait()

    async def ended(self) -> None:
        """What follows `end` runs in its own step of the loop, before this one returns."""
        self.may_end.set()
        await self.is_over.wait()


@pytest.mark.parametrize(("by", "later"), [(TERM, TERM), (INT, TERM), (HUP, HUP), (HUP, TERM)])
def test_former_signal_handler_is_called_once_after_shutdown(
    heard: list[int], by: signal.Signals, later: signal.Signals
) -> None:
    async def run() -> None:
        process = EndingProcess()
        with ExitStack() as stack:
            await process.by(by, stack)
            signal.raise_signal(later)
            assert heard == []
            await process.ended()

    asyncio.run(run())
    assert heard == [INT if by is INT else TERM]


def test_second_interrupt_exits_at_once_and_a_third_is_passed_on(heard: list[int]) -> None:
    async def run() -> None:
        process = EndingProcess()
        with ExitStack() as stack:
            await process.by(INT, stack)
            signal.raise_signal(INT)
            assert heard == [INT]
            await process.ended()
            assert heard == [INT]
            signal.raise_signal(INT)

    asyncio.run(run())
    assert heard == [INT, INT]


def test_error_in_the_shutdown_callback_is_logged_and_shutdown_continues(
    heard: list[int], caplog: pytest.LogCaptureFixture
) -> None:
    failed = asyncio.Event()

    async def fail() -> None:
        failed.set()
        raise ValueError("a fault")

    async def run() -> None:
        with graceful_shutdown(asyncio.get_running_loop(), fail):
            signal.raise_signal(TERM)
            await failed.wait()

    with caplog.at_level(logging.ERROR, "kiosk"):
        asyncio.run(run())
    assert heard == [TERM]
    assert "a fault" in caplog.text
