"""Waits for the results of goals, also across lost connections: the goals continue on the robot."""

import asyncio
import logging
import time
from collections.abc import Callable, Collection
from typing import Final

from app.clock import format_time
from app.commands.actions.client import RESULT, STATUS, ActionClient
from app.commands.actions.goal import ENDS, UNKNOWN, Goal
from app.commands.service_calls import LATE_S, with_fields, with_reply
from app.concurrency import end_tasks, spawn_logged
from app.errors import LinkError
from app.i18n import TextLike, number, say
from app.robot.command_status import Outcome
from app.robot.state import RobotState
from app.ros_logging import RobotLog

log = logging.getLogger("kiosk.actions")

RESULT_S: Final = 86_400.0  # timeout of `get_result`, which responds when the goal ends
ASK_AGAIN_S: Final = 1.0


class ResultWaiter:
    """The goals of one robot without a known end, each with its own task."""

    def __init__(
        self,
        services: ActionClient,
        robot: RobotState,
        *,
        cut: Callable[[Goal, TextLike], None],
        restored: Callable[[Goal], None],
        finished: Callable[[Goal, Outcome], None],
    ) -> None:
        """`finished` is called with a goal's result, or with an unknown outcome. `cut` is called with a
        sentence when the goal is cut off, and `restored` when its server is available again."""
        self._services = services
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._cut = cut
        self._restored = restored
        self._finished = finished
        self._goals: dict[asyncio.Task[None], Goal] = {}

    @property
    def goals(self) -> Collection[Goal]:
        return self._goals.values()

    def begin(self, goal: Goal) -> None:
        """Starts to track a goal."""
        task = spawn_logged(self._track(goal), self._log, "tracking a goal failed")
        self._goals[task] = goal
        task.add_done_callback(self._ended)

    async def stop(self) -> None:
        """Ends the tasks. The goals continue on the robot."""
        await end_tasks([*self._goals])

    def _ended(self, task: "asyncio.Task[None]") -> None:
        goal = self._goals.pop(task)
        if not task.cancelled() and task.exception():
            goal.state = UNKNOWN
            self._finished(goal, Outcome("unknown", say("goal_server_error")))

    async def _track(self, goal: Goal) -> None:
        while True:
            if goal.cut.done():
                if goal.is_running and not goal.doubt:
                    goal.state = UNKNOWN
                    self._cut(goal, goal.cut.result() or say("goal_connection_lost"))
                await self._until_offered(goal)
                goal.cut = asyncio.get_running_loop().create_future()
                self._restored(goal)
            if answer := await self._end(goal):
                break
            if not (goal.known or goal.cut.done()):
                if not goal.doubt:
                    return  # the robot never reported it: the receipt stays as it is
                answer = Outcome("unknown", say("goal_no_report", seconds=number(f"{LATE_S:g}")))
                break
            await asyncio.wait({goal.cut}, timeout=ASK_AGAIN_S)
        self._log.info("press %s: goal %s: %s: %s", goal.press_id, goal.id, answer.outcome, answer.text)
        self._finished(goal, answer)

    async def _until_offered(self, goal: Goal) -> None:
        key, settle_s = self._robot.key(goal.widget.action), self._robot.traits.server_settle_s
        while not (
            self._services.is_offered(goal.widget)
            and time.monotonic() >= self._robot.graph.since("AS", key) + settle_s
        ):
            await asyncio.sleep(ASK_AGAIN_S)

    async def _end(self, goal: Goal) -> Outcome | None:
        """The result; None if the goal is cut off or there is no response."""
        reply = await self._result(goal)
        if reply is None:
            return None
        fields = await self._services.result(goal.widget, reply)
        if fields is None:
            return Outcome("unknown", say("call_response_unreadable", wanted=goal.widget.type))
        status = fields.get(STATUS)
        goal.state = status if status in ENDS else UNKNOWN
        if status not in ENDS:
            return Outcome("unknown", say("goal_forgotten") if goal.known else say("goal_not_known"))
        outcome, ended, had_ended = ENDS[status]
        sentence = had_ended if goal.doubt else ended
        text = with_fields(goal.widget.result, fields, RESULT)
        return Outcome(outcome, with_reply(say(sentence, time=format_time(time.time())), text))

    async def _result(self, goal: Goal) -> bytes | None:
        """The reply of `get_result`, requested again if Zenoh refuses to send.

        The timeout is short for a goal that the robot has not reported or that may have ended.
        """
        refused = False
        while not goal.cut.done():
            try:
                seconds = RESULT_S if goal.known and not goal.doubt else LATE_S
                query = self._services.get_result(goal, seconds)
                return await self._services.reply(goal, query)
            except LinkError as error:
                if not refused:
                    self._log.warning("press %s: %s", goal.press_id, error)
                refused = True
                await asyncio.wait({goal.cut}, timeout=ASK_AGAIN_S)
        return None
