"""What bars of joints show: pure, from (widget, robot, time)."""

import math
from typing import Any, Final

from app.i18n import TextLike, number, say
from app.panel.values import number_text
from app.panel.widgets.joints import Joint, Joints
from app.robot.state import RobotState
from app.view.display_values import NOTHING, FieldOf, FieldState, field_state, is_nan, written_number
from app.view.gauge_values import is_beyond

# From the hardest: beyond the mechanical range, beyond a soft limit, near one.
LEVELS: Final = ("low_low", "high_high", "low", "high", "missing", "near")


def joints(widget: Joints, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of bars, and when they change.

    `state` and `note` are of the message; `said` names the joint with the hardest level, and how many
    more have one. Of each joint in their order: `joint_values` (texts without unit), `joint_bars`
    (percent of the range, None where unknown) and `joint_levels` ("normal", "near", "low" and "high"
    beyond a soft limit, "low_low" and "high_high" beyond the range, "missing", "" where unknown).
    """
    fields = [field_state(_field(widget, joint), robot, now) for joint in widget.joints]
    whole = _whole(fields)
    shown = [_joint(widget, *pair, whole) for pair in zip(widget.joints, fields, strict=True)]
    values, bars, levels, words = zip(*shown, strict=True)
    attributes = {
        "state": whole.state,
        "note": say("joint_none") if whole.state == "missing" else whole.note,
        "said": _hardest(levels, words),
        "joint_values": list(values),
        "joint_bars": list(bars),
        "joint_levels": list(levels),
    }
    return attributes, min(field.until for field in fields)


def _whole(fields: list[FieldState]) -> FieldState:
    """The state of the widget: live while a joint is, as several nodes may publish parts of an arm."""
    known = [field for field in fields if field.state != "missing" and not is_nan(field.value)]
    return next((field for field in known if field.state == "live"), known[0] if known else fields[0])


def _field(widget: Joints, joint: Joint) -> FieldOf:
    return FieldOf(widget.topic, widget.type, widget.qos, widget.path(joint), widget.max_age_s)


def _joint(
    widget: Joints, joint: Joint, field: FieldState, whole: FieldState
) -> tuple[TextLike, float | None, str, TextLike]:
    """Its value, its bar, its level and what is said of that."""
    label = joint.shown_label
    if field.state == "missing":
        return say("joint_missing"), None, "missing", say("joint_is_missing", joint=label)
    if field.value is None:
        return NOTHING, None, "", ""
    value = field.value * joint.shown_unit.factor
    text = written_number(value, widget.format)
    if math.isnan(value):
        return text, None, "missing", say("joint_not_a_number", joint=label)
    if field.state != "live" and whole.state == "live":
        return text, None, "missing", say("joint_is_old", joint=label, note=field.note)
    if field.state != "live":
        return text, joint.percent(value), "", ""
    level, limit = _level(joint, value)
    words = (
        say(f"joint_{level}", joint=label, limit=number(number_text(limit)))
        if level != "normal"
        else ""
    )
    return text, joint.percent(value), level, words


def _level(joint: Joint, value: float) -> tuple[str, float]:
    """The hardest level of a value, and the limit that it is beyond or near."""
    for level, limit in (("low_low", joint.min), ("high_high", joint.max)):
        if is_beyond(value, limit, below=level == "low_low"):
            return level, limit
    for level, soft in (("low", joint.low), ("high", joint.high)):
        if soft is not None and is_beyond(value, soft, below=level == "low"):
            return level, soft
    for soft in (joint.low, joint.high):
        if soft is not None and abs(value - soft) < joint.near:
            return "near", soft
    return "normal", 0.0


def _hardest(levels: tuple[str, ...], words: tuple[TextLike, ...]) -> TextLike:
    states = sorted(
        (LEVELS.index(level), number) for number, level in enumerate(levels) if level in LEVELS
    )
    if not states:
        return ""
    first = words[states[0][1]]
    return first if len(states) == 1 else say("joint_more", first=first, number=len(states) - 1)
