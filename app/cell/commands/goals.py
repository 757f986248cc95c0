"""Sends action goals and tracks them to their end: feedback, status, cancel, result.

A goal belongs to the robot, not to a browser: it continues when a page is closed, and every page shows
it. Wire format: ROS 2's `<action>/_action/…` topics (design.ros2.org, "Actions").
"""

import asyncio
import logging
import math
import time
import uuid
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import TYPE_CHECKING, Any, Final

from app.cell.commands.press import PressHandle
from app.cell.commands.services import LATE_S, with_fields, with_reply
from app.cell.commands.transport import Transport
from app.cell.robot.definitions import timeout_hint
from app.cell.robot.sample_handlers import SampleHandler, SampleHandlers
from app.cell.robot.state import Reading, RobotState, Sample
from app.cell.robot.topics import Topic
from app.panel.known_values import ERROR_CODE, NAV2, known_value
from app.panel.model import Panel
from app.panel.response_text import response_paths
from app.panel.robot_texts import NO_TEXTS, RobotTexts
from app.panel.widgets.service_action import Action
from app.records import OpenPress
from app.records.entry import IDLE, CommandStatus, OnCorrection, Outcome, OutcomeCode
from app.records.press_record import PendingEntry, PressLog
from app.ros.messages import Fields, Interfaces, names
from app.ros.messages.names import of_action
from app.system.clock import format_datetime, format_time
from app.system.concurrency import end_tasks, keep_running, spawn_logged
from app.system.errors import DecodeError, LinkError, LogError
from app.system.log import RobotLog
from app.system.texts import Text, TextLike, hint, joined, number, say

if TYPE_CHECKING:
    from app.cell.commands.waypoints import WaypointTracker

# One goal of an action: its state, and the command status that its widget shows. Pure.
#
# States and their order: action_msgs/msg/GoalStatus.

FEEDBACK: Final = "feedback."  # prefix of the feedback's fields in the feedback message
UNKNOWN: Final = 0
ACCEPTED: Final = 1
EXECUTING: Final = 2
CANCELING: Final = 3
NAMES: Final = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
# The outcome, the sentence for an end during the connection, and the one for an end before it.
ENDS: Final[Mapping[int, tuple[OutcomeCode, str, str]]] = {
    4: ("succeeded", "goal_succeeded", "goal_succeeded_before"),
    5: ("canceled", "goal_canceled", "goal_canceled_before"),
    6: ("aborted", "goal_aborted", "goal_aborted_before"),
}


def goal_id(entry: str) -> uuid.UUID:
    """The goal id for a press, made of the hash of its entry in the operator's log, so that the log is
    enough to find the goal again. Random without an entry."""
    return uuid.UUID(entry[:32]) if entry else uuid.uuid4()


