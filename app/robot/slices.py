"""Reading what is large while all else goes on: some milliseconds in each turn of the event loop.

What is small is read at once, as it always was. Nothing a robot sends makes a press or a permission
wait longer than a turn's share.
"""

import asyncio
import time
from collections import deque
from collections.abc import Callable
from typing import Final

from app.interfaces import FieldReader, Fields, Walk

FIRST_SHARE_S: Final = 0.01  # of one turn in which something came, for all that is read in it
LATER_SHARE_S: Final = 0.003  # of each turn after that
SMALL_BYTES: Final = 2_000  # bytes: read at once, however much came in this turn

Resume = Callable[[float], bool]  # reads on until then (monotonic seconds); whether it is through


class Slices:
    """How much is read in a turn; used on the event loop only. Without one nothing is put off."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._now = monotonic
        self._until: float | None = None  # of this turn; None: nothing was read in it yet
        self._pending: deque[Resume] = deque()

    def read(self, walk: Walk, size: int) -> Fields | None:
        """Reads a message of so many bytes; None where this turn's share is over before it is through.
        DecodeError where it is none."""
        until = self._turn_deadline()
        if size > SMALL_BYTES and self._now() >= until:
            return None
        return self.read_until(walk, until)

    def read_until(self, walk: Walk, until: float) -> Fields | None:
        """The same, to a moment."""
        while (fields := walk.advance()) is None:
            if self._now() >= until:
                return None
        return fields

    def schedule(self, go_on: Resume) -> None:
        """Calls it once a turn from the next one on, until it is through."""
        self._pending.append(go_on)
        if len(self._pending) == 1:
            asyncio.get_running_loop().call_soon(self._resume_next)

    async def read_all(self, reader: FieldReader, data: bytes) -> Fields:
        """Reads a message, however many turns that takes; DecodeError where it is none."""
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
        """Until when what came in this turn may be read."""
        if self._until is None:
            try:
                asyncio.get_running_loop().call_soon(self._end_turn)
            except RuntimeError:
                return float("inf")
            self._until = self._now() + FIRST_SHARE_S
        return self._until

    def _end_turn(self) -> None:
        self._until = None

    def _resume_next(self) -> None:
        """One of those that wait, each in its turn."""
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
