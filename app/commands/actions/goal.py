"""One goal of an action: its state, and the command status that its widget shows. Pure.

States and their order: action_msgs/msg/GoalStatus.
"""

import asyncio
import math
import uuid
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from app.commands.service_calls import with_fields
from app.i18n import TextLike, joined, say
from app.interfaces import Fields
from app.panel.widgets.service_action import Action
from app.robot.command_status import CommandStatus, OnCorrection, Outcome, OutcomeCode

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
    """A goal that was sent. `state` is None until it is known; `known` is true once the robot has
    reported the goal.

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
    known: bool = False
    doubt: TextLike = ""
    feedback_text: TextLike = ""
    fraction: float | None = None
    greatest: float = 0.0  # value of a progress that falls

    def advance(self, state: int) -> bool:
        """Sets a later state; False if the goal has this or a later state already."""
        if state not in range(len(NAMES)) or (self.state is not None and state <= self.state):
            return False
        self.state = state
        self.known = self.known or state != UNKNOWN
        return True

    def apply_feedback(self, message: Fields) -> None:
        """Updates feedback text and progress from a feedback message."""
        widget = self.widget
        if widget.progress is not None:
            progress = message.get(FEEDBACK + widget.progress)
            done = math.nan if progress is None else self._done(float(progress))
            self.fraction = min(1.0, max(0.0, done)) if done == done else None  # NaN is no progress
        self.feedback_text = with_fields(widget.feedback, message, FEEDBACK)

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
