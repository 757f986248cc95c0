"""What is said of a robot's clock: pure, from (robot, time)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final, Literal

from app.cell.robot.clocks import Skew, Witness, is_other_time
from app.cell.robot.state import RobotState
from app.cell.view.times import duration_text
from app.ros.messages.field_path import EARLIEST_S
from app.system.texts import Text, TextLike, number, say

ClockWord = Literal[
    "unknown", "even", "apart", "other_time", "simulated", "simulated_paused", "simulated_awaited"
]
WITNESSES: Final[Mapping[Witness, str]] = {"peer": "clock_by_peer", "stamps": "clock_by_stamps"}
NAMED_MOST: Final = 2  # topics
LEAST_S: Final = 0.01  # nothing is measured more exactly


@dataclass(frozen=True, slots=True)
class ClockStatus:
    """The clock of one robot: `text` is how far it is from the panel's, or its simulated time, `about`
    by what that is known, `reason` what is wrong and what to do; each "" for nothing. `within_s` is how
    exact `skew_s` is, in seconds; None where it is not known, or time is simulated."""

    state: ClockWord
    text: TextLike
    about: TextLike = ""
    reason: TextLike = ""
    skew_s: float | None = None
    within_s: float | None = None


def clock_status(robot: RobotState, now: float) -> ClockStatus:
    """At `now` (monotonic seconds)."""
    clock = robot.clock
    if clock.simulated is not None:
        return _simulated(robot, now)
    if clock.skew is None:
        return ClockStatus("unknown", say("clock_unknown"))
    skew, apart = clock.skew, clock.topics_apart
    trips = robot.round_trips.summary(now)
    within_s = max(skew.spread_s, trips.least if trips else 0.0, LEAST_S)
    about = say(WITNESSES[skew.witness], within=number(f"{within_s:.2f}", "s"))
    if skew.state == "other_time" or any(map(is_other_time, apart.values())):
        return ClockStatus("other_time", say("clock_other_time"), about, say("clock_other_time_do"))
    state: ClockWord = "even" if skew.state == "even" and not apart else "apart"
    reason = _skew_reason(skew) or _apart_reason(skew, apart)
    return ClockStatus(state, skew_text(skew), about, reason, skew.seconds, within_s)


def skew_text(skew: Skew) -> Text:
    """How far a robot's clock is from the panel's."""
    if skew.state == "even":
        return say("clock_even")
    code = "clock_ahead" if skew.seconds > 0 else "clock_behind"
    return say(code, duration=duration_text(abs(skew.seconds)))


def _skew_reason(skew: Skew) -> TextLike:
    """In whole seconds: a page is not sent again for less."""
    if skew.state == "even":
        return ""
    code = "clock_ahead_do" if skew.seconds > 0 else "clock_behind_do"
    return say(code, duration=duration_text(float(round(abs(skew.seconds)))))


def _apart_reason(skew: Skew, apart: Mapping[str, float]) -> TextLike:
    """What differs most from the robot's clock."""
    if not apart:
        return ""
    most = max(abs(offset - skew.seconds) for offset in apart.values())
    duration = duration_text(float(round(most)))
    return say("clock_stamps_apart", topics=_named(apart), duration=duration)


def _named(keys: Iterable[str]) -> TextLike | tuple[TextLike, ...]:
    topics = [f"/{key}" for key in sorted(keys)]
    named, more = tuple(topics[:NAMED_MOST]), len(topics) - NAMED_MOST
    return say("and_more", names=named, number=more) if more > 0 else named


def _simulated(robot: RobotState, now: float) -> ClockStatus:
    simulated = robot.clock.simulated
    assert simulated is not None
    state = simulated.state(now)
    if state == "unknown":
        return ClockStatus("simulated_awaited", say("clock_awaited"), reason=say("clock_awaited_do"))
    seconds = simulated.seconds
    time = number(f"{seconds:.1f}", "s") if seconds < EARLIEST_S else number(f"{seconds:.0f}", "s")
    if state == "paused":
        text = say("clock_paused", time=time)
        return ClockStatus("simulated_paused", text, reason=say("clock_paused_do"))
    apart = robot.clock.topics_apart
    reason: TextLike = say("clock_stamps_not_simulated", topics=_named(apart)) if apart else ""
    return ClockStatus("simulated", say("clock_simulated", time=time), reason=reason)


def clock_note(robot: RobotState, now: float) -> TextLike:
    """What the details of the robot's link say of its clock; "" for nothing."""
    return clock_status(robot, now).reason


BANNERS: Final[Mapping[tuple[bool, str], str]] = {
    (True, "no"): "simulated",
    (False, "runs"): "simulated_time",
    (False, "paused"): "simulated_time_paused",
    (True, "runs"): "simulated_robot_time",
    (True, "paused"): "simulated_robot_time_paused",
}


def simulation_banner(robot: RobotState, now: float, *, is_simulated: bool) -> TextLike:
    """What the header says of a simulated robot, and of simulated time; "" for neither."""
    time = "no"
    if (simulated := robot.clock.simulated) is not None:
        time = "paused" if simulated.state(now) == "paused" else "runs"
    code = BANNERS.get((is_simulated, time))
    return say(code) if code else ""