@dataclass(slots=True)
class Goal:
    """A goal that was sent. `state` is None until it is known; `is_known` is true once the robot has
    reported the goal. `sent` are the fields of its message, None for one of before the server's start.

    `cut` is done when the action server or the connection is lost: with a sentence, or "" for a lost
    connection. `doubt` is the sentence while it is unknown whether the goal still runs, after a lost
    connection or a restart of the server.
    """

    widget: Action
    press_id: str
    id: uuid.UUID
    cut: "asyncio.Future[TextLike]"
    correct: OnCorrection
    state: int | None = None
    is_known: bool = False
    sent: Mapping[str, Any] | None = None
    doubt: TextLike = ""
    missed: Mapping[int, int] = field(default_factory=dict)  # poses that its result calls so
    feedback_text: TextLike = ""
    fraction: float | None = None
    greatest: float = 0.0  # value of a progress that falls

    def advance(self, state: int) -> bool:
        """Sets a later state; False if the goal has this or a later state already."""
        if state not in range(len(NAMES)) or (self.state is not None and state <= self.state):
            return False
        self.state = state
        self.is_known = self.is_known or state != UNKNOWN
        return True

    def apply_feedback(self, message: Fields, texts: RobotTexts = NO_TEXTS) -> None:
        """Updates feedback text and progress from a feedback message; `texts` are those of the panel
        file."""
        widget = self.widget
        if widget.progress is not None:
            progress = message.get(FEEDBACK + widget.progress)
            done = math.nan if progress is None else self._done(float(progress))
            self.fraction = min(1.0, max(0.0, done)) if done == done else None  # NaN is no progress
        self.feedback_text = with_fields(widget.feedback, message, FEEDBACK, texts, widget.type)

    def _done(self, progress: float) -> float:
        """The part of the goal that is done; NaN while it is not known from where the progress
        falls."""
        if not self.widget.progress_falls:
            return progress / self.widget.progress_max
        self.greatest = max(self.greatest, progress if math.isfinite(progress) else 0.0)
        whole = self.widget.falls_from or self.greatest
        return 1 - progress / whole if whole else math.nan

    @property
    def is_running(self) -> bool:
        """Whether the goal is known to be running."""
        return self.state is not None and self.state != UNKNOWN and self.state not in ENDS

    @property
    def running_status(self) -> CommandStatus:
        sentence = say("goal_canceling" if self.state == CANCELING else "goal_executing")
        feedback = self.feedback_text
        text = joined([sentence, feedback.rstrip() if isinstance(feedback, str) else feedback])
        return CommandStatus(True, "accepted", text, self.fraction, True, self._name, self.press_id)

    @property
    def doubt_status(self) -> CommandStatus:
        """The status of a goal that may be running."""
        stoppable, press = not self.cut.done(), self.press_id
        return CommandStatus(True, "unknown", self.doubt, None, stoppable, NAMES[UNKNOWN], press)

    def end_status(self, answer: Outcome) -> CommandStatus:
        """The status when tracking has ended."""
        return CommandStatus(outcome=answer.outcome, text=answer.text, goal=self._name)

    @property
    def _name(self) -> str:
        return "" if self.state is None else NAMES[self.state]


# Client of an action server's services: `send_goal`, `cancel_goal`, `get_result`.
#
# Wire format: ROS 2's `<action>/_action/…` services (design.ros2.org, "Actions").

log = logging.getLogger("kiosk.actions")

CANCEL: Final = "action_msgs/srv/CancelGoal"
STATUS: Final = "status"
MAX_NAMED: Final = 20  # of the poses that were missed
RESULT: Final = "result."  # prefix of the result's fields in the response of `get_result`
MISSED: Final = ("missed_waypoints", "waypoint_statuses")  # fields of a result
MAX_MISSED_BYTES: Final = 200_000
NO_SUCH_GOAL: Final = frozenset({2, 3})  # ERROR_UNKNOWN_GOAL_ID, ERROR_GOAL_TERMINATED

Query = asyncio.Future[bytes | None]


def error_paths(action: Action, interfaces: Interfaces) -> tuple[str, ...]:
    """The field of a result with Nav2's error code, unless `result` shows it or its message itself."""
    if not action.type.startswith(NAV2) or {ERROR_CODE, "error_msg"} & {*response_paths(action.result)}:
        return ()
    result = interfaces.structures[interfaces.action_types(action.type).result]
    return tuple(field.name for field in result.fields if field.name == ERROR_CODE)


