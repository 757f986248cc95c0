"""Action goals: sent, followed by their feedback, canceled, and known to the end.

A goal belongs to the robot, not to a browser: it goes on when a page is closed and shows in every
one. Wire format: ROS 2's `<action>/_action/…` services and topics (design.ros2.org, "Actions").
"""

import asyncio
import logging
import math
import time
import uuid
from collections.abc import Callable, Iterator
from typing import Any, Final

from app import keys
from app.calls import CUT_NEWS_S, LATE_S, MOST_UNANSWERED, Asker, with_fields
from app.errors import DecodeError, LinkError
from app.goals import ACCEPTED, CANCELING, ENDS, UNKNOWN, Goal
from app.interfaces import Interfaces
from app.interlocks import SERVER_SETTLE_S
from app.logs import RobotLog
from app.panel.model import Action
from app.progress import IDLE, Answer, Corrected, Progress
from app.robot import Robot, Sample, value_of
from app.sentences import clock, say
from app.tasks import told

log = logging.getLogger("kiosk.actions")

CANCEL: Final = "action_msgs/srv/CancelGoal"
STATUS: Final = "action_msgs/msg/GoalStatusArray"
RESULT_S: Final = 86_400.0  # a result is waited for as long as the goal takes
ASK_AGAIN_S: Final = 1.0


