"""What a camera shows beside its picture: pure, from (widget, robot, time)."""

import math
from typing import Any

from app.clock import age_changes_at, format_age, format_time
from app.i18n import say
from app.panel.widgets.camera import Camera
from app.permission.mismatches import topic_mismatch
from app.robot.state import RobotState


def camera(widget: Camera, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` and `note`; and when they change. Unknown while no browser shows it."""
    received = robot.camera_topics.get(robot.key(widget.topic))
    mismatch = topic_mismatch("MS", widget, robot)
    unrouted = robot.traits.sentences.unrouted  # the peer forwards it while a browser shows it
    if mismatch and mismatch.code != unrouted:
        return {"state": "unreadable", "note": mismatch.reason or ""}, math.inf
    if received is None or received.at == -math.inf:
        return {"state": "waiting", "note": say("camera_waiting", topic=widget.topic)}, math.inf
    if received.problem:
        return {"state": "unreadable", "note": received.problem}, math.inf
    if now - received.at < widget.max_age_s:
        shown = {"state": "live", "note": ""}
        return shown, received.at + widget.max_age_s
    note = say("camera_old", age=format_age(now - received.at), time=format_time(received.wall))
    return {"state": "old", "note": note}, age_changes_at(received.at, now)