class ActionClient:
    """The action services of one robot. Methods that send raise LinkError if the request could not be
    sent; methods that read a reply return None if it is not readable."""

    def __init__(self, interfaces: Interfaces, robot: RobotState, transport: Transport) -> None:
        self._interfaces = interfaces
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._transport = transport

    def is_offered(self, widget: Action) -> bool:
        """Whether the robot offers a widget's action with the same type."""
        return self._robot.graph.server_type("AS", self._robot.key(widget.action)) == widget.type

    def goal_request(self, widget: Action, goal_id: uuid.UUID, fields: dict[str, Any]) -> bytes:
        """The encoded request of `send_goal`; FieldError for bad fields."""
        wrapped = {"goal_id": {"uuid": list(goal_id.bytes)}, "goal": fields}
        return self._interfaces.encode(
            self._interfaces.action_types(widget.type).send_goal_request, wrapped
        )

    def send_goal(self, widget: Action, request: bytes) -> Query:
        return self._query(widget, "send_goal", request, widget.timeout_s)

    def cancel_goal(self, goal: Goal) -> Query:
        request, _ = self._interfaces.service_types(CANCEL)
        stamp = {"sec": 0, "nanosec": 0}
        info = {"goal_id": {"uuid": list(goal.id.bytes)}, "stamp": stamp}
        payload = self._interfaces.encode(request, {"goal_info": info})
        return self._query(goal.widget, "cancel_goal", payload, goal.widget.timeout_s)

    def get_result(self, goal: Goal, timeout_s: float) -> Query:
        request = self._interfaces.action_types(goal.widget.type).get_result_request
        payload = self._interfaces.encode(request, {"goal_id": {"uuid": list(goal.id.bytes)}})
        return self._query(goal.widget, "get_result", payload, timeout_s)

    def _query(self, widget: Action, service: str, payload: bytes, timeout_s: float) -> Query:
        key = of_action(self._robot.key(widget.action), service)
        return self._transport.query(key, payload, timeout_s)

    async def reply(self, goal: Goal, query: Query) -> bytes | None:
        """The reply; None at a timeout, or if the peer was lost in the meantime."""
        ends: set[asyncio.Future[Any]] = {query} if goal.cut.done() else {query, goal.cut}
        await asyncio.wait(ends, return_when=asyncio.FIRST_COMPLETED)
        reply = query.result() if query.done() else None
        if reply is None:
            # The peer's token may end a little later.
            await asyncio.wait({goal.cut}, timeout=self._robot.traits.loss_delay_s)
        return reply

    def goal_response(self, goal: Goal, reply: bytes | None) -> Outcome:
        """The outcome of `send_goal`, from its reply; None stands for no reply."""
        widget, now = goal.widget, format_time(time.time())
        if reply is not None:
            response = self._interfaces.action_types(widget.type).send_goal_response
            message = self._decoded(widget, response, reply)
            if message is None:
                return Outcome("unknown", say("call_response_unreadable", wanted=widget.type))
            if message.accepted:
                return Outcome("accepted", say("goal_accepted", time=now))
            return Outcome("rejected", say("goal_rejected", time=now))
        if goal.cut.done():
            return Outcome("unknown", goal.cut.result() or say("call_connection_lost"))
        sentence = say("timed_out", seconds=number(f"{widget.timeout_s:g}"))
        key, sentences = self._robot.key(widget.action), self._robot.traits.sentences
        code = timeout_hint(self._robot.graph, "AS", key, sentences.timeout_hint)
        return Outcome("timed_out", joined([sentence, hint(code)]))

    def cancel_response(self, widget: Action, reply: bytes) -> Any:
        """The response of `cancel_goal`: a message with `return_code` and `goals_canceling`."""
        return self._decoded(widget, self._interfaces.service_types(CANCEL)[1], reply)

    def no_response_reason(self, widget: Action) -> Text:
        """Why `cancel_goal` did not respond."""
        if self.is_offered(widget):
            return say("timed_out", seconds=number(f"{widget.timeout_s:g}"))
        return say("cancel_may_not_have_arrived", name=widget.action)

    async def result(self, widget: Action, reply: bytes) -> Fields | None:
        """The response of `get_result`: the status, and the result fields that the widget shows."""
        shown = (*response_paths(widget.result), *error_paths(widget, self._interfaces))
        paths = (STATUS, *(RESULT + path for path in shown))
        response = self._interfaces.action_types(widget.type).get_result_response
        try:
            return await self._robot.slices.read_all(
                self._interfaces.field_reader(response, paths), reply
            )
        except DecodeError as error:
            self._log.error("%s: %s", widget.action, error)
            return None

    def missed(self, widget: Action, reply: bytes) -> Mapping[int, int]:
        """The poses that a result calls missed, with their error codes; none of one that is too large
        to be read at once."""
        types = self._interfaces.action_types(widget.type)
        known = {field.name for field in self._interfaces.structures[types.result].fields}
        if not known & {*MISSED} or len(reply) > MAX_MISSED_BYTES:
            return {}
        from app.cell.robot.waypoints import missed_of

        message = self._decoded(widget, types.get_result_response, reply)
        return {} if message is None else missed_of(message.result)

    def _decoded(self, widget: Action, type_name: str, reply: bytes) -> Any:
        try:
            return self._interfaces.decode(type_name, reply)
        except DecodeError as error:
            self._log.error("%s: %s", widget.action, error)
            return None


