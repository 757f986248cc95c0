"""What a gauge shows: pure, from (widget, robot, time)."""

import math
from typing import Any, Final

from app.i18n import TextLike, say
from app.panel.widgets.gauge import Gauge, SetpointField
from app.robot.state import RobotState
from app.view.display_values import NOTHING, FieldState, field_state, scaled, written_number

NEAR: Final = 1e-6  # relative: a float32 is the nearest to a limit, not the limit itself
BY_SEVERITY: Final = ("low_low", "high_high", "low", "high")

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
    value = scaled(widget, field.value)
    if math.isnan(value):  # also infinity times zero
        return shown | {"state": "unreadable", "note": say("gauge_no_number")}
    shown |= {"text": written_number(value, widget.format), "pointer": widget.percent(value)}
    if value < widget.min or value > widget.max:
        shown["beyond"] = "below" if value < widget.min else "above"
    if field.state == "live":
        shown["level"], shown["said"] = _level(widget, value)
        if shown["beyond"] and shown["level"] in ("normal", "abnormal"):
            shown["level"], shown["said"] = "abnormal", say(f"gauge_{shown['beyond']}")
    return shown


def _level(widget: Gauge, value: float) -> tuple[str, TextLike]:
    """The hardest limit that a value is beyond, and what is said of it."""
    for name in BY_SEVERITY:
        limit = getattr(widget, name)
        if limit is not None and is_beyond(value, limit, below=name.startswith("low")):
            return name, say(f"gauge_{name}", limit=written_number(limit, widget.format))
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
    value = math.nan if field.value is None else scaled(widget, field.value)
    if math.isnan(value):
        return say("gauge_setpoint_unknown"), None, field.until
    written = written_number(value, widget.format)
    if field.state != "live":
        return say("gauge_setpoint_old", value=written), None, field.until
    return say("gauge_setpoint", value=written), widget.percent(value), field.until
