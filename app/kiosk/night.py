"""The screen goes off when it is not touched for long. The touch that wakes it presses nothing.

swayidle reports idleness by signals: SIGUSR1 when the time is up, SIGUSR2 at the next touch.
"""

import asyncio
import logging
import os
import signal
from collections.abc import Awaitable, Callable, Mapping
from contextlib import suppress
from datetime import time
from typing import Final

from app.kiosk.child import Child
from app.kiosk.config import KioskConfig

log = logging.getLogger("kiosk.screen")

# Between the touch that wakes the screen and the first that counts.
AWAKE_AFTER_S: Final = 1.0


def may_be_off(between: tuple[str, ...], now: time) -> bool:
    """Whether `now` is in the time of the day in which the screen may go off, which may be over
    midnight. Without times it always is."""
    if not between:
        return True
    start, end = (time.fromisoformat(text) for text in between)
    return start <= now < end if start <= end else now >= start or now < end


class Night:
    """`dark` is whether the screen is off. `power` turns it on or off, `ignore_input` says whether
    touches reach the page."""

    def __init__(
        self,
        config: KioskConfig,
        power: Callable[[bool], Awaitable[None]],
        ignore_input: Callable[[bool], Awaitable[None]],
    ) -> None:
        self._config = config
        self._power = power
        self._ignore_input = ignore_input
        self._idle: Child | None = None
        self._turning: asyncio.Task[None] | None = None
        self._wanted = self.dark = False

    async def update(self, now: time, env: Mapping[str, str]) -> None:
        """Starts or ends the watch for idleness. Called again and again."""
        config = self._config
        wanted = config.off_after_s > 0 and may_be_off(config.off_between, now)
        runs = self._idle is not None and self._idle.runs
        if wanted and not runs:
            self._listen(env)
        elif not wanted and self._idle is not None:
            await self._idle.end()
            self._idle = None
            self._turn(False)

    async def end(self) -> None:
        if self._idle is not None:
            await self._idle.end()
        if self._turning is not None:
            self._turning.cancel()

    def _listen(self, env: Mapping[str, str]) -> None:
        self._turn(False)  # a new watch does not know of a screen that went off before it
        loop = asyncio.get_running_loop()
        loop.add_signal_handler(signal.SIGUSR1, self._turn, True)
        loop.add_signal_handler(signal.SIGUSR2, self._turn, False)
        kill = "kill -{} " + str(os.getpid())
        command = ["swayidle", "-C", "/dev/null", "timeout", str(self._config.off_after_s)]
        with suppress(OSError):
            self._idle = Child([*command, kill.format("USR1"), "resume", kill.format("USR2")], env)

    def _turn(self, dark: bool) -> None:
        self._wanted = dark
        if self._turning is None or self._turning.done():
            self._turning = asyncio.ensure_future(self._follow())

    async def _follow(self) -> None:
        while self.dark != self._wanted:
            dark = self._wanted
            log.info("the screen %s", "goes off" if dark else "goes on")
            if dark:
                self.dark = True  # first no touch counts, then the screen is off
                await self._ignore_input(True)
                await self._power(False)
            else:
                await self._power(True)
                await asyncio.sleep(AWAKE_AFTER_S)
                await self._ignore_input(False)
                self.dark = False
                log.info("touches count again")