# Waits for the results of goals, also across lost connections: the goals continue on the robot.

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
            if not (goal.is_known or goal.cut.done()):
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
        goal.missed = self._services.missed(goal.widget, reply)
        if status not in ENDS:
            return Outcome("unknown", say("goal_forgotten") if goal.is_known else say("goal_not_known"))
        outcome, ended, had_ended = ENDS[status]
        sentence = had_ended if goal.doubt else ended
        widget, code = goal.widget, fields.get(RESULT + ERROR_CODE)
        error = known_value(widget.type, ERROR_CODE, code) if outcome == "aborted" else None
        text = error or with_fields(widget.result, fields, RESULT, self._robot.texts, widget.type)
        if goal.missed and not text:
            numbers = ", ".join(str(index + 1) for index in sorted(goal.missed)[:MAX_NAMED])
            text = say("goal_missed", count=len(goal.missed), numbers=numbers)
        return Outcome(outcome, with_reply(say(sentence, time=format_time(time.time())), text))

    async def _result(self, goal: Goal) -> bytes | None:
        """The reply of `get_result`, requested again if Zenoh refuses to send.

        The timeout is short for a goal that the robot has not reported or that may have ended.
        """
        refused = False
        while not goal.cut.done():
            try:
                seconds = RESULT_S if goal.is_known and not goal.doubt else LATE_S
                query = self._services.get_result(goal, seconds)
                return await self._services.reply(goal, query)
            except LinkError as error:
                if not refused:
                    self._log.warning("press %s: %s", goal.press_id, error)
                refused = True
                await asyncio.wait({goal.cut}, timeout=ASK_AGAIN_S)
        return None


STATUS_ARRAY: Final = "action_msgs/msg/GoalStatusArray"
GOAL_ID: Final = "goal_id.uuid"


