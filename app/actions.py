"""Action goals: sent, followed by their feedback, canceled, and known to the end.

A goal belongs to the robot, not to a browser: it goes on when a page is closed and shows in every
one. Wire format: ROS 2's `<action>/_action/…` services and topics (design.ros2.org, "Actions").
"""

import asyncio
import logging
import time
import uuid
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from typing import Any, Final

from app.calls import Asker, with_fields
from app.errors import DecodeError
from app.interfaces import Interfaces, value_at
from app.panel.model import Action
from app.progress import Answer, Corrected, Outcome, Progress
from app.robot import Robot, Sample
from app.sentences import clock, say

log = logging.getLogger("kiosk.actions")

CANCEL: Final = "action_msgs/srv/CancelGoal"
RESULT_S: Final = 86_400.0  # a result is waited for as long as the goal takes
ASK_AGAIN_S: Final = 1.0

# action_msgs/msg/GoalStatus
ENDS: Final[dict[int, tuple[Outcome, str]]] = {
    4: ("succeeded", "goal_succeeded"),
    5: ("canceled", "goal_canceled"),
    6: ("aborted", "goal_aborted"),
}


@dataclass(slots=True)
class _Goal:
    """The last goal of a widget; `cut` is done when the bridge went away meanwhile."""

    widget: Action
    press_id: str
    id: uuid.UUID
    cut: "asyncio.Future[None]"
    corrected: Corrected
    said: str = ""
    fraction: float | None = None
    tasks: set["asyncio.Task[None]"] = field(default_factory=set)


