"""A link that only reads: what is on the robots, service calls, topics. It publishes nothing.

For commands that run beside the panel server or without one.
"""

import asyncio
from collections.abc import AsyncIterator, Sequence
from contextlib import suppress
from typing import Final

from app.cell.link.peer import RobotAccess
from app.ros.dialects.dialect import PanelEndpoint, any_hash
from app.ros.graph.model import GraphSnapshot
from app.ros.zenoh.config import Config
from app.ros.zenoh.declarations import Declarations
from app.ros.zenoh.sample import Sample
from app.ros.zenoh.session import ZenohSession
from app.system.errors import LinkError

CONNECT_S: Final = 3.0
CALL_S: Final = 2.0


class RobotObserver:
    """A session with robots of one kind. Used on the event loop that it was opened on."""

    def __init__(self, config: Config, access: RobotAccess, domain: int = 0) -> None:
        self._loop = asyncio.get_running_loop()
        self._woken = asyncio.Event()
        self._access = access
        self._dialect = access.dialect(domain, any_hash)
        self._session = ZenohSession(config, self._wake, self._dialect)

    @property
    def zid(self) -> str:
        """The id of its session."""
        return self._session.zid

    @property
    def endpoints(self) -> tuple[str, ...]:
        """The endpoints it connects to, such as "tcp/127.0.0.1:7447"."""
        return self._session.endpoints

    async def connect(self, within_s: float = CONNECT_S) -> None:
        """Waits for a connection; LinkError names the endpoints without an answer."""
        if not await self._session.connected(within_s):
            where = ", ".join(self.endpoints) or "any place that was found by scouting"
            raise LinkError(f"no Zenoh router or bridge answers at {where} within {within_s:g} s")

    async def observe(self) -> GraphSnapshot:
        """The graph now; LinkError without a link. It is empty if no robot is there."""
        return await self._access.observe(self._session, self.zid)

    async def call(self, key: str, payload: bytes, timeout_s: float = CALL_S) -> bytes | None:
        """The response of a service that only reads; None for none in time. Only for a service that
        the graph shows and that can be called: a query without an answer may stay in the peer."""
        answer = self._session.query_at(self._dialect.service(key, ""), payload, timeout_s)
        await asyncio.wait({answer}, timeout=timeout_s + 1)
        return answer.result() if answer.done() else None

    async def listen(
        self, topics: Sequence[PanelEndpoint], *, hold: bool = True
    ) -> AsyncIterator[tuple[str, Sample]]:
        """(key, sample) of each sample of these topics, beginning with those that latched publishers
        have kept. Call it once per observer. LinkError when the connection is lost.

        `hold`: declares tokens, so that a bridge keeps its routes and each sample arrives once. Not
        for a topic without a publisher: the token would fix the QoS of the route for a later publisher.
        """
        expressions = {topic.key: self._dialect.topic(topic.key, topic.type) for topic in topics}
        self._session.start(
            Declarations(subscribe=expressions, recorded=set(expressions), immediate=set(expressions))
        )
        if hold:
            self._session.declare_tokens(self._dialect.own_tokens(self.zid, topics))
        connected = False
        while True:
            await self._woken.wait()
            self._woken.clear()
            changes = self._session.drain()
            for kept in changes.recorded_samples:
                yield kept
            if connected and not changes.link_up:
                raise LinkError(f"the connection to {', '.join(self.endpoints)} was lost")
            connected = changes.link_up

    async def close(self) -> None:
        """Ends the session."""
        await asyncio.to_thread(self._session.close)

    def _wake(self, _: bool) -> None:
        """On Zenoh's threads."""
        with suppress(RuntimeError):  # the loop is closed
            self._loop.call_soon_threadsafe(self._woken.set)
