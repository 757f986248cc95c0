"""What a log shows beside its lines, which each browser asks for: pure, from (widget, robot)."""

import math
from typing import Any

from app.i18n import say
from app.panel.widgets.log_view import LogView
from app.permission.mismatches import topic_mismatch
from app.robot.state import RobotState


def log(widget: LogView, robot: RobotState) -> tuple[dict[str, Any], float]:
    """Attributes: `state`, `note` and `count`, the number of all lines that came."""
    count = robot.log_lines[robot.key(widget.topic)].count
    shown: dict[str, Any] = {"state": "live", "note": "", "count": str(count)}
    if mismatch := topic_mismatch("MS", widget, robot):
        shown |= {"state": "unreadable", "note": mismatch.reason or ""}
    elif not robot.link_up or not robot.graph.peers:
        shown |= {"state": "old", "note": say("rosout_no_connection")}
    elif not count:
        shown |= {"state": "waiting", "note": say("readout_waiting", topic=widget.topic)}
    return shown, math.inf
