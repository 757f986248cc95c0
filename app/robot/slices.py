"""Decodes large messages in slices: some milliseconds in each turn of the event loop.

Small messages are decoded at once. No message of a robot delays a press or a permission by more than
one slice.
"""

import asyncio
import logging
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Final, TypeVar

from app.errors import DecodeError
from app.interfaces import FieldReader, Fields, Walk

log = logging.getLogger("kiosk")

FIRST_SHARE_S: Final = 0.01  # of a turn in which messages arrive, for all of them
LATER_SHARE_S: Final = 0.003  # of each later turn
CALM_SHARE_S: Final = 0.001  # of a turn, for what may wait a moment
CALM_PAUSE_S: Final = 0.004  # then
SMALL_BYTES: Final = 2_000  # decoded at once, however much has arrived in this turn

Resume = Callable[
    [float], bool
]  # continues until a time (monotonic seconds); returns whether it is done


Result = TypeVar("Result")


class Slices:
    """Limits the decoding time of each turn. Used on the event loop; without a running loop there is no
    limit."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._now = monotonic
        self._until: float | None = None  # deadline of this turn; None: nothing was decoded in it yet
        self._pending: deque[Resume] = deque()

    def read(self, walk: Walk[Result], size: int) -> Result | None:
        """Decodes a message of `size` bytes; None if this turn's time ends first. DecodeError if the
        bytes are no such message."""
        if size <= SMALL_BYTES:
            return self.read_until(walk, math.inf)
        until = self._turn_deadline()
        return None if self._now() >= until else self.read_until(walk, until)

    def read_until(self, walk: Walk[Result], until: float) -> Result | None:
        """The same until a time (monotonic seconds). What else a decoder throws is logged, and is a
        DecodeError too."""
        try:
            while (result := walk.advance()) is None:
                if self._now() >= until:
                    return None
        except DecodeError:
            raise
        except Exception as error:  # else who waits for this message would wait for ever
            log.exception("a message can't be decoded")
            raise DecodeError(f"its decoder failed: {error}") from error
        return result

    def schedule(self, go_on: Resume) -> None:
        """Calls it once a turn, from the next turn on, until it returns true."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            while not go_on(math.inf):
                pass
            return
        self._pending.append(go_on)
        if len(self._pending) == 1:
            loop.call_soon(self._resume_next)

    def schedule_calmly(self, go_on: Resume, is_behind: Callable[[], bool]) -> None:
        """The same in shorter slices, with pauses in which presses go on, until it is behind."""
        try:
            loop = asyncio.get_running_loop()
        except RuntimeError:
            self.schedule(go_on)
            return
        loop.call_soon(self._resume_calmly, loop, go_on, is_behind)

    async def read_all(self, reader: FieldReader, data: bytes) -> Fields:
        """Decodes a message, over as many turns as needed; DecodeError if the bytes are no such
        message."""
        walk = reader.walk(data)
        if (fields := self.read(walk, len(data))) is not None:
            return fields
        done: asyncio.Future[Fields] = asyncio.get_running_loop().create_future()

        def go_on(until: float) -> bool:
            if not done.done():
                try:
                    if (fields := self.read_until(walk, until)) is not None:
                        done.set_result(fields)
                except Exception as error:
                    done.set_exception(error)
            return done.done()

        self.schedule(go_on)
        return await done

    def _turn_deadline(self) -> float:
        """When decoding in this turn must stop (monotonic seconds)."""
        if self._until is None:
            try:
                asyncio.get_running_loop().call_soon(self._end_turn)
            except RuntimeError:
                return math.inf
            self._until = self._now() + FIRST_SHARE_S
        return self._until

    def _end_turn(self) -> None:
        self._until = None

    def _resume_calmly(
        self, loop: asyncio.AbstractEventLoop, go_on: Resume, is_behind: Callable[[], bool]
    ) -> None:
        if go_on(self._now() + CALM_SHARE_S):
            return
        if is_behind():
            self.schedule(go_on)
        else:
            loop.call_later(CALM_PAUSE_S, self._resume_calmly, loop, go_on, is_behind)

    def _resume_next(self) -> None:
        """Continues the next pending message, round robin."""
        go_on = self._pending[0]
        through = True
        try:
            through = go_on(self._now() + LATER_SHARE_S)
        finally:
            self._pending.popleft()
            if not through:
                self._pending.append(go_on)
            if self._pending:
                asyncio.get_running_loop().call_soon(self._resume_next)
