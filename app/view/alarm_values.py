"""What widgets with alarms show: pure, from (widget, robot)."""

import math
from collections.abc import Mapping
from typing import Any, Final

from app.alarms.shown import more_text
from app.i18n import TextLike, say
from app.panel.widgets.alarm_views import AlarmLineView, AlarmListView
from app.robot.alarmed import NO_SELECTION
from app.robot.state import RobotState

LINE_KEYS: Final = (
    "id", "priority", "priority_text", "known", "occurrence", "since_text", "text", "action",
)  # fmt: skip
ROW_KEYS: Final = (
    *LINE_KEYS, "state", "state_text", "acknowledged", "group", "follows_text", "value_text",
    "limit_text", "acts", "shelf", "out_of_service",
)  # fmt: skip
# The act of a row's button: what is to be done first.
ROW_ACTS: Final[Mapping[str, TextLike]] = {
    "acknowledge": say("alarm_acknowledge"),
    "reset": say("alarms_reset"),
}


def alarm_line(widget: AlarmLineView, robot: RobotState) -> tuple[dict[str, Any], float]:
    """Attributes: `state`, and `alarms` with `line`, `standing` and `unacknowledged`."""
    shown = robot.alarm_selections.get(widget.id, NO_SELECTION)
    line = shown.line and {key: shown.line[key] for key in LINE_KEYS}
    counts = {"standing": shown.standing, "unacknowledged": shown.unacknowledged}
    return {"state": "live", "alarms": {"line": line, **counts}}, math.inf


def alarm_list(widget: AlarmListView, robot: RobotState) -> tuple[dict[str, Any], float]:
    """Attributes: `state`, and `alarms` with `rows`, each with the `act` of its button and its
    `act_text`, "" without one; `more` says how many are not shown."""
    shown = robot.alarm_selections.get(widget.id, NO_SELECTION)
    firsts = {row["follows"] for row in shown.rows}
    rows = [_row(row, row["id"] in firsts) for row in shown.rows[: widget.lines]]
    more = shown.more + len(shown.rows) - len(rows)
    return {"state": "live", "alarms": {"rows": rows, "more": more_text(more)}}, math.inf


def _row(row: Mapping[str, Any], is_first: bool) -> dict[str, Any]:
    act = next((act for act in ROW_ACTS if act in row["acts"]), "")
    shown = {key: row[key] for key in ROW_KEYS}
    return {**shown, "first": is_first, "act": act, "act_text": ROW_ACTS.get(act, "")}
