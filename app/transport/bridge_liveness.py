"""Whether a robot's bridges answer queries at short intervals: a cut cable and a frozen bridge are seen
by their silence, long before Zenoh's lease is over, and whatever lease the bridge is configured with.

A question goes the way of a command, behind all that was sent before: its answer shows that this
reached the bridge. And it comes behind all that the bridge had sent: after a standstill of the event
loop it shows that what the robot published in the meantime is taken in.
"""

import asyncio
import logging
import math
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from app.concurrency import spawn_logged
from app.dialect import bridge_dialect
from app.errors import LinkError
from app.robot.state import RobotState
from app.ros_logging import RobotLog
from app.transport.bridge_admin import AdminSpace

log = logging.getLogger("kiosk.pulse")

EVERY_S: Final = 0.2
SILENT_S: Final = 0.4  # without an answer, beside the time that the network takes
TURN_S: Final = 0.02  # given to an answer that came while the loop stood still
STOOD_STILL_S: Final = 0.4  # a query so late: messages from the meantime are still on their way
GOOD: Final = 2  # answers in time to queries sent after a silence: the bridge's news came before
LOOKED_AT: Final = 10  # answers
LONGEST_S: Final = 2.5  # a question is not waited for any longer


class LivenessDetector:
    """Questions and answers → whether there is silence; times in monotonic seconds. Pure."""

    def __init__(self) -> None:
        self.silent = False
        self._unanswered: deque[float] = deque(maxlen=int(LONGEST_S / EVERY_S) * 10)
        self._took: deque[float] = deque(maxlen=LOOKED_AT)
        self._heard_at = math.inf  # the first answer after a silence began
        self._good = 0

    @property
    def limit(self) -> float:
        """How long an answer may take, by the longest that one took lately."""
        return SILENT_S + max(self._took, default=0.0)

    def ask(self, now: float) -> None:
        self._unanswered.append(now)

    def hear(self, sent_at: float, now: float) -> None:
        """An answer; earlier queries without an answer do not count any more."""
        while self._unanswered and self._unanswered[0] <= sent_at:
            self._unanswered.popleft()
        in_time = now - sent_at <= self.limit
        # In time, or known to be late: else the loop stood still, which says nothing of the network.
        if in_time or self.silent:
            self._took.append(now - sent_at)
        if self.silent:
            self._good = self._good + 1 if in_time and sent_at > self._heard_at else 0
            self._heard_at = min(self._heard_at, now)
            self.silent = self._good < GOOD

    def judge(self, now: float) -> None:
        if not self.silent and self._unanswered and now - self._unanswered[0] >= self.limit:
            self.silent, self._heard_at, self._good = True, math.inf, 0


class BridgeLiveness:
    """Of one robot; used on the event loop only."""

    def __init__(
        self,
        robot: RobotState,
        link: AdminSpace,
        changed: Callable[[], None],
        monotonic: Callable[[], float] = time.monotonic,
    ) -> None:
        """`changed` is called when the robot's `is_responding` or `is_caught_up` has changed."""
        self._robot = robot
        self._link = link
        self._changed = changed
        self._monotonic = monotonic
        self._log = RobotLog(log, robot.name)
        self._silence = LivenessDetector()
        self._bridges: frozenset[str] = frozenset()
        self._questions: set[asyncio.Task[bool]] = set()
        self._awaited: set[asyncio.Task[bool]] = set()  # by who wants to know whether something arrived
        self._silenced: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self._asking: asyncio.Task[None] | None = None
        self._last_sent_at = math.inf
        self._behind = 0  # answers, to queries sent after `_behind_since`, until all is taken in
        self._behind_since = 0.0

    def start(self) -> None:
        self._asking = spawn_logged(self._ask_regularly(), self._log, "asking the bridges failed")

    async def stop(self) -> None:
        """Ends its tasks; what was sent to the end gets the time for an answer."""
        if self._awaited:
            await asyncio.wait(self._awaited, timeout=self._silence.limit)
        tasks: list[asyncio.Task[Any]] = [*self._questions]
        if self._asking is not None:
            tasks.append(self._asking)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def flushed(self) -> bool:
        """Whether all that was sent until now has reached the bridges: they answer a query that is sent
        after it, and there is no silence before. It takes one round trip."""
        question = self._ask()
        self._awaited.add(question)
        question.add_done_callback(self._awaited.discard)
        ends: set[asyncio.Future[Any]] = {question, self._silenced}
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        return question.done() and not question.cancelled() and question.result()

    def look(self) -> None:
        """Before anything is judged: whether the event loop stood still, and so may know nothing of
        what the robot has published in the meantime."""
        now = self._monotonic()
        if now - self._last_sent_at < EVERY_S + STOOD_STILL_S:
            return
        if not self._behind:
            self._log.warning("the event loop stood still for %.1f s", now - self._last_sent_at)
        self._behind, self._behind_since = GOOD, now
        self._catch_up(False)

    def _hear(self, sent_at: float) -> None:
        """An answer came: what the bridge sent before it is taken in, when the next one is there."""
        if self._behind and sent_at >= self._behind_since:
            self._behind, self._behind_since = self._behind - 1, self._monotonic()
            self._catch_up(not self._behind)

    def _catch_up(self, done: bool) -> None:
        if done != self._robot.is_caught_up:
            self._robot.is_caught_up = done
            self._changed()

    async def _ask_regularly(self) -> None:
        while True:
            self._ask()
            await asyncio.sleep(EVERY_S)

    def _ask(self) -> "asyncio.Task[bool]":
        self.look()
        self._last_sent_at = self._monotonic()
        self._follow()
        task = asyncio.get_running_loop().create_task(self._answered())
        self._questions.add(task)
        task.add_done_callback(self._questions.discard)
        return task

    def _follow(self) -> None:
        """Of other bridges than before, and of a new session's, nothing is known yet; where one stays,
        so does its silence."""
        bridges = self._robot.graph.bridges if self._robot.link_up else frozenset()
        if bridges != self._bridges:
            if not bridges & self._bridges:
                self._silence = LivenessDetector()
            self._bridges = bridges
            self._tell()

    async def _answered(self) -> bool:
        """One question to all bridges; whether they answered it."""
        silence, sent_at = self._silence, self._monotonic()
        answer = asyncio.ensure_future(self._all(self._bridges))
        silence.ask(sent_at)
        try:
            await asyncio.wait({answer}, timeout=silence.limit)
            if not answer.done():
                await asyncio.wait({answer}, timeout=TURN_S)
            answered = answer.done() and answer.result()
            if not answered:
                silence.judge(self._monotonic())
                self._tell()
                answered = await answer
        finally:
            answer.cancel()
        if answered:
            silence.hear(sent_at, self._monotonic())
            self._tell()
            self._hear(sent_at)
        return answered

    async def _all(self, bridges: frozenset[str]) -> bool:
        questions = (self._link.ask(bridge_dialect.version(zid), LONGEST_S) for zid in bridges)
        try:
            return bool(bridges) and all(await asyncio.gather(*questions))
        except LinkError:
            return False  # there is no session at this moment

    def _tell(self) -> None:
        answers = not self._silence.silent
        if answers == self._robot.is_responding:
            return
        self._robot.is_responding = answers
        if answers:
            self._log.info("the bridge answers")
        else:
            self._log.warning("the bridge does not answer")
            self._silenced.set_result(None)
            self._silenced = asyncio.get_running_loop().create_future()
        self._changed()
