"""What a select shows whose options the robot has: pure, from (select, robot, time)."""

import math
from typing import Any

from app.panel.widgets.inputs import SelectInput
from app.permission.robot_options import options_now
from app.robot.state import RobotState
from app.view.display_values import FieldOf, field_state


def select(widget: SelectInput, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a select with `options_from`, and when they change: `options` are its texts, none
    while they are not known, and `note` says why. Those of the panel file are in the markup."""
    source = widget.options_from
    if source is None:
        return {}, math.inf
    known = options_now(widget, source, robot, now)
    if source.source is None or source.type is None:
        attributes: dict[str, Any] = {"options": list(known.texts), "note": known.verdict.reason or ""}
        return {**attributes, "state": "live" if known.texts else "missing"}, known.verdict.until
    field = FieldOf(*source.source[:3], source.field, source.max_age_s)
    shown = field_state(field, robot, now)
    note = "" if known.texts else known.verdict.reason
    if shown.state != "live" and not known.texts:
        note = shown.note
    state = "live" if known.texts else shown.state if shown.state != "live" else "missing"
    return {"options": list(known.texts), "state": state, "note": note}, min(
        known.verdict.until, shown.until
    )
