"""What gauges, figures and bars of joints show: pure, from (widget, robot, time)."""

import math
from typing import Any, Final

from app.cell.robot.state import RobotState
from app.cell.view.displays import (
    NOTHING,
    FieldOf,
    FieldState,
    field_state,
    is_nan,
    is_number,
    shown_value,
    written_number,
)
from app.panel.numbers import brief, scaling_beside, shown_number
from app.panel.values import number_text
from app.panel.widgets.gauge import (
    MAX_LINES,
    VALUE,
    Figure,
    FigureLine,
    Gauge,
    SetpointField,
    TargetField,
)
from app.panel.widgets.joints import Joint, Joints
from app.system.texts import PanelText, TextLike, number, say
from app.system.texts.text import filled_in, together

NEAR: Final = 1e-6  # relative: a float32 is the nearest to a limit, not the limit itself
# The limits of a gauge, the most severe first, and the levels of a joint, with their sentences.
LIMIT_SENTENCES: Final = {
    "low_low": "gauge_low_low",
    "high_high": "gauge_high_high",
    "low": "gauge_low",
    "high": "gauge_high",
}
BEYOND_SENTENCES: Final = {"below": "gauge_below", "above": "gauge_above"}
JOINT_SENTENCES: Final = {
    "low_low": "joint_low_low",
    "high_high": "joint_high_high",
    "low": "joint_low",
    "high": "joint_high",
    "near": "joint_near",
}

Attributes = dict[str, Any]


def gauge(widget: Gauge, robot: RobotState, now: float) -> tuple[Attributes, float]:
    """Attributes of a gauge, and when they change.

    `state`, `text` (the number) and `note`; `level` is the limit that it is beyond, "abnormal" outside
    the normal range, or "normal"; `said` names that limit, `target` the set-point. `pointer` and
    `setpoint` are in percent of the scale, None where they are unknown; `beyond` is "below" or "above"
    for a value beyond the scale.
    """
    field = field_state(widget, robot, now)
    target, set_at, until = _setpoint(widget, robot, now)
    shown = _shown(widget, field) | {"target": target, "setpoint": set_at}
    return shown, min(field.until, until)


def _shown(widget: Gauge, field: FieldState) -> Attributes:
    shown: Attributes = {"state": field.state, "note": field.note, "text": NOTHING, "said": ""}
    shown |= {"level": "", "pointer": None, "beyond": ""}
    if field.value is None:
        return shown
    value = shown_number(widget, field.value)
    if math.isnan(value):  # also infinity times zero
        return shown | {"state": "unreadable", "note": say("gauge_no_number")}
    text = written_number(brief(value) if widget.format is None else value, widget.format)
    shown |= {"text": text, "pointer": widget.percent(value)}
    if value < widget.min or value > widget.max:
        shown["beyond"] = "below" if value < widget.min else "above"
    if field.state == "live":
        shown["level"], shown["said"] = _level(widget, value)
        if shown["beyond"] and shown["level"] in ("normal", "abnormal"):
            shown["level"], shown["said"] = "abnormal", say(BEYOND_SENTENCES[shown["beyond"]])
    return shown


def _level(widget: Gauge, value: float) -> tuple[str, TextLike]:
    """The strictest limit that a value is beyond, and what is said of it."""
    for name, sentence in LIMIT_SENTENCES.items():
        limit = getattr(widget, name)
        if limit is not None and is_beyond(value, limit, below=name.startswith("low")):
            return name, say(sentence, limit=written_number(limit, widget.format))
    low, high = widget.normal or (-math.inf, math.inf)
    for limit, below in ((low, True), (high, False)):
        if is_beyond(value, limit, below=below):
            code = "gauge_below_normal" if below else "gauge_above_normal"
            return "abnormal", say(code, limit=written_number(limit, widget.format))
    return "normal", ""


def is_beyond(value: float, limit: float, *, below: bool) -> bool:
    """Whether a value is on the wrong side of a limit; at the limit it is not."""
    if math.isclose(value, limit, rel_tol=NEAR, abs_tol=0.0):
        return False
    return value < limit if below else value > limit


