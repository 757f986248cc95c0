"""Queries the liveliness tokens of a session's routers.

With several routers Zenoh's query ends with the answer of the first. A subscriber with history receives
the tokens of all, and from then on the query has what the session knows: so with several routers a
subscriber is declared, and its history is waited for. With one the query has all of its tokens.
"""

import asyncio
from typing import Final

import zenoh
from zenoh.handlers import Callback

from app.errors import LinkError
from app.transport.zenoh_answers import collected

HISTORY_WITHIN_S: Final = 1.0
POLL_S: Final = 0.05


class TokenQuery:
    """The tokens of one session that match a key expression."""

    def __init__(self, session: zenoh.Session, expression: str) -> None:
        self._session = session
        self._expression = expression
        self._watched: zenoh.Subscriber[None] | None = None

    async def keys(self, timeout_s: float) -> list[str]:
        """All of them; LinkError if they do not arrive in time."""
        routers = len(self._session.info.routers_zid()) + len(self._session.info.peers_zid())
        if routers > 1 and self._watched is None:
            self._watched = self._session.liveliness().declare_subscriber(
                self._expression, Callback(_ignore, indirect=False), history=True
            )
        tokens = await self._query(timeout_s)
        end = asyncio.get_running_loop().time() + HISTORY_WITHIN_S
        while self._watched is not None and asyncio.get_running_loop().time() < end:
            await asyncio.sleep(POLL_S)
            before, tokens = tokens, await self._query(timeout_s)
            if len(before) == len(tokens) and len({*map(_owner, tokens)}) >= routers:
                break
        return tokens

    async def _query(self, timeout_s: float) -> list[str]:
        get = self._session.liveliness().get
        replies, whole = await collected(
            lambda back: get(self._expression, back, timeout=timeout_s), timeout_s
        )
        if not whole:
            raise LinkError(f"the ROS graph did not come within {timeout_s:g} s")
        return [key for key, _ in replies]


def _owner(token: str) -> str:
    """The zid in a token."""
    return token.split("/")[1]


def _ignore(_: zenoh.Sample) -> None:
    """For samples that are not needed."""
