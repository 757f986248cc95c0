"""What is still to be told of presses and holds. At its end uvicorn waits for the answers to posts and
closes WebSockets at once: what was pressed or held there would end without a word."""

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress


class Owed:
    """On the event loop."""

    __slots__ = ("_many", "_none")

    def __init__(self) -> None:
        self._many = 0
        self._none = asyncio.Event()
        self._none.set()

    @contextmanager
    def one(self) -> Iterator[None]:
        """While it lasts, somebody waits for an answer."""
        self._many += 1
        self._none.clear()
        try:
            yield
        finally:
            self._many -= 1
            if not self._many:
                self._none.set()

    async def told(self, within_s: float) -> None:
        """Until nobody waits for one; `within_s` at most."""
        with suppress(TimeoutError):
            await asyncio.wait_for(self._none.wait(), within_s)
