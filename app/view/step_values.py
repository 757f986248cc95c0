"""What a step shows: pure, from (widget, robot, time)."""

from typing import Any

from app.panel.values import number_text
from app.panel.widgets.step import Step
from app.permission.interlocks import reported_value
from app.robot.state import RobotState
from app.view.display_values import NOTHING, field_state, written_number


def step(widget: Step, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state`, `text` (the reported value) and `note`; `step_up` and `step_down`, the
    values that the keys publish, "" where they publish none; and when they change."""
    field = field_state(widget.value, robot, now)
    base, verdict = reported_value(widget, robot, now)
    attributes = {
        "state": field.state,
        "text": NOTHING if field.value is None else written_number(field.value, widget.format),
        "note": field.note,
        "step_up": _target(widget, base, 1),
        "step_down": _target(widget, base, -1),
    }
    return attributes, min(field.until, verdict.until)


def _target(widget: Step, base: float | None, steps: int) -> str:
    target = None if base is None else widget.target(base, steps)
    return "" if target is None else number_text(float(target))
