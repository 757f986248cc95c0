"""Times, ages and durations as text, and for how long a result is shown. Pure."""

import math
from typing import Any, Final

from app.panel.times import DEFAULT_FORMATS, TIME_FORMATS
from app.records.entry import GOOD_OUTCOMES, CommandStatus
from app.ros.messages.field_path import EARLIEST_S
from app.system.clock import format_age, format_datetime, format_time
from app.system.texts import Text, TextLike, number, say

# Times, ages and durations as text: pure, total over all numbers.

# 1000-01-02 to 9999-12-29: every language and time zone can write these.
EARLIEST: Final = -30_610_137_600.0
LATEST: Final = 253_402_041_600.0
FUTURE_S: Final = 1.0  # a stamp that is so far ahead is one of the future, not of another clock
DAY_S: Final = 86_400
AGE_DAYS_S: Final = 2 * DAY_S  # from here on an age is in days
LONGEST_S: Final = 1e13  # a longer duration is written as a number


def time_style(style: str | None, value: Any) -> str:
    """How a value is written as a time: "time", "age" or "duration"; "" where it is none."""
    if style in TIME_FORMATS:
        return style or ""
    return DEFAULT_FORMATS.get(getattr(type(value), "__msgtype__", ""), "")


def stamp_seconds(value: Any) -> float | None:
    """The seconds of a `builtin_interfaces` Time or Duration; None for any other value."""
    if getattr(type(value), "__msgtype__", "") in DEFAULT_FORMATS:
        return float(value.sec + value.nanosec / 1e9)
    return None


def time_text(style: str, seconds: float, wall: float) -> tuple[TextLike, float]:
    """The text, and the seconds after which it changes; `wall` is the robot's time in seconds, NaN
    where times can't be compared with it (`RobotClock.time_at`)."""
    if style == "duration":
        return duration_text(seconds), math.inf
    if seconds == 0:
        return say("time_unset"), math.inf
    if not EARLIEST <= seconds <= LATEST:  # NaN neither
        return say("time_beyond"), math.inf
    if style == "time":
        return format_datetime(seconds), math.inf
    if math.isnan(wall) or seconds < EARLIEST_S <= wall:
        return say("time_other"), math.inf
    return _age(wall - seconds), _age_changes_in(wall - seconds)


def _age(age: float) -> TextLike:
    if age < -FUTURE_S:
        return say("age_future", age=_age(-age))
    if age >= AGE_DAYS_S:
        return say("age_days", number=int(age // DAY_S))
    return format_age(max(age, 0.0))


def _age_changes_in(age: float) -> float:
    step = 1 if abs(age) < 60 else 60
    return (step - age % step) or step


def span_text(seconds: float) -> TextLike:
    """How long something has lasted, in whole seconds below a minute, else in minutes."""
    minutes = int(seconds // 60)
    if not minutes:
        return format_age(seconds)
    hours, minutes = divmod(minutes, 60)
    if not hours:
        return format_age(seconds)
    return say("duration_hours", hours=hours, minutes=f"{minutes:02}")


def duration_text(seconds: float) -> TextLike:
    """A duration in seconds, with its two largest units."""
    if seconds < 0:
        return say("duration_negative", duration=duration_text(-seconds))
    if not seconds < LONGEST_S:
        text = "NaN" if math.isnan(seconds) else f"{seconds:.6g}"
        return say("duration_seconds", number=number("Infinity" if text == "inf" else text))
    if seconds < 60:
        return say("duration_seconds", number=number(f"{seconds:.3g}"))
    minutes, rest = divmod(int(seconds), 60)
    if minutes < 60:
        return say("duration_minutes", minutes=minutes, seconds=f"{rest:02}")
    hours, minutes = divmod(minutes, 60)
    if hours < 24:
        return say("duration_hours", hours=hours, minutes=f"{minutes:02}")
    days, hours = divmod(hours, 24)
    return say("duration_days", days=days, hours=hours)


# How long the result of a press is shown: pure, from (status, the time when it was set, time).

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
    return text if _says_time(text) else say("result_at", said=text, time=format_time(wall))


def _says_time(text: object) -> bool:
    """Whether a result says when it was: in its sentence, in one of several, or in the one that a
    further text follows, such as the robot's reply."""
    if not isinstance(text, Text):
        return False
    about = dict(text.params)
    parts = about.get("parts", ())
    several = parts if isinstance(parts, tuple) else ()
    return "time" in about or _says_time(about.get("said")) or any(map(_says_time, several))
