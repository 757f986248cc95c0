"""Limits of requests by client, so that no number of them keeps the event loop from holds and events.

A page takes some milliseconds of the event loop, all at once. Requests that come together would take
them one after the other, with no hold in between. So requests begin in turn: one in a round of the
event loop, and those by which other machines read something at most half of the time. A client with too
many is answered 429, after a moment, so that it can't ask at once again.
"""

import asyncio
import logging
import time
from collections import OrderedDict, deque
from enum import IntEnum
from typing import Final, Generic, TypeVar

from starlette.types import ASGIApp, Receive, Scope, Send

from app.cell.permission.client_limits import RATE_LIMITS, RateGuard
from app.cell.permission.client_places import KIOSK
from app.web.caller import caller_in
from app.web.security import moves, refuse, too_many

# Whose request is next: those that may move something first, then what the kiosk's own machine reads,
# then what others read, and within each of these the clients in turn.

Item = TypeVar("Item")


PASSED_MOST: Final = 4


class Lane(IntEnum):
    """A lane goes before those after it, but not more than `PASSED_MOST` times in a row."""

    COMMAND = 0
    KIOSK = 1
    READ = 2


def lane_of(client: str, command: bool) -> Lane:
    """The lane of a request; `command`: it may move something."""
    if command:
        return Lane.COMMAND
    return Lane.KIOSK if client in KIOSK else Lane.READ


class TurnQueue(Generic[Item]):
    """Waiting requests."""

    def __init__(self, client_most: int, kiosk_most: int) -> None:
        """At most so many requests of a client, and of the kiosk's own machine, wait in each lane."""
        self._client_most = client_most
        self._kiosk_most = kiosk_most
        self._lanes: dict[Lane, OrderedDict[str, deque[Item]]] = {lane: OrderedDict() for lane in Lane}
        self._passed = dict.fromkeys(Lane, 0)  # how often in a row a lane had to wait for one before it

    def __bool__(self) -> bool:
        """Whether a request waits."""
        return any(self._lanes.values())

    def has_room(self, client: str, lane: Lane) -> bool:
        """Whether one more request of the client may wait."""
        most = self._kiosk_most if client in KIOSK else self._client_most
        return len(self._lanes[lane].get(client, ())) < most

    def add(self, client: str, lane: Lane, item: Item) -> None:
        self._lanes[lane].setdefault(client, deque()).append(item)

    def next_lane(self, reads: bool) -> Lane | None:
        """The lane of the next request; None if none waits. `reads`: whether `READ` may be next."""
        waiting = [lane for lane in Lane if self._lanes[lane] and (reads or lane is not Lane.READ)]
        late = (lane for lane in waiting if self._passed[lane] >= PASSED_MOST)
        return next(late, waiting[0] if waiting else None)

    def take(self, lane: Lane) -> Item:
        """Removes and returns the next request of a lane. Its client comes after the others then."""
        for other in Lane:
            self._passed[other] = self._passed[other] + 1 if other > lane and self._lanes[other] else 0
        clients = self._lanes[lane]
        client, items = next(iter(clients.items()))
        item = items.popleft()
        if items:
            clients.move_to_end(client)
        else:
            del clients[client]
        return item


log = logging.getLogger("kiosk.connections")

WAITING_MOST: Final = 64  # of a client on another machine
KIOSK_WAITING_MOST: Final = 512
RATES: Final = {Lane.COMMAND: "commands", Lane.READ: "reads"}
REFUSED_AFTER_S: Final = 0.5
PAUSE_MOST_S: Final = 0.1  # after a request that read something: as long as it took, at most this


class Turns:
    """An ASGI layer that lets requests begin in turn, behind that which finds a proxy's client."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._rates = RateGuard(*RATES.values())
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
            await refuse(too_many(caller_in(scope), RATE_LIMITS["reads"]), scope, receive, send)

    async def _turn(self, scope: Scope) -> bool:
        """Waits for the turn of a request; False if its client has too many."""
        client = caller_in(scope).key
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
        if client not in KIOSK and self._rates.exceeded(False, **{RATES[lane]: client}):
            return False
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
