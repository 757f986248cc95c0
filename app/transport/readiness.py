"""Whether a robot's peers answer a query now. Requests at the same time share one query."""

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable
from typing import Final

from app.errors import LinkError

log = logging.getLogger("kiosk.readiness")

EVERY_S: Final = 0.5  # from one query to the next
WITHIN_S: Final = 0.8  # in which a peer has to answer
LIMIT_S: Final = 1.0  # of a query, even if Zenoh itself does not return


class CoalescedQuery:
    """One query at a time. Its result is shared by all calls until the next query is due."""

    def __init__(self, ask: Callable[[], Awaitable[bool]]) -> None:
        """`ask` returns whether all peers answered; it may raise LinkError."""
        self._ask = ask
        self._sent_at = -math.inf
        self._asking: asyncio.Task[bool] | None = None

    async def answers(self) -> bool:
        """The result of a query that is `EVERY_S` old at most when this is called."""
        loop = asyncio.get_running_loop()
        if self._asking is None or (self._asking.done() and loop.time() - self._sent_at >= EVERY_S):
            self._sent_at = loop.time()
            self._asking = loop.create_task(self._answered())
        return await asyncio.shield(self._asking)

    async def stop(self) -> None:
        """Waits for the running query, `LIMIT_S` at most."""
        if self._asking is not None:
            await asyncio.gather(self._asking, return_exceptions=True)

    async def _answered(self) -> bool:
        try:
            async with asyncio.timeout(LIMIT_S):
                return await self._ask()
        except TimeoutError:
            return False
        except LinkError as error:
            log.warning("%s", error)
            return False