class Actions:
    """The goals of one robot; used on the event loop only."""

    def __init__(
        self, interfaces: Interfaces, robot: Robot, link: Asker, changed: Callable[[], None]
    ) -> None:
        """`changed` is called when what the widgets show has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._link = link
        self._changed = changed
        self._goals: dict[str, _Goal] = {}

    def follow(self) -> None:
        """After every change of the graph: without a bridge nothing more is heard of a goal."""
        if not self._robot.graph.bridges:
            for goal in self._goals.values():
                if not goal.cut.done():
                    goal.cut.set_result(None)

    async def stop(self) -> None:
        """Ends its tasks; goals go on in the robot."""
        tasks = [task for goal in self._goals.values() for task in goal.tasks]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def start(
        self, widget: Action, fields: dict[str, Any], press_id: str, corrected: Corrected
    ) -> Answer:
        """Sends a goal; `corrected` gets what came of it in the end. FieldError for bad fields."""
        types = self._interfaces.action(widget.type)
        goal_id = uuid.uuid4()
        wrapped = {"goal_id": {"uuid": list(goal_id.bytes)}, "goal": fields}
        payload = self._interfaces.encode(types.send_goal_request, wrapped)
        cut = asyncio.get_running_loop().create_future()
        goal = _Goal(widget, press_id, goal_id, cut, corrected)
        self._goals[widget.id] = goal
        self._show(goal, Progress(busy=True, text=say("waiting_for_answer")))
        reply = await self._asked(goal, "send_goal", payload, widget.timeout_s)
        answer = self._first_answer(goal, types.send_goal_response, reply)
        if answer.outcome == "accepted" or answer.outcome == "timed_out":
            self._task(goal, self._follow_to_the_end(goal))
        if answer.outcome == "accepted":
            self._show(goal, self._under_way(goal, say("goal_executing")))
        else:
            self._show(goal, Progress(outcome=answer.outcome, text=answer.text))
        return answer

    async def cancel(self, widget: Action) -> Answer:
        """Asks the robot to cancel the goal that is under way."""
        goal = self._goals.get(widget.id)
        if goal is None or not self._robot.progress[widget.id].stoppable:
            return Answer("refused", say("nothing_to_cancel"))
        request, response = self._interfaces.service(CANCEL)
        stamp = {"sec": 0, "nanosec": 0}
        info = {"goal_id": {"uuid": list(goal.id.bytes)}, "stamp": stamp}
        payload = self._interfaces.encode(request, {"goal_info": info})
        reply = await self._asked(goal, "cancel_goal", payload, widget.timeout_s)
        if reply is None:
            return Answer("unknown", say("timed_out", seconds=f"{widget.timeout_s:g}"))
        code = self._decoded(response, reply, "return_code")
        now = clock(time.time())
        if code != 0:
            return Answer("rejected", say("cancel_refused", time=now))
        if self._robot.progress[widget.id].busy:
            self._show(goal, self._under_way(goal, say("goal_canceling")))
        return Answer("accepted", say("cancel_sent", time=now))

    def hear_feedback(self, action: str, sample: Sample) -> None:
        """The latest feedback of an action; of another program's goal it is passed over."""
        for goal in self._goals.values():
            widget = goal.widget
            if widget.action == action and self._robot.progress[widget.id].stoppable:
                self._take_feedback(goal, sample)

    def _take_feedback(self, goal: _Goal, sample: Sample) -> None:
        widget = goal.widget
        types = self._interfaces.action(widget.type)
        try:
            message = self._interfaces.decode(types.feedback_message, bytes(sample.payload))
        except DecodeError as error:
            log.error("%s: %s", widget.action, error)
            return
        if bytes(message.goal_id.uuid) != goal.id.bytes:
            return
        if widget.progress is not None:
            done = float(value_at(message.feedback, widget.progress)) / widget.progress_max
            goal.fraction = min(1.0, max(0.0, done)) if done == done else None  # NaN is no progress
        goal.said = with_fields(widget.feedback, message.feedback)
        self._show(goal, self._under_way(goal, say("goal_executing")))

    def _first_answer(self, goal: _Goal, response: str, reply: bytes | None) -> Answer:
        now = clock(time.time())
        if reply is not None:
            accepted = self._decoded(response, reply, "accepted")
            if accepted is True:
                return Answer("accepted", say("goal_accepted", time=now))
            if accepted is False:
                return Answer("rejected", say("goal_rejected", time=now))
            return Answer("unknown", say("answer_unreadable", wanted=goal.widget.type))
        if goal.cut.done():
            return Answer("unknown", say("call_cut"))
        seconds = f"{goal.widget.timeout_s:g}"
        return Answer("timed_out", say("timed_out", seconds=seconds) + say("cyclone_hint"))

    async def _follow_to_the_end(self, goal: _Goal) -> None:
        """Waits for the result, over cuts of the connection too: the robot goes on meanwhile."""
        while True:
            answer = await self._ended(goal)
            if answer.outcome == "unknown" and goal.cut.done():
                self._show(goal, Progress(outcome="unknown", text=answer.text))
                goal.corrected(goal.press_id, answer)
                await self._until_offered(goal)
                goal.cut = asyncio.get_running_loop().create_future()
                continue
            break
        log.info("press %s: goal %s: %s: %s", goal.press_id, goal.id, answer.outcome, answer.text)
        goal.corrected(goal.press_id, answer)
        if self._goals.get(goal.widget.id) is goal:
            self._show(goal, Progress(outcome=answer.outcome, text=answer.text))

    async def _until_offered(self, goal: _Goal) -> None:
        key = self._robot.key(goal.widget.action)
        while self._robot.graph.server_type("AS", key) != goal.widget.type:
            await asyncio.sleep(ASK_AGAIN_S)

    async def _ended(self, goal: _Goal) -> Answer:
        types = self._interfaces.action(goal.widget.type)
        request = {"goal_id": {"uuid": list(goal.id.bytes)}}
        payload = self._interfaces.encode(types.get_result_request, request)
        reply = await self._asked(goal, "get_result", payload, RESULT_S)
        if reply is None:
            return Answer("unknown", say("goal_cut"))
        try:
            message = self._interfaces.decode(types.get_result_response, reply)
        except DecodeError as error:
            log.error("%s: %s", goal.widget.action, error)
            return Answer("unknown", say("answer_unreadable", wanted=goal.widget.type))
        if message.status not in ENDS:
            return Answer("unknown", say("goal_lost"))
        outcome, sentence = ENDS[message.status]
        said = with_fields(goal.widget.result, message.result)
        return Answer(outcome, say(sentence, time=clock(time.time())) + (f": {said}" if said else "."))

    async def _asked(self, goal: _Goal, what: str, payload: bytes, timeout_s: float) -> bytes | None:
        """The reply; None when there is none in time, or the bridge went away."""
        key = f"{self._robot.key(goal.widget.action)}/_action/{what}"
        query = self._link.query(key, payload, timeout_s)
        ends: set[asyncio.Future[Any]] = {query, goal.cut}
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        return query.result() if query.done() else None

    def _decoded(self, type_name: str, reply: bytes, name: str) -> Any:
        try:
            return getattr(self._interfaces.decode(type_name, reply), name)
        except DecodeError as error:
            log.error("%s", error)
            return None

    def _under_way(self, goal: _Goal, text: str) -> Progress:
        said = f"{text} {goal.said}".strip()
        return Progress(True, "accepted", said, goal.fraction, stoppable=True)

    def _show(self, goal: _Goal, progress: Progress) -> None:
        if self._goals.get(goal.widget.id) is goal:
            self._robot.progress[goal.widget.id] = progress
            self._changed()

    def _task(self, goal: _Goal, work: Coroutine[Any, Any, None]) -> None:
        task = asyncio.get_running_loop().create_task(work)
        goal.tasks.add(task)
        task.add_done_callback(goal.tasks.discard)
        task.add_done_callback(_told)


def _told(task: "asyncio.Task[None]") -> None:
    if not task.cancelled() and (error := task.exception()):
        log.error("following a goal failed", exc_info=error)
