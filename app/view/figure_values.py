"""What a figure shows: pure, from (widget, robot, time)."""

import math
from typing import Any

from app.i18n import PanelText, TextLike, say
from app.i18n.values import filled_in, together
from app.panel.widgets.figure import MAX_LINES, VALUE, Figure, FigureLine, TargetField
from app.robot.state import RobotState
from app.view.display_values import (
    NOTHING,
    field_state,
    is_number,
    scaled,
    shown_value,
    written_number,
)

Attributes = dict[str, Any]


def figure(widget: Figure, robot: RobotState, now: float) -> tuple[Attributes, float]:
    """Attributes of a figure, and when they change: `state`, `text` (the number) and `note`; `rest`
    has the target and the unit, `part` is how far it is, in percent of the target, None where that is
    unknown; `line0` and `line1` are what stands beside the number, "" for those that it lacks."""
    field = field_state(widget, robot, now)
    value = math.nan if field.value is None else scaled(widget, field.value)
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
    return float(scaled(widget, field.value)) if known else math.nan, field.until


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
    if field.state == "live":
        is_written = is_number(field.value)
        value = (
            written_number(scaled(line, field.value), line.format)
            if is_written
            else shown_value(field.value)
        )

    def fill(text: str) -> TextLike:
        before, _, after = text.partition(VALUE)
        return together([before, value, after])

    text = filled_in(line.text, fill) if isinstance(line.text, PanelText) else fill(line.text)
    return text, field.until
