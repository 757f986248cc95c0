"""How far it is with what was asked of the robot: one state per widget that waits for an answer."""

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
    """`busy` while an answer is awaited; then `outcome` and `text` say what came of it.

    `fraction` (0 to 1) is how far an action is, None where it does not say; `stoppable` while a
    cancel makes sense, and then `press` is the id of the press that the goal came from; `goal` is the
    goal's state by its name in action_msgs/msg/GoalStatus.
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
    """What came of a call or a goal; `text` is a sentence for the operator."""

    outcome: OutcomeCode
    text: TextLike


OnCorrection = Callable[[str, Outcome], None]  # (press id, what is known of it now)
FinalCheck = Callable[
    [], None
]  # right before it is sent; raises PressRefused where it no longer may be


def no_check() -> None:
    """Of what nobody has to permit."""
