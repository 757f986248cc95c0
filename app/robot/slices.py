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

AT_ONCE_S: Final = 0.01  # of one turn in which something came, for all that is read in it
LATER_S: Final = 0.003  # of each turn after that
SMALL: Final = 2_000  # bytes: read at once, however much came in this turn

GoOn = Callable[[float], bool]  # reads on until then (monotonic seconds); whether it is through


class Slices:
    """How much is read in a turn; used on the event loop only. Without one nothing is put off."""

    def __init__(self, monotonic: Callable[[], float] = time.monotonic) -> None:
        self._now = monotonic
        self._until: float | None = None  # of this turn; None: nothing was read in it yet
        self._later: deque[GoOn] = deque()

    def read(self, walk: Walk, size: int) -> Fields | None:
        """Reads a message of so many bytes; None where this turn's share is over before it is through.
        DecodeError where it is none."""
        until = self._share()
        if size > SMALL and self._now() >= until:
            return None
        return self.read_until(walk, until)

    def read_until(self, walk: Walk, until: float) -> Fields | None:
        """The same, to a moment."""
        while (fields := walk.go_on()) is None:
            if self._now() >= until:
                return None
        return fields

    def later(self, go_on: GoOn) -> None:
        """Calls it once a turn from the next one on, until it is through."""
        self._later.append(go_on)
        if len(self._later) == 1:
            asyncio.get_running_loop().call_soon(self._go_on)

    async def whole(self, reader: FieldReader, data: bytes) -> Fields:
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

        self.later(go_on)
        return await done

    def _share(self) -> float:
        """Until when what came in this turn may be read."""
        if self._until is None:
            try:
                asyncio.get_running_loop().call_soon(self._turn)
            except RuntimeError:
                return float("inf")
            self._until = self._now() + AT_ONCE_S
        return self._until

    def _turn(self) -> None:
        self._until = None

    def _go_on(self) -> None:
        """One of those that wait, each in its turn."""
        go_on = self._later[0]
        through = True
        try:
            through = go_on(self._now() + LATER_S)
        finally:
            self._later.popleft()
            if not through:
                self._later.append(go_on)
            if self._later:
                asyncio.get_running_loop().call_soon(self._go_on)
