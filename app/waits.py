"""What waits for the robot, and may have to do without its answer: at the server's end nobody waits."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager


class Waits:
    """On the event loop."""

    __slots__ = ("_given_up", "_limits")

    def __init__(self) -> None:
        self._limits: set[asyncio.Timeout] = set()
        self._given_up = False

    def give_up(self) -> None:
        """Ends all of them, and each later one where it first waits; once."""
        self._given_up = True
        for limit in self._limits:
            limit.reschedule(asyncio.get_running_loop().time())

    @asynccontextmanager
    async def one(self) -> AsyncIterator[None]:
        """TimeoutError where it was given up; what never waits is done in any case."""
        limit = asyncio.timeout(0 if self._given_up else None)
        self._limits.add(limit)
        try:
            async with limit:
                yield
        finally:
            self._limits.discard(limit)
