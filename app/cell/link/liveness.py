"""Queries a robot's peers at short intervals: its bridges, the router of its nodes, or their sessions.
A cut cable or a frozen peer is detected by its silence, long before Zenoh's lease expires and
independent of the lease that the peer is configured with.

Zenoh keeps the order. A query follows everything that was sent before it, so its reply shows that this
has reached the peer. The reply follows everything that the peer sent before it, so after a stall of the
event loop it shows that what the robot published in the meantime has been received.
"""

import asyncio
import logging
import math
import time
from collections import deque
from collections.abc import Awaitable, Callable, Collection
from typing import Any, Final, Protocol

from app.cell.robot.state import RobotState
from app.ros.zenoh.answers import AdminSpace
from app.system.concurrency import end_tasks, keep_running
from app.system.errors import LinkError
from app.system.log import RobotLog

log = logging.getLogger("kiosk.pulse")

EVERY_S: Final = 0.2  # from one query to the next
SILENT_S: Final = 0.4  # without a reply, in addition to the network's delay
TURN_S: Final = 0.02  # for a reply that arrived while the event loop stalled
EARLY: Final = 0.05  # of an interval: a timer that fires this much early counts as on time
STALLED_S: Final = 0.4  # a query this late: messages published in the meantime are not received yet
GOOD: Final = 2  # replies in time, to queries sent after a silence: the peer's data came before them
DELAYS_KEPT: Final = 10
LONGEST_S: Final = 2.5  # timeout of a query
REFUSED_S: Final = 1.0  # a query that ends sooner without a reply: nothing there answers such queries
REFUSALS: Final = 5  # in a row; a peer that has just appeared refuses the first ones


class LivenessDetector:
    """Detects silence from the times of queries and replies, in monotonic seconds. Pure."""

    def __init__(self) -> None:
        self.silent = False
        self._unanswered: deque[float] = deque(maxlen=int(LONGEST_S / EVERY_S) * 10)
        self._delays: deque[float] = deque(maxlen=DELAYS_KEPT)
        self._replied_at = math.inf  # the first reply after a silence began
        self._good = 0

    @property
    def limit(self) -> float:
        """The longest time for a reply in seconds, by the longest of the last delays."""
        return SILENT_S + max(self._delays, default=0.0)

    def on_query(self, now: float) -> None:
        """A query was sent."""
        self._unanswered.append(now)

    def on_reply(self, sent_at: float, now: float) -> None:
        """The query sent at `sent_at` was answered. Earlier queries without a reply no longer count."""
        while self._unanswered and self._unanswered[0] <= sent_at:
            self._unanswered.popleft()
        in_time = now - sent_at <= self.limit
        # In time, or known to be late: else the event loop stalled, which says nothing of the network.
        if in_time or self.silent:
            self._delays.append(now - sent_at)
        if self.silent:
            self._good = self._good + 1 if in_time and sent_at > self._replied_at else 0
            self._replied_at = min(self._replied_at, now)
            self.silent = self._good < GOOD

    def judge(self, now: float) -> None:
        """Sets `silent` if the oldest query has had no reply within the limit."""
        if not self.silent and self._unanswered and now - self._unanswered[0] >= self.limit:
            self.silent, self._replied_at, self._good = True, math.inf, 0


def until_next(now: float, every_s: float) -> float:
    """Seconds from `now` to the next multiple of `every_s`. All that wait so wake the event loop
    together: queries to 50 robots in one turn cost a fifth of the same queries one by one."""
    return (math.floor(now / every_s + EARLY) + 1) * every_s - now


