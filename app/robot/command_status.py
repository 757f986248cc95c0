"""The status of the latest command of each widget."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal

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


GOOD_OUTCOMES: Final = frozenset({"published", "confirmed", "accepted", "succeeded"})


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


class CommandStatuses(dict[str, CommandStatus]):
    """The statuses by widget id. `set_at` has when each was set: monotonic seconds, and seconds since
    the epoch."""

    def __init__(
        self,
        monotonic: Callable[[], float] = time.monotonic,
        wall: Callable[[], float] = time.time,
    ) -> None:
        super().__init__()
        self.set_at: dict[str, tuple[float, float]] = {}
        self._clocks = monotonic, wall

    def __setitem__(self, widget: str, status: CommandStatus) -> None:
        if self.get(widget) != status:
            monotonic, wall = self._clocks
            self.set_at[widget] = monotonic(), wall()
        super().__setitem__(widget, status)


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