class Actions:
    """The goals of one robot; used on the event loop only."""

    def __init__(
        self, interfaces: Interfaces, robot: Robot, link: Asker, changed: Callable[[], None]
    ) -> None:
        """`changed` is called when what the widgets show has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._link = link
        self._changed = changed
        self._latest: dict[str, Goal] = {}  # by widget
        self._following: dict[asyncio.Task[None], Goal] = {}

    def follow(self) -> None:
        """After every change of the graph: of a goal whose server is gone nothing more is heard."""
        bridge = bool(self._robot.graph.bridges)
        for goal in (*self._latest.values(), *self._following.values()):
            if not goal.cut.done() and not (bridge and self._offered(goal.widget)):
                gone = say("goal_gone", name=goal.widget.action)
                goal.cut.set_result(gone if bridge else "")

    async def stop(self) -> None:
        """Ends its tasks; goals go on in the robot."""
        tasks = list(self._following)
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def start(
        self, widget: Action, fields: dict[str, Any], press_id: str, corrected: Corrected
    ) -> Answer:
        """Sends a goal; `corrected` gets what came of it in the end. FieldError for bad fields,
        LinkError where it could not be sent: then nothing is under way."""
        types = self._interfaces.action(widget.type)
        goal_id = uuid.uuid4()
        wrapped = {"goal_id": {"uuid": list(goal_id.bytes)}, "goal": fields}
        payload = self._interfaces.encode(types.send_goal_request, wrapped)
        if why := self.full(widget.action):
            return Answer("refused", why)
        query = self._query(widget, "send_goal", payload, widget.timeout_s)
        cut = asyncio.get_running_loop().create_future()
        goal = Goal(widget, press_id, goal_id, cut, corrected)
        self._latest[widget.id] = goal
        self._show(goal, Progress(busy=True, text=say("waiting_for_answer")))
        reply = await self._reply(goal, query)
        answer = self._first_answer(goal, types.send_goal_response, reply)
        if answer.outcome != "rejected":
            goal.advance(ACCEPTED if answer.outcome == "accepted" else UNKNOWN)
            self._task(goal)
        runs = goal.lives and not cut.done()
        self._show(goal, goal.under_way if runs else goal.came_to(answer))
        return answer

    def full(self, action: str) -> str:
        """Why no further goal of an action is sent; "" while one may be."""
        count = sum(goal.widget.action == action for goal in self._following.values())
        return say("too_many", service=action) if count >= MOST_UNANSWERED else ""

    def _stoppable(self, widget: Action, press_id: str) -> Goal | None:
        latest, shown = self._latest.get(widget.id), self._robot.progress.get(widget.id, IDLE)
        if not press_id:
            return latest if shown.stoppable else None
        if latest is not None and latest.press_id == press_id and shown.busy:
            return latest
        followed = (goal for goal in self._following.values() if goal.widget.id == widget.id)
        return next((goal for goal in followed if goal.press_id == press_id), None)

    def over(self, widget: Action, press_id: str) -> str:
        """Why there is nothing to cancel; "" where there is."""
        if self._stoppable(widget, press_id) is not None:
            return ""
        return say("goal_over" if press_id else "nothing_to_cancel")

    async def cancel(self, widget: Action, press_id: str = "") -> Answer:
        """Asks the robot to cancel the goal of one press or, without its id, the one that is shown to
        be under way. LinkError where that could not be sent."""
        if (goal := self._stoppable(widget, press_id)) is None:
            return Answer("refused", self.over(widget, press_id))
        request, response = self._interfaces.service(CANCEL)
        stamp = {"sec": 0, "nanosec": 0}
        info = {"goal_id": {"uuid": list(goal.id.bytes)}, "stamp": stamp}
        payload = self._interfaces.encode(request, {"goal_info": info})
        query = self._query(widget, "cancel_goal", payload, widget.timeout_s)
        reply = await self._reply(goal, query)
        if reply is None:
            return Answer("unknown", say("timed_out", seconds=f"{widget.timeout_s:g}"))
        code = self._decoded(response, reply, "return_code")
        now = clock(time.time())
        if code != 0:
            return Answer("rejected", say("cancel_refused", time=now))
        if goal.advance(CANCELING) and self._robot.progress[widget.id].busy:
            self._show(goal, goal.under_way)
        return Answer("accepted", say("cancel_sent", time=now))

    def hear_feedback(self, action: str, sample: Sample) -> None:
        """The latest feedback of an action; of another program's goal it is passed over. Whoever
        calls this shows it when a frame is due."""
        goals = [g for g in self._of(action) if self._robot.progress[g.widget.id].stoppable]
        if not goals:
            return
        types = self._interfaces.action(goals[0].widget.type)  # the server's, which has but one
        key = keys.feedback(self._robot.key(action))
        message = self._heard(key, types.feedback_message, sample)
        for goal in goals:
            if message is not None and bytes(message.goal_id.uuid) == goal.id.bytes:
                self._take_feedback(goal, message.feedback)

    def hear_status(self, action: str, sample: Sample) -> None:
        """The states of an action's goals; those of other programs are passed over."""
        goals = {goal.id.bytes: goal for goal in self._of(action)}
        if not goals:
            return
        message = self._heard(keys.status(self._robot.key(action)), STATUS, sample)
        for one in () if message is None else message.status_list:
            goal = goals.get(bytes(one.goal_info.goal_id.uuid))
            if goal is not None and goal.advance(one.status):
                self._advanced(goal)

    def _of(self, action: str) -> Iterator[Goal]:
        return (goal for goal in self._latest.values() if goal.widget.action == action)

    def _heard(self, key: str, type_name: str, sample: Sample) -> Any:
        """A sample's message; None where it can't be read."""
        try:
            return self._interfaces.decode(type_name, bytes(sample.payload))
        except DecodeError as error:
            self._robot.count_unreadable(key, sample, error)
            return None

    def _advanced(self, goal: Goal) -> None:
        """It has another state; while its first answer or its result is awaited, or its server after a
        cut, that will show."""
        if not goal.lives or goal.cut.done() or goal not in self._following.values():
            return
        if not self._robot.progress[goal.widget.id].busy:  # it was not known whether it runs
            goal.corrected(
                goal.press_id, Answer("accepted", say("goal_accepted", time=clock(time.time())))
            )
        self._show(goal, goal.under_way)

    def _take_feedback(self, goal: Goal, feedback: Any) -> None:
        widget = goal.widget
        if widget.progress is not None:
            found = value_of(feedback, widget.progress)
            done = math.nan if found is None else float(found) / widget.progress_max
            goal.fraction = min(1.0, max(0.0, done)) if done == done else None  # NaN is no progress
        goal.said = with_fields(widget.feedback, feedback)
        self._note(goal, goal.under_way)  # shown with the next frame: a goal may say a lot

    def _first_answer(self, goal: Goal, response: str, reply: bytes | None) -> Answer:
        now = clock(time.time())
        if reply is not None:
            accepted = self._decoded(response, reply, "accepted")
            if accepted is True:
                return Answer("accepted", say("goal_accepted", time=now))
            if accepted is False:
                return Answer("rejected", say("goal_rejected", time=now))
            return Answer("unknown", say("answer_unreadable", wanted=goal.widget.type))
        if goal.cut.done():
            return Answer("unknown", goal.cut.result() or say("call_cut"))
        seconds = f"{goal.widget.timeout_s:g}"
        return Answer("timed_out", say("timed_out", seconds=seconds) + say("cyclone_hint"))

    async def _follow_to_the_end(self, goal: Goal) -> None:
        """Waits for the result, over cuts of the connection too: the robot goes on meanwhile."""
        while True:
            if goal.cut.done():
                if goal.lives:
                    goal.state = UNKNOWN
                    self._tell(goal, Answer("unknown", goal.cut.result() or say("goal_cut")))
                await self._until_offered(goal)
                goal.cut = asyncio.get_running_loop().create_future()
                self._advanced(goal)
            if answer := await self._ended(goal):
                break
            if not (goal.known or goal.cut.done()):
                return  # it was never heard of: what was said of it stands
            await asyncio.wait({goal.cut}, timeout=ASK_AGAIN_S)
        self._log.info("press %s: goal %s: %s: %s", goal.press_id, goal.id, answer.outcome, answer.text)
        self._tell(goal, answer)

    async def _until_offered(self, goal: Goal) -> None:
        key = self._robot.key(goal.widget.action)
        while not (
            self._offered(goal.widget)
            and time.monotonic() >= self._robot.graph.served_since("AS", key) + SERVER_SETTLE_S
        ):
            await asyncio.sleep(ASK_AGAIN_S)

    def _offered(self, widget: Action) -> bool:
        return self._robot.graph.server_type("AS", self._robot.key(widget.action)) == widget.type

    async def _ended(self, goal: Goal) -> Answer | None:
        """What came of it; None where nothing more is heard, or nobody answered.

        One that the robot is not known to have is asked for not much longer than a call.
        """
        types = self._interfaces.action(goal.widget.type)
        request = {"goal_id": {"uuid": list(goal.id.bytes)}}
        payload = self._interfaces.encode(types.get_result_request, request)
        reply = await self._result(goal, payload)
        if reply is None:
            return None
        try:
            message = self._interfaces.decode(types.get_result_response, reply)
        except DecodeError as error:
            self._log.error("%s: %s", goal.widget.action, error)
            return Answer("unknown", say("answer_unreadable", wanted=goal.widget.type))
        goal.state = message.status if message.status in ENDS else UNKNOWN
        if message.status not in ENDS:
            return Answer("unknown", say("goal_lost"))
        outcome, sentence = ENDS[message.status]
        said = with_fields(goal.widget.result, message.result)
        return Answer(outcome, say(sentence, time=clock(time.time())) + (f": {said}" if said else "."))

    async def _result(self, goal: Goal, payload: bytes) -> bytes | None:
        """The reply of `get_result`, which is asked for again where Zenoh refuses."""
        refused = False
        while not goal.cut.done():
            wait_s = RESULT_S if goal.known else LATE_S
            try:
                return await self._reply(goal, self._query(goal.widget, "get_result", payload, wait_s))
            except LinkError as error:
                if not refused:
                    self._log.warning("press %s: %s", goal.press_id, error)
                refused = True
                await asyncio.wait({goal.cut}, timeout=ASK_AGAIN_S)
        return None

    def _query(
        self, widget: Action, what: str, payload: bytes, timeout_s: float
    ) -> "asyncio.Future[bytes | None]":
        """Asks a service of the action; LinkError where that could not be sent."""
        key = f"{self._robot.key(widget.action)}/_action/{what}"
        return self._link.query(key, payload, timeout_s)

    async def _reply(self, goal: Goal, query: "asyncio.Future[bytes | None]") -> bytes | None:
        """The reply; None when there is none in time, or the bridge went away."""
        ends: set[asyncio.Future[Any]] = {query, goal.cut}
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        reply = query.result() if query.done() else None
        if reply is None:
            await asyncio.wait({goal.cut}, timeout=CUT_NEWS_S)  # the news of a cut may follow
        return reply

    def _decoded(self, type_name: str, reply: bytes, name: str) -> Any:
        try:
            return getattr(self._interfaces.decode(type_name, reply), name)
        except DecodeError as error:
            self._log.error("%s", error)
            return None

    def _tell(self, goal: Goal, answer: Answer) -> None:
        """What came of it, or that it is not known any more: to the widget and the receipt."""
        self._show(goal, goal.came_to(answer))
        goal.corrected(goal.press_id, answer)

    def _show(self, goal: Goal, progress: Progress) -> None:
        if self._note(goal, progress):
            self._changed()

    def _note(self, goal: Goal, progress: Progress) -> bool:
        """What its widget will show; False where that shows another goal by now."""
        latest = self._latest.get(goal.widget.id) is goal
        if latest:
            self._robot.progress[goal.widget.id] = progress
        return latest

    def _task(self, goal: Goal) -> None:
        task = told(self._follow_to_the_end(goal), self._log, "following a goal failed")
        self._following[task] = goal
        task.add_done_callback(self._followed)

    def _followed(self, task: "asyncio.Task[None]") -> None:
        goal = self._following.pop(task)
        if not task.cancelled() and task.exception():
            goal.state = UNKNOWN
            self._tell(goal, Answer("unknown", say("goal_fault")))