def _setpoint(widget: Gauge, robot: RobotState, now: float) -> tuple[TextLike, float | None, float]:
    """What is said of the set-point, where it is on the scale, and when that changes."""
    if widget.setpoint is None:
        return "", None, math.inf
    if not isinstance(widget.setpoint, SetpointField):
        written = written_number(widget.setpoint, widget.format)
        return say("gauge_setpoint", value=written), widget.percent(widget.setpoint), math.inf
    field = field_state(widget.setpoint, robot, now)
    scaling = scaling_beside(widget, widget.setpoint)
    value = math.nan if field.value is None else shown_number(scaling, field.value)
    if math.isnan(value):
        return say("gauge_setpoint_unknown"), None, field.until
    written = written_number(brief(value) if widget.format is None else value, widget.format)
    if field.state != "live":
        return say("gauge_setpoint_old", value=written), None, field.until
    return say("gauge_setpoint", value=written), widget.percent(value), field.until


def figure(widget: Figure, robot: RobotState, now: float) -> tuple[Attributes, float]:
    """Attributes of a figure, and when they change: `state`, `text` (the number) and `note`; `rest`
    has the target and the unit, `part` is how far it is, in percent of the target, None where that is
    unknown; `line0` and `line1` are what stands beside the number, "" for those that it lacks."""
    field = field_state(widget, robot, now)
    value = math.nan if field.value is None else shown_number(widget, field.value)
    target, until = _target(widget, robot, now)
    lines, changes = _lines(widget, robot, now)
    shown = {
        "state": field.state,
        "text": NOTHING if field.value is None else written_number(value, widget.format),
        "note": field.note,
        "rest": _rest(widget, target),
        "part": _part(value, target),
        **lines,
    }
    return shown, min(field.until, until, changes)


def _target(widget: Figure, robot: RobotState, now: float) -> tuple[float | None, float]:
    """The target, None where there is none, NaN where it is not known now."""
    if not isinstance(widget.target, TargetField):
        return widget.target, math.inf
    field = field_state(widget.target, robot, now)
    known = field.state == "live" and is_number(field.value)
    scaling = scaling_beside(widget, widget.target)
    shown = float(shown_number(scaling, field.value)) if known else math.nan
    return shown, field.until


def _rest(widget: Figure, target: float | None) -> TextLike:
    if target is None:
        return widget.unit
    if math.isnan(target):
        return say("figure_target", target=together([f"{NOTHING} ", widget.unit]))
    whole = int(target) if target.is_integer() else target
    style = None if widget.format == "d" else widget.format
    return say("figure_target", target=written_number(whole, style, widget.unit))


def _part(value: float, target: float | None) -> float | None:
    if target is None or not target > 0 or math.isnan(value):
        return None
    return round(100 * min(max(value / target, 0.0), 1.0), 1)


def _lines(widget: Figure, robot: RobotState, now: float) -> tuple[Attributes, float]:
    shown: Attributes = {f"line{place}": "" for place in range(MAX_LINES)}
    until = math.inf
    for place, line in enumerate(widget.lines):
        shown[f"line{place}"], changes = _line(line, robot, now)
        until = min(until, changes)
    return shown, until


def _line(line: FigureLine, robot: RobotState, now: float) -> tuple[TextLike, float]:
    """The text with its value; a dash in place of one that is not known now."""
    field = field_state(line, robot, now)
    value: TextLike = NOTHING
    if field.state == "live" and not is_nan(field.value):
        is_written = is_number(field.value)
        value = (
            written_number(shown_number(line, field.value), line.format)
            if is_written
            else shown_value(field.value, robot.texts)
        )

    def fill(text: str) -> TextLike:
        before, _, after = text.partition(VALUE)
        return together([before, value, after])

    text = filled_in(line.text, fill) if isinstance(line.text, PanelText) else fill(line.text)
    return text, field.until


# From the worst: beyond the mechanical range, beyond a soft limit, near one.
LEVELS: Final = ("low_low", "high_high", "low", "high", "missing", "near")


def joints(widget: Joints, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of bars, and when they change.

    `state` and `note` are of the message; `said` names the joint with the worst level, and how many
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
        "said": _worst(levels, words),
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
    level, limit = _joint_level(joint, value)
    words = (
        say(JOINT_SENTENCES[level], joint=label, limit=number(number_text(limit)))
        if level != "normal"
        else ""
    )
    return text, joint.percent(value), level, words


def _joint_level(joint: Joint, value: float) -> tuple[str, float]:
    """The worst level of a value, and the limit that it is beyond or near."""
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


def _worst(levels: tuple[str, ...], words: tuple[TextLike, ...]) -> TextLike:
    states = sorted(
        (LEVELS.index(level), number) for number, level in enumerate(levels) if level in LEVELS
    )
    if not states:
        return ""
    first = words[states[0][1]]
    return first if len(states) == 1 else say("joint_more", first=first, number=len(states) - 1)
