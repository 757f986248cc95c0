"""The newest values of a trend's pens: pure, from (widget, robot, time)."""

import math
from typing import Any

from app.i18n import TextLike, joined, say
from app.panel.widgets.trend import Pen, Trend
from app.robot.state import RobotState
from app.view.display_values import FieldState, field_state, is_nan, readout


def trend(widget: Trend, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` and `note`, those of the pens that are not live; `text0`, `state0` and so on
    of each pen, where a value beyond its limits is "low" or "high"; `fault` of the disk. And when they
    change."""
    shown: dict[str, Any] = {}
    state, until = "live", math.inf
    notes: list[TextLike] = []
    for number, (pen, readout_widget) in enumerate(zip(widget.pens, widget.readouts, strict=True)):
        field = field_state(readout_widget, robot, now)
        until = min(until, field.until)
        if is_nan(field.value) and field.state == "live":
            notes.append(say("trend_pen", label=pen.label, note=field.note))
        elif field.state != "live":
            state = field.state if state == "live" else state
            notes.append(say("trend_pen", label=pen.label, note=field.note))
        shown[f"text{number}"] = readout(readout_widget, robot, now)[0]["text"]
        shown[f"state{number}"] = _state(pen, field)
    note = joined(dict.fromkeys(notes))
    fault = robot.history.fault if widget.disk else ""
    return {"state": state, "note": note, "fault": fault, **shown}, until


def _state(pen: Pen, field: FieldState) -> str:
    if field.state != "live" or not isinstance(field.value, int | float):
        return field.state
    if is_nan(field.value):
        return "unreadable"
    value = pen.shown(field.value)
    if pen.low is not None and value < pen.low:
        return "low"
    return "high" if pen.high is not None and value > pen.high else "live"
