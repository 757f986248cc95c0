"""Sends action goals and tracks them to their end: feedback, status, cancel, result.

A goal belongs to the robot, not to a browser: it continues when a page is closed, and every page shows
it. Wire format: ROS 2's `<action>/_action/…` topics (design.ros2.org, "Actions").
"""

import asyncio
import time
from collections.abc import Callable, Iterable, Iterator
from functools import partial
from typing import Any, Final

from app.clock import format_time
from app.commands.actions.client import CANCEL, NO_SUCH_GOAL, ActionClient
from app.commands.actions.goal import ACCEPTED, CANCELING, EXECUTING, FEEDBACK, UNKNOWN, Goal, goal_id
from app.commands.actions.results import ResultWaiter
from app.commands.press import PressHandle
from app.commands.transport import Transport
from app.errors import DecodeError
from app.i18n import TextLike, say
from app.interfaces import Fields, Interfaces, names
from app.panel.response_text import response_paths
from app.panel.widgets.service_action import Action
from app.robot.command_status import IDLE, CommandStatus, Outcome
from app.robot.sample_handlers import SampleHandler, SampleHandlers
from app.robot.state import Reading, RobotState, Sample
from app.robot.topics import Topic

STATUS: Final = "action_msgs/msg/GoalStatusArray"
GOAL_ID: Final = "goal_id.uuid"


class GoalTracker:
    """The goals of one robot. Used on the event loop only."""

    def __init__(
        self,
        interfaces: Interfaces,
        robot: RobotState,
        transport: Transport,
        changed: Callable[[], None],
    ) -> None:
        """`changed` is called when the status of a command has changed."""
        self._interfaces = interfaces
        self._robot = robot
        self._changed = changed
        self._services = ActionClient(interfaces, robot, transport)
        self._results = ResultWaiter(
            self._services, robot, cut=self._cut_off, restored=self._advanced, finished=self._finish
        )
        self._latest: dict[str, Goal] = {}  # by widget
        self._feedback: dict[str, Topic] = {}  # by widget
        self._states: dict[str, Sample] = {}  # by action: the last status message

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
        goal = Goal(widget, handle.press_id, own_id, cut, handle.correct)
        self._latest[widget.id] = goal
        self._show(goal, CommandStatus(busy=True, text=say("call_waiting")))
        answer = self._services.goal_response(goal, await self._services.reply(goal, query))
        if answer.outcome != "rejected":
            goal.advance(ACCEPTED if answer.outcome == "accepted" else UNKNOWN)
            self._results.begin(goal)
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
        """Processes the latest feedback of an action. Feedback of other programs' goals is ignored. The
        caller refreshes the view with the next frame."""
        if self._robot.difference("AS", self._robot.key(action)):
            return
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
            self._changed()

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
        """Processes a status message of an action. Goals of other programs are ignored. The message is
        kept for goals that are resumed later: the robot does not repeat it."""
        self._states[action] = sample
        goals = {goal.id.bytes: goal for goal in self._latest_goals(action)}
        if not goals:
            return
        message = self._decode(names.status(self._robot.key(action)), STATUS, sample)
        for status in () if message is None else message.status_list:
            goal = goals.get(bytes(status.goal_info.goal_id.uuid))
            if goal is not None and goal.advance(status.status):
                self._advanced(goal)

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
        if goal.doubt or not self._robot.command_status[goal.widget.id].busy:
            goal.doubt = ""
            answer = Outcome("accepted", say("goal_still_in_progress", time=format_time(time.time())))
            goal.correct(answer)

    def _apply_feedback(self, goal: Goal, message: Fields) -> None:
        goal.apply_feedback(message)
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
        self._show(goal, goal.end_status(answer))
        goal.correct(answer)

    def _show(self, goal: Goal, progress: CommandStatus) -> None:
        if self._set_status(goal, progress):
            self._changed()

    def _set_status(self, goal: Goal, progress: CommandStatus) -> bool:
        """Sets the widget's status; False if the widget shows a newer goal."""
        latest = self._latest.get(goal.widget.id) is goal
        if latest:
            self._robot.command_status[goal.widget.id] = progress
        return latest
