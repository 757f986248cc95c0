"""What a camera shows beside its picture: pure, from (widget, robot, time)."""

import math
from typing import Any

from app.clock import format_age, format_time
from app.i18n import say
from app.panel.widgets.camera import Camera
from app.permission.interlocks import topic_mismatch
from app.robot.state import RobotState


def camera(widget: Camera, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` and `note`; and when they change. Nothing is known while nobody looks."""
    seen = robot.looked_at.get(robot.key(widget.topic))
    doubt = topic_mismatch("MS", widget, robot)
    if doubt and doubt.code != "unheard":  # its bridge reads it while somebody looks
        return {"state": "unreadable", "note": doubt.reason or ""}, math.inf
    if seen is None or seen.at == -math.inf:
        return {"state": "waiting", "note": say("camera_waiting", topic=widget.topic)}, math.inf
    if seen.problem:
        return {"state": "unreadable", "note": seen.problem}, math.inf
    old = now - seen.at
    if old < widget.max_age_s:
        shown = {"state": "live", "note": ""}
        return shown, seen.at + widget.max_age_s
    step = 1 if old < 60 else 60
    note = say("camera_old", age=format_age(old), time=format_time(seen.wall))
    return {"state": "old", "note": note}, seen.at + (old // step + 1) * step
