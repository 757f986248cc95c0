"""Follows the goals that lead through several poses: the panel's own, and those of other programs, of
which only the feedback and the status are published. Used where a panel has a tour."""

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from app.cell.robot.state import Reading, RobotState, Sample
from app.cell.robot.topics import Topic
from app.cell.robot.waypoints import WaypointGoal, poses_of
from app.panel.widgets.service_action import Action
from app.panel.widgets.tour import feedback_fields
from app.ros.messages import Interfaces, names

GOAL_ID: Final = "goal_id.uuid"
FEEDBACK: Final = "feedback."
UNKNOWN_END: Final = 7  # after those of action_msgs/msg/GoalStatus
FIRST_END: Final = 4  # SUCCEEDED


class WaypointTracker:
    """The newest goal of each action whose goals a tour shows, in `RobotState.waypoint_goals`. Used on
    the event loop only."""

    def __init__(
        self,
        interfaces: Interfaces,
        robot: RobotState,
        is_own: Callable[[bytes], bool],
        changed: Callable[[str], None],
    ) -> None:
        """`is_own`: whether a goal with this id was sent here. `changed` is called with the id of a
        tour that shows something else now."""
        self._robot = robot
        self._is_own = is_own
        self._changed = changed
        self._tours: dict[str, list[str]] = {}  # by action
        self._feedback: dict[str, Topic] = {}
        for tour, actions in robot.tour_actions.items():
            for action in actions:
                self._tours.setdefault(action.action, []).append(tour)
                if action.action not in self._feedback:
                    self._feedback[action.action] = self._topic(action, interfaces)

    def _topic(self, action: Action, interfaces: Interfaces) -> Topic:
        fields = feedback_fields(action.type, interfaces)
        paths = [GOAL_ID, *(FEEDBACK + name for name in fields)]
        message = interfaces.action_types(action.type).feedback_message
        return Topic(
            interfaces.field_reader(message, paths),
            self._robot.slices,
            lossless=False,
            on_unreadable=partial(
                self._robot.traffic.count_undecodable, names.feedback(self._robot.key(action.action))
            ),
            on_late_reading=partial(self._apply, action.action),
        )

    def shows(self, action: str) -> bool:
        """Whether a tour shows the goals of an action."""
        return action in self._tours

    def begin(self, widget: Action, goal_id: bytes, goal: Mapping[str, Any] | None) -> None:
        """A goal is known to run; None of one of before the server's start, whose poses are not
        known."""
        shown = self._robot.waypoint_goals.get(widget.action)
        if widget.action not in self._tours or (shown is not None and shown.id == goal_id):
            return
        listed = None if goal is None else poses_of(goal)
        poses, total = (None, 0) if listed is None else listed
        self._robot.waypoint_goals[widget.action] = WaypointGoal(
            goal_id, str(widget.id), poses, total, time.monotonic(), 0 if poses else None
        )
        self._tell(widget.action)

    def finish(self, action: str, goal_id: bytes, state: int, missed: Mapping[int, int]) -> None:
        """A goal has ended: its poses are marked. One whose poses are not known is shown no longer."""
        goal = self._robot.waypoint_goals.get(action)
        if goal is None or goal.id != goal_id or goal.end:
            return
        goal.finish(state if state >= FIRST_END else UNKNOWN_END, missed, time.monotonic())
        if goal.poses is None:
            del self._robot.waypoint_goals[action]
        self._tell(action)

    def on_feedback(self, action: str, sample: Sample) -> None:
        """Takes a feedback of any goal. The caller refreshes the view with the next frame."""
        if (topic := self._feedback.get(action)) is not None:
            topic.update(sample)
            self._apply(action, topic.reading())

    def _apply(self, action: str, reading: Reading) -> None:
        if reading.status != "message" or not reading.fields:
            return
        goal_id = bytes(reading.fields.get(GOAL_ID))
        goal = self._robot.waypoint_goals.get(action)
        if goal is None or goal.id != goal_id:
            if self._is_own(goal_id) or (goal is not None and goal.command and not goal.end):
                return  # not accepted yet, or an older one
            goal = WaypointGoal(goal_id, "", None, 0, reading.at)
            self._robot.waypoint_goals[action] = goal
        if not goal.end:
            goal.apply_feedback(reading.fields, FEEDBACK, reading.at)

    def on_status(self, action: str, states: Mapping[bytes, int]) -> None:
        """Takes the states of an action's goals: another program's goal ends so."""
        goal = self._robot.waypoint_goals.get(action)
        if goal is not None and not goal.command and (state := states.get(goal.id, 0)) >= FIRST_END:
            self.finish(action, goal.id, state, {})

    def _tell(self, action: str) -> None:
        for tour in self._tours[action]:
            self._changed(tour)
