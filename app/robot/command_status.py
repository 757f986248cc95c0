"""The status of the latest command of each widget."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

from app.i18n import TextLike

OutcomeCode = Literal[
    "published",
    "confirmed",
    "accepted",
    "succeeded",
    "rejected",
    "canceled",
    "aborted",
    "timed_out",
    "refused",
    "unknown",
]


@dataclass(frozen=True, slots=True)
class CommandStatus:
    """`busy` while a response is awaited; then `outcome` and `text` are the result.

    `fraction` (0 to 1) is an action's progress, None if unknown. `can_cancel` is true while a goal can
    be canceled; `press` is then the id of its press. `goal` is the goal's state, named as in
    action_msgs/msg/GoalStatus.
    """

    busy: bool = False
    outcome: OutcomeCode | Literal[""] = ""
    text: TextLike = ""
    fraction: float | None = None
    can_cancel: bool = False
    goal: str = ""
    press: str = ""


IDLE = CommandStatus()


@dataclass(frozen=True, slots=True)
class Outcome:
    """The result of a call or a goal; `text` is a sentence for the operator."""

    outcome: OutcomeCode
    text: TextLike


OnCorrection = Callable[[Outcome], None]  # called with the new outcome of a press
FinalCheck = Callable[
    [], None
]  # called right before sending; raises PressRefused if no longer permitted


def no_check() -> None:
    """The check of a message that needs no permission."""
