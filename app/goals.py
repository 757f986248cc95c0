"""One goal of an action: its state by its ROS name, and what is shown of it. Pure.

States and their order: action_msgs/msg/GoalStatus.
"""

import asyncio
import uuid
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final

from app.panel.model import Action
from app.progress import Answer, Outcome, Progress
from app.sentences import say

UNKNOWN: Final = 0
ACCEPTED: Final = 1
CANCELING: Final = 3
NAMES: Final = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
ENDS: Final[Mapping[int, tuple[Outcome, str]]] = {
    4: ("succeeded", "goal_succeeded"),
    5: ("canceled", "goal_canceled"),
    6: ("aborted", "goal_aborted"),
}


@dataclass(slots=True)
class Goal:
    """A goal that was sent; `state` is None until something is known of it, and `known` says
    whether the robot ever had it.

    `cut` is done when nothing more is heard of it: with a sentence, or "" for a lost connection.
    """

    widget: Action
    press_id: str
    id: uuid.UUID
    cut: "asyncio.Future[str]"
    corrected: Callable[[str, Answer], None]
    state: int | None = None
    known: bool = False
    said: str = ""
    fraction: float | None = None

    def advance(self, state: int) -> bool:
        """Takes a state; False for one that it had already: states only go on."""
        if state not in range(len(NAMES)) or (self.state is not None and state <= self.state):
            return False
        self.state = state
        self.known = self.known or state != UNKNOWN
        return True

    @property
    def lives(self) -> bool:
        """Whether the robot is known to be at it."""
        return self.state is not None and self.state != UNKNOWN and self.state not in ENDS

    @property
    def under_way(self) -> Progress:
        sentence = say("goal_canceling" if self.state == CANCELING else "goal_executing")
        text = f"{sentence} {self.said}".strip()
        return Progress(True, "accepted", text, self.fraction, True, self._name, self.press_id)

    def came_to(self, answer: Answer) -> Progress:
        """What is shown when nothing is awaited any more."""
        return Progress(outcome=answer.outcome, text=answer.text, goal=self._name)

    @property
    def _name(self) -> str:
        return "" if self.state is None else NAMES[self.state]
