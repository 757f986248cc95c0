"""How long the result of a press is shown: pure, from (status, the time when it was set, time)."""

import math
from typing import Any, Final

from app.clock import format_time
from app.i18n import Text, TextLike, say
from app.robot.command_status import GOOD_OUTCOMES, CommandStatus

AGED_S: Final = 10.0  # then it looks old, and has its time
GOOD_S: Final = 60.0  # so long a good result is shown: what the robot reports now counts more
BAD_S: Final = 600.0  # so long any other one; the operator's log keeps all


def result_age(
    status: CommandStatus, set_at: tuple[float, float], now: float
) -> tuple[dict[str, Any], float]:
    """The attributes that differ from those of a new result, and when (monotonic seconds) time alone
    changes them. `set_at` is when it was set: monotonic seconds, and seconds since the epoch."""
    if status.busy or not status.text:
        return {}, math.inf
    since, wall = set_at
    gone_at = since + (GOOD_S if status.outcome in GOOD_OUTCOMES else BAD_S)
    if now >= gone_at:
        return {"result": "", "outcome": ""}, math.inf
    if now < since + AGED_S:
        return {}, since + AGED_S
    return {"result": _dated(status.text, wall), "aged": True}, gone_at


def _dated(text: TextLike, wall: float) -> TextLike:
    """The text, with its time if it does not say it itself."""
    if isinstance(text, Text) and any(name == "time" for name, _ in text.params):
        return text
    return say("result_at", said=text, time=format_time(wall))
