"""Limits of requests by client, so that no number of them keeps the event loop from holds and events.

A page takes some milliseconds of the event loop, all at once. Requests that come together would take
them one after the other, with no hold in between. So requests begin in turn: one in a round of the
event loop, and those by which other machines read something at most half of the time. A client with too
many is answered 429, after a moment, so that it can't ask at once again.
"""

import asyncio
import logging
import time
from typing import Final

from starlette.requests import HTTPConnection
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Receive, Scope, Send

from app.i18n import render, say
from app.permission.client_places import KIOSK
from app.rate_limit import Quota, TokenBuckets
from app.web.client_cookie import client_of
from app.web.language import language_of
from app.web.security import moves, refuse
from app.web.turn_queue import Lane, TurnQueue, lane_of

log = logging.getLogger("kiosk.connections")

# Of a client on another machine. A first page loads 30 files; presses have limits of their own, below.
READ_QUOTA: Final = Quota(600, 60)
COMMAND_QUOTA: Final = Quota(400, 200)
WAITING_MOST: Final = 64  # of such a client
KIOSK_WAITING_MOST: Final = 512
RETRY_AFTER_S: Final = 1
REFUSED_AFTER_S: Final = 0.5
PAUSE_MOST_S: Final = 0.1  # after a request that read something: as long as it took, at most this


class Turns:
    """An ASGI layer that lets requests begin in turn, behind that which finds a proxy's client."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._reads, self._commands = TokenBuckets(READ_QUOTA), TokenBuckets(COMMAND_QUOTA)
        self._queue: TurnQueue[asyncio.Future[None]] = TurnQueue(WAITING_MOST, KIOSK_WAITING_MOST)
        self._giving: asyncio.Task[None] | None = None
        self._came = asyncio.Event()
        self._reads_from = 0.0  # monotonic seconds: when another machine may read again

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket") or await self._turn(scope):
            await self._app(scope, receive, send)
        else:
            where = scope["client"][0] if scope.get("client") else "a local socket"
            log.warning("too many requests from %s: answered 429", where)
            await asyncio.sleep(REFUSED_AFTER_S)
            await refuse(_too_many(HTTPConnection(scope)), scope, receive, send)

    async def _turn(self, scope: Scope) -> bool:
        """Waits for the turn of a request; False if its client has too many."""
        client = client_of(HTTPConnection(scope))
        lane = lane_of(client, moves(scope))
        if not self._admit(client, lane):
            return False
        if self._giving is None and (lane is not Lane.READ or time.monotonic() >= self._reads_from):
            self._giving = asyncio.create_task(self._give(lane))
            return True
        turn = asyncio.get_running_loop().create_future()
        self._queue.add(client, lane, turn)
        if self._giving is None:
            self._giving = asyncio.create_task(self._give(None))
        self._came.set()
        await turn
        return True

    def _admit(self, client: str, lane: Lane) -> bool:
        """Whether a client may have one more request."""
        if client not in KIOSK:
            rates = self._commands if lane is Lane.COMMAND else self._reads
            if not rates.has_token(client):
                return False
            rates.take_token(client)
        return self._queue.has_room(client, lane)

    async def _give(self, begun: Lane | None) -> None:
        """Gives turns until no request waits; the lane of one may have `begun` already."""
        if begun is not None:
            await self._round(begun)
        while self._queue:
            pause_s = self._reads_from - time.monotonic()
            lane = self._queue.next_lane(reads=pause_s <= 0)
            if lane is None:
                await self._wait(pause_s)
            else:
                turn = self._queue.take(lane)
                if not turn.done():  # its request may have been cancelled
                    turn.set_result(None)
                    await self._round(lane)
        self._giving = None

    async def _round(self, lane: Lane) -> None:
        """Waits until a request has begun, and until all else had its turn since."""
        began = time.monotonic()
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        if lane is Lane.READ:
            ended = time.monotonic()
            self._reads_from = ended + min(ended - began, PAUSE_MOST_S)

    async def _wait(self, pause_s: float) -> None:
        """Until the pause ends, or a request comes that may not have to wait for it."""
        self._came.clear()
        try:
            async with asyncio.timeout(pause_s):
                await self._came.wait()
        except TimeoutError:
            pass


def _too_many(connection: HTTPConnection) -> Response:
    """A sentence: to render a page would take the time that is saved here."""
    sentence = render(say("too_many_requests"), language_of(connection))
    headers = {"retry-after": str(RETRY_AFTER_S), "cache-control": "no-store"}
    if "text/html" in connection.headers.get("accept", ""):
        return PlainTextResponse(sentence, 429, headers | {"refresh": str(2 * RETRY_AFTER_S)})
    return JSONResponse({"error": sentence}, 429, headers)