class GoalTracker:
    """The goals of one robot. Used on the event loop only."""

    def __init__(
        self,
        interfaces: Interfaces,
        robot: RobotState,
        transport: Transport,
        status_set: Callable[[str], None],
    ) -> None:
        """`status_set` is called with the id of a widget of which the status has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._status_set = status_set
        self._services = ActionClient(interfaces, robot, transport)
        self._results = ResultWaiter(
            self._services, robot, cut=self._cut_off, restored=self._advanced, finished=self._finish
        )
        self._latest: dict[str, Goal] = {}  # by widget
        self._feedback: dict[str, Topic] = {}  # by widget
        self._states: dict[str, Sample] = {}  # by action: the last status message
        self._waypoints = self._make_waypoints() if robot.tour_actions else None

    def _make_waypoints(self) -> "WaypointTracker":
        from app.cell.commands.waypoints import WaypointTracker  # few panels have a tour

        return WaypointTracker(self._interfaces, self._robot, self._is_own, self._status_set)

    @property
    def has_running(self) -> bool:
        """Whether the end of a goal is not known yet."""
        return bool(self._results.goals)

    def register(self, handlers: SampleHandlers, actions: Iterable[str]) -> None:
        """Handles the feedback and status of these actions from now on."""
        for action in actions:
            key = self._robot.key(action)
            feedback = SampleHandler(partial(self.on_feedback, action))
            status = SampleHandler(partial(self.on_status, action), is_immediate=True)
            handlers.add(names.feedback(key), feedback)
            handlers.add(names.status(key), status)

    def on_graph_change(self) -> None:
        """Cuts off goals whose action server or peer is lost. Call it after every change of the
        graph."""
        is_reached = bool(self._robot.graph.peers)
        if not is_reached:
            self._states.clear()
        for goal in (*self._latest.values(), *self._results.goals):
            if not goal.cut.done() and not (is_reached and self._services.is_offered(goal.widget)):
                gone = say("goal_action_gone", name=goal.widget.action)
                goal.cut.set_result(gone if is_reached else "")
                if goal.doubt:
                    self._set_status(goal, goal.doubt_status)

    async def stop(self) -> None:
        """Ends the tasks. The goals continue on the robot."""
        await self._results.stop()

    async def start(self, widget: Action, fields: dict[str, Any], handle: PressHandle) -> Outcome:
        """Sends a goal and waits for its acceptance; its result corrects the receipt. FieldError for
        bad fields, LinkError if the goal could not be sent."""
        own_id = goal_id(handle.entry)
        request = self._services.goal_request(widget, own_id, fields)
        if why := self.full(widget.action):
            return Outcome("refused", why)
        handle.final_check()
        query = self._services.send_goal(widget, request)
        cut = asyncio.get_running_loop().create_future()
        goal = Goal(widget, handle.press_id, own_id, cut, handle.correct, sent=fields)
        self._latest[widget.id] = goal
        self._show(goal, CommandStatus(busy=True, text=say("call_waiting")))
        answer = self._services.goal_response(goal, await self._services.reply(goal, query))
        if answer.outcome != "rejected":
            goal.advance(ACCEPTED if answer.outcome == "accepted" else UNKNOWN)
            self._results.begin(goal)
        if answer.outcome == "accepted":
            self._begin_waypoints(goal)
        if cut.done() and answer.outcome == "unknown" and not goal.is_running:
            self._show_doubt(goal, answer.text)
        else:
            runs = goal.is_running and not cut.done()
            self._show(goal, goal.running_status if runs else goal.end_status(answer))
        return answer

    def resume(self, goal: Goal) -> None:
        """Tracks a goal that was sent before the server's start; its `cut` is done. Its widget shows it
        unless there is a newer goal."""
        if any(goal.id == tracked.id for tracked in (*self._latest.values(), *self._results.goals)):
            return
        self._latest.setdefault(goal.widget.id, goal)
        self._results.begin(goal)
        self._show(goal, goal.doubt_status)
        if (status := self._states.get(goal.widget.action)) is not None:
            self.on_status(goal.widget.action, status)

    def full(self, action: str) -> TextLike:
        """Why no further goal of an action may be sent, "" if it may."""
        count = sum(goal.widget.action == action for goal in self._results.goals)
        return (
            say("call_too_many_pending", service=action)
            if count >= self._robot.traits.max_unanswered
            else ""
        )

    def _cancelable(self, widget: Action, press_id: str) -> Goal | None:
        latest, shown = self._latest.get(widget.id), self._robot.command_status.get(widget.id, IDLE)
        if not press_id:
            return latest if shown.can_cancel else None
        if latest is not None and latest.press_id == press_id and shown.busy:
            return latest
        tracked = (goal for goal in self._results.goals if goal.widget.id == widget.id)
        return next((goal for goal in tracked if goal.press_id == press_id), None)

    def no_goal_reason(self, widget: Action, press_id: str) -> TextLike:
        """Why there is no goal to cancel, "" if there is one."""
        if self._cancelable(widget, press_id) is not None:
            return ""
        return say("cancel_goal_ended" if press_id else "cancel_nothing_in_progress")

    async def cancel(self, widget: Action, press_id: str = "") -> Outcome:
        """Asks the robot to cancel the goal of a press; without a press id, the goal shown as running.
        LinkError if the request could not be sent."""
        if (goal := self._cancelable(widget, press_id)) is None:
            return Outcome("refused", self.no_goal_reason(widget, press_id))
        reply = await self._services.reply(goal, self._services.cancel_goal(goal))
        if reply is None:
            return Outcome("unknown", self._services.no_response_reason(widget))
        response = self._services.cancel_response(widget, reply)
        if response is None:
            return Outcome("unknown", say("call_response_unreadable", wanted=CANCEL))
        return self._cancel_outcome(goal, response)

    def _cancel_outcome(self, goal: Goal, response: Any) -> Outcome:
        """Only a goal in `goals_canceling` is being canceled: rclpy refuses with return code 0."""
        now = format_time(time.time())
        if any(bytes(canceled.goal_id.uuid) == goal.id.bytes for canceled in response.goals_canceling):
            if goal.advance(CANCELING) and (
                goal.doubt or self._robot.command_status[goal.widget.id].busy
            ):
                self._confirm_running(goal)
                self._show(goal, goal.running_status)
            return Outcome("accepted", say("cancel_sent", time=now))
        if goal.state == CANCELING:  # by an earlier cancel
            return Outcome("accepted", say("goal_canceling"))
        if response.return_code in NO_SUCH_GOAL and goal.doubt and not goal.cut.done():
            goal.cut.set_result("")  # requests the result again
        return Outcome("rejected", say("cancel_refused", time=now))

    def on_feedback(self, action: str, sample: Sample) -> None:
        """Processes the latest feedback of an action; that of other programs' goals is for tours. The
        caller refreshes the view with the next frame."""
        if self._robot.difference("AS", self._robot.key(action)):
            return
        if self._waypoints is not None:
            self._waypoints.on_feedback(action, sample)
        for goal in self._latest_goals(action):
            if self._robot.command_status[goal.widget.id].can_cancel:
                topic = self._feedback_of(goal.widget)
                topic.update(sample)
                self._apply_reading(goal, topic.reading())

    def _apply_reading(self, goal: Goal, reading: Reading) -> None:
        fields = reading.fields
        if reading.status == "message" and fields and bytes(fields.get(GOAL_ID)) == goal.id.bytes:
            self._apply_feedback(goal, fields)

    def _apply_late_reading(self, widget: str, reading: Reading) -> None:
        if (goal := self._latest.get(widget)) and self._robot.command_status[widget].can_cancel:
            self._apply_reading(goal, reading)
            self._status_set(widget)

    def _feedback_of(self, widget: Action) -> Topic:
        """The feedback topic of an action, with the fields that its widget shows."""
        if widget.id not in self._feedback:
            message = self._interfaces.action_types(widget.type).feedback_message
            shown = [*response_paths(widget.feedback), *filter(None, [widget.progress])]
            self._feedback[widget.id] = Topic(
                self._interfaces.field_reader(message, [GOAL_ID, *(FEEDBACK + path for path in shown)]),
                self._robot.slices,
                lossless=False,
                on_unreadable=partial(
                    self._robot.traffic.count_undecodable,
                    names.feedback(self._robot.key(widget.action)),
                ),
                on_late_reading=partial(self._apply_late_reading, widget.id),
            )
        return self._feedback[widget.id]

    def on_status(self, action: str, sample: Sample) -> None:
        """Processes a status message of an action; of other programs' goals it is for tours. The
        message is kept for goals that are resumed later: the robot does not repeat it."""
        self._states[action] = sample
        goals = {goal.id.bytes: goal for goal in self._latest_goals(action)}
        shown = self._waypoints is not None and self._waypoints.shows(action)
        if not (goals or shown):
            return
        message = self._decode(names.status(self._robot.key(action)), STATUS_ARRAY, sample)
        statuses = () if message is None else message.status_list
        states = {bytes(status.goal_info.goal_id.uuid): status.status for status in statuses}
        for goal_id, state in states.items():
            goal = goals.get(goal_id)
            if goal is not None and goal.advance(state):
                self._advanced(goal)
        if shown and self._waypoints is not None:
            self._waypoints.on_status(action, states)

    def _begin_waypoints(self, goal: Goal) -> None:
        if self._waypoints is not None:
            self._waypoints.begin(goal.widget, goal.id.bytes, goal.sent)

    def _is_own(self, goal_id: bytes) -> bool:
        """Whether the panel sent a goal, as far as it is tracked."""
        return any(goal_id == g.id.bytes for g in (*self._latest.values(), *self._results.goals))

    def _latest_goals(self, action: str) -> Iterator[Goal]:
        return (goal for goal in self._latest.values() if goal.widget.action == action)

    def _decode(self, key: str, type_name: str, sample: Sample) -> Any:
        """The message of a sample; None if it is not decodable."""
        try:
            return self._interfaces.decode(type_name, bytes(sample.payload))
        except DecodeError as error:
            self._robot.traffic.count_undecodable(key, sample, error)
            return None

    def _advanced(self, goal: Goal) -> None:
        """Shows a goal's new state, unless it is cut off or not tracked: the pending response will show
        it then."""
        if goal.cut.done() or goal not in self._results.goals:
            return
        if goal.is_running:
            self._confirm_running(goal)
            self._show(goal, goal.running_status)
        elif goal.doubt:
            self._show(goal, goal.doubt_status)

    def _confirm_running(self, goal: Goal) -> None:
        """The goal is running. Corrects the receipt if that was unknown."""
        self._begin_waypoints(goal)
        if goal.doubt or not self._robot.command_status[goal.widget.id].busy:
            goal.doubt = ""
            answer = Outcome("accepted", say("goal_still_in_progress", time=format_time(time.time())))
            goal.correct(answer)

    def _apply_feedback(self, goal: Goal, message: Fields) -> None:
        goal.apply_feedback(message, self._robot.texts)
        if goal.doubt and goal.advance(EXECUTING):
            self._advanced(goal)
        self._set_status(
            goal, goal.running_status
        )  # shown with the next frame: feedback may be frequent

    def _cut_off(self, goal: Goal, why: TextLike) -> None:
        """The goal may still be running on the robot. No other goal is sent until that is known."""
        self._show_doubt(goal, why)
        goal.correct(Outcome("unknown", why))

    def _show_doubt(self, goal: Goal, why: TextLike) -> None:
        goal.doubt = why
        self._show(goal, goal.doubt_status)

    def _finish(self, goal: Goal, answer: Outcome) -> None:
        """Shows a goal's result, or that it is unknown, and corrects the receipt."""
        goal.doubt = ""
        if self._waypoints is not None:
            self._waypoints.finish(
                goal.widget.action, goal.id.bytes, goal.state or UNKNOWN, goal.missed
            )
        self._show(goal, goal.end_status(answer))
        goal.correct(answer)

    def _show(self, goal: Goal, progress: CommandStatus) -> None:
        if self._set_status(goal, progress):
            self._status_set(str(goal.widget.id))

    def _set_status(self, goal: Goal, progress: CommandStatus) -> bool:
        """Sets the widget's status; False if the widget shows a newer goal."""
        latest = self._latest.get(goal.widget.id) is goal
        if latest:
            self._robot.command_status[goal.widget.id] = progress
        return latest


