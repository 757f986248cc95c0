"""The options of a select that the robot has: what they are now, and the lock while they are not known.
Pure, from (select, robot, time)."""

from typing import NamedTuple

from app.i18n import number
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.robot_options import MOST, RobotOptions
from app.permission.mismatches import topic_mismatch
from app.permission.verdict import Verdict, locked
from app.robot.state import RobotState


class OptionsNow(NamedTuple):
    """The texts that may be chosen, none where they are not known; `verdict` locks then."""

    texts: tuple[str, ...]
    verdict: Verdict


def options_now(select: SelectInput, source: RobotOptions, robot: RobotState, now: float) -> OptionsNow:
    """The options at `now` (monotonic seconds): those of the newest message, each once."""
    reading = robot.reading(source.topic)
    if topic_mismatch("MS", source, robot) is not None or reading.status != "message":
        return OptionsNow((), locked("options_unknown", label=select.label))
    listed = reading.value(source.field)
    texts = tuple(dict.fromkeys(text for text in listed or () if text))[:MOST]
    if not texts:
        return OptionsNow((), locked("options_empty", label=select.label))
    if source.max_age_s is None:
        return OptionsNow(texts, Verdict(True))
    stale_at = reading.at + source.max_age_s
    if now >= stale_at:
        limit = number(f"{source.max_age_s:g}")
        return OptionsNow((), locked("options_old", label=select.label, limit=limit))
    return OptionsNow(texts, Verdict(True, until=stale_at))


def options_verdict(widget_id: str, robot: RobotState, now: float) -> Verdict | None:
    """The lock of a command whose message has a choice that is not known now, or until when all are
    known; None for a command without such a choice."""
    verdicts = [
        options_now(select, select.options_from, robot, now).verdict
        for select in robot.selects.get(widget_id, ())
        if select.options_from is not None
    ]
    return min(verdicts, key=lambda verdict: (verdict.permitted, verdict.until)) if verdicts else None