class PeerLiveness:
    """Detects whether one robot's peers respond. Used on the event loop only. Each kind of peer has a
    class that says which peers are asked."""

    def __init__(
        self,
        robot: RobotState,
        link: AdminSpace,
        changed: Callable[[], None],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`changed` is called when the robot's `is_responding` or `is_caught_up` has changed."""
        self.robot = robot
        self._link = link
        self._changed = changed
        self._monotonic = monotonic
        self._log = RobotLog(log, robot.name)
        self._detector = LivenessDetector()
        self._peers: frozenset[str] = frozenset()  # the queries of those that have to answer
        self._queries: set[asyncio.Task[bool]] = set()
        self._awaited: set[asyncio.Task[bool]] = set()  # by callers of `flushed`
        self._silenced: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._querying: asyncio.Task[None] | None = None
        self._last_sent_at = math.inf
        self._refusals = 0
        self._behind = 0  # replies, to queries sent after `_behind_since`, until it is caught up
        self._behind_since = 0.0

    def queries(self) -> frozenset[str]:
        """A query for each peer that has to answer now."""
        raise NotImplementedError

    def log_answer(self, log: RobotLog) -> None:
        """Writes to the server's log that the peers answer again."""
        raise NotImplementedError

    def log_silence(self, log: RobotLog) -> None:
        """Writes that they do not answer."""
        raise NotImplementedError

    def start(self) -> None:
        self._querying = keep_running(self._query_regularly, self._log, "querying the peers failed")

    async def stop(self) -> None:
        """Ends its tasks. Waits for the replies that callers of `flushed` wait for."""
        if self._awaited:
            await asyncio.wait(self._awaited, timeout=self._detector.limit)
        await end_tasks([*self._queries, self._querying])

    async def flushed(self) -> bool:
        """Whether everything sent so far has reached the peers: they answer a query that is sent
        after it, and are not silent before. Takes one round trip."""
        query = self._query()
        self._awaited.add(query)
        query.add_done_callback(self._awaited.discard)
        ends: set[asyncio.Future[Any]] = {query, self._silenced}
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        return query.done() and not query.cancelled() and query.result()

    def check_stall(self) -> None:
        """Call it before data is ingested. After a stall of the event loop, what the robot has
        published in the meantime may not have been received yet: the robot is not caught up."""
        now = self._monotonic()
        if now - self._last_sent_at < EVERY_S + STALLED_S:
            return
        if not self._behind:
            self._log.warning("the event loop stalled for %.1f s", now - self._last_sent_at)
        self._behind, self._behind_since = GOOD, now
        self._set_caught_up(False)

    def _on_reply(self, sent_at: float) -> None:
        """Counts a reply of peers that are behind: with the last one everything has been received."""
        if self._behind and sent_at >= self._behind_since:
            self._behind, self._behind_since = self._behind - 1, self._monotonic()
            self._set_caught_up(not self._behind)

    def _set_caught_up(self, is_caught_up: bool) -> None:
        if is_caught_up != self.robot.is_caught_up:
            self.robot.is_caught_up = is_caught_up
            self._changed()

    async def _query_regularly(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self._query()
            await asyncio.sleep(until_next(loop.time(), EVERY_S))

    def _query(self) -> "asyncio.Task[bool]":
        self.check_stall()
        self._last_sent_at = self._monotonic()
        self._update_peers()
        task = asyncio.get_running_loop().create_task(self._answered())
        self._queries.add(task)
        task.add_done_callback(self._queries.discard)
        return task

    def _update_peers(self) -> None:
        """Begins with a new detector if none of the peers is one of those before, or the session is
        new. If one stays, so does its silence."""
        peers = self.queries() if self.robot.link_up else frozenset()
        if peers != self._peers:
            if not peers & self._peers:
                self._detector = LivenessDetector()
                self._count_refusals(0)
            self._peers = peers
            self._publish_state()

    async def _answered(self) -> bool:
        """Queries all peers once; whether they answered."""
        detector, sent_at = self._detector, self._monotonic()
        detector.on_query(sent_at)
        loop = asyncio.get_running_loop()
        late: asyncio.TimerHandle | None = None

        def judge() -> None:
            detector.judge(self._monotonic())
            self._publish_state()

        def wait_a_turn() -> None:
            nonlocal late
            late = loop.call_later(TURN_S, judge)

        late = loop.call_later(detector.limit, wait_a_turn)
        try:
            answered = await self._all(self._peers)
        finally:
            late.cancel()
        if not answered:
            judge()
            return False
        replied_at = self._monotonic()
        detector.on_reply(sent_at, replied_at)
        self.robot.round_trips.record(replied_at - sent_at, replied_at)
        self._publish_state()
        self._on_reply(sent_at)
        return True

    async def _all(self, peers: frozenset[str]) -> bool:
        queries = [self._link.query_all(query, LONGEST_S) for query in peers]
        began = self._monotonic()
        try:
            if len(queries) == 1:  # the usual case, without a further task
                answered = bool(await queries[0])
            else:
                answered = bool(peers) and all(await asyncio.gather(*queries))
        except LinkError:
            return False  # there is no session at this moment
        if peers and peers == self._peers:
            refused = not answered and self._monotonic() - began < REFUSED_S
            self._count_refusals(self._refusals + 1 if refused else 0)
        return answered

    def _count_refusals(self, number: int) -> None:
        self._refusals = number
        if (is_queryable := number < REFUSALS) != self.robot.is_queryable:
            self.robot.is_queryable = is_queryable
            self._changed()

    def _publish_state(self) -> None:
        is_responding = not self._detector.silent
        if is_responding == self.robot.is_responding:
            return
        self.robot.is_responding = is_responding
        if is_responding:
            self.log_answer(self._log)
        else:
            self.log_silence(self._log)
            self._silenced.set_result(None)
            self._silenced = asyncio.get_running_loop().create_future()
        self._changed()


# Whether a robot's peers answer a query now. Requests at the same time share one query.

readiness_log = logging.getLogger("kiosk.readiness")

READY_EVERY_S: Final = 0.5  # from one query to the next
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
        """The result of a query that is `READY_EVERY_S` old at most when this is called."""
        loop = asyncio.get_running_loop()
        if self._asking is None or (
            self._asking.done() and loop.time() - self._sent_at >= READY_EVERY_S
        ):
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
            readiness_log.warning("%s", error)
            return False


# When the first message of the panel arrives.

MATCHED_WITHIN_S: Final = 2.0  # a press's receipt says if a subscriber is not matched by then


class Publishers(Protocol):
    """The part of a session that knows its publishers."""

    def has_reader(self, key: str) -> bool: ...


async def wait_until_matched(link: Publishers, keys: Collection[str], every_s: float) -> None:
    """Waits until the publishers of all these keys have a matching subscriber: at least `every_s`, at
    most `MATCHED_WITHIN_S`."""

    def has_reader(key: str) -> bool:
        try:
            return link.has_reader(key)
        except LinkError:
            return False

    end = time.monotonic() + MATCHED_WITHIN_S
    await asyncio.sleep(every_s)
    while time.monotonic() < end and not all(map(has_reader, keys)):
        await asyncio.sleep(every_s)