# Recovery of goals after a restart: goals whose end is not in the operator's log are tracked again.
#
# A goal's id is made of the hash of its press's entry (`goal_id`), so the log is enough to request
# its result from the robot. Recovery sends nothing else.

LOOK_BACK_S: Final = 86_400.0
# Reasons for goals that the robot does not know: these are not tracked again. Logs of older versions
# have no codes, only these sentences.
FINAL: Final = frozenset({"goal_forgotten", "goal_not_known"})
FINAL_SENTENCES: Final = frozenset(
    {
        "The robot no longer knows this goal: what came of it is not known.",
        "The robot does not know this goal: it did not get it, or knows it no longer.",
    }
)
TODAY_S: Final = 43_200.0  # older times are shown with their date
READ_AGAIN_S: Final = 1.0


class GoalRecovery:
    """Recovers the goals of one robot. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: RobotState,
        press_log: PressLog,
        actions: GoalTracker,
        changed: Callable[[], None],
        read_again_s: float = READ_AGAIN_S,
    ) -> None:
        """`changed` is called when the status of a command has changed."""
        self._widgets = {w.id: w for w in panel.widgets() if isinstance(w, Action)}
        self._robot = robot
        self._log = RobotLog(log, robot.name)
        self._press_log = press_log
        self._actions = actions
        self._changed = changed
        self._read_again_s = read_again_s
        self._unreadable_status = IDLE  # shown while the log can't be read
        self._reading: asyncio.Task[None] | None = None

    async def start(self) -> None:
        """Returns when the goals are known. If the log can't be read, reading is retried; until then no
        goal is sent, unless the panel file makes the log optional."""
        if self._widgets and not await self._read():
            self._reading = keep_running(self._read_later, self._log, "recovering goals failed")

    async def stop(self) -> None:
        if self._reading is not None:
            self._reading.cancel()
            await asyncio.gather(self._reading, return_exceptions=True)

    async def _read_later(self) -> None:
        read = False
        while not read:
            await asyncio.sleep(self._read_again_s)
            read = await self._read()

    async def _read(self) -> bool:
        since = round((time.time() - LOOK_BACK_S) * 1000)
        try:
            presses = await self._press_log.open_presses(self._widgets, since)
        except LogError as error:
            self._show_unreadable(error.text)
            return False
        self._show(IDLE)
        for open_press, pending in presses:
            if open_press.code not in FINAL and open_press.reason not in FINAL_SENTENCES:
                self._resume(open_press, pending)
        return True

    def _show_unreadable(self, why: TextLike) -> None:
        text = say("goal_recovery_failed", why=why)
        if text != self._unreadable_status.text:
            self._log.warning("%s", text)
        self._show(CommandStatus(busy=not self._press_log.is_bypassed, outcome="unknown", text=text))

    def _show(self, progress: CommandStatus) -> None:
        """Shows a status on widgets that show no other."""
        before, self._unreadable_status = self._unreadable_status, progress
        if before == progress:
            return
        for widget in self._widgets:
            if self._robot.command_status.get(widget, IDLE) in (IDLE, before):
                self._robot.command_status[widget] = progress
        self._changed()

    def _resume(self, open_press: OpenPress, pending: PendingEntry) -> None:
        press, widget = open_press.press, self._widgets[open_press.press.widget]
        if why := self._actions.full(widget.action):
            self._log.warning("press %s: its goal is not tracked again: %s", press.press, why)
            return

        cut = asyncio.get_running_loop().create_future()
        cut.set_result("")  # until its server is offered
        at = press.at / 1000
        pressed = format_time(at) if abs(time.time() - at) < TODAY_S else format_datetime(at)
        doubt = say("goal_from_before_restart", time=pressed)
        own = goal_id(press.hash)
        self._log.info("press %s: tracking goal %s again: %s", press.press, own, doubt)
        self._actions.resume(
            Goal(
                widget,
                press.press,
                own,
                cut,
                pending.correct,
                UNKNOWN,
                open_press.accepted,
                doubt=doubt,
            )
        )
