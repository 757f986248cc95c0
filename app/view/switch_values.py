"""What a switch shows: pure, from (widget, robot, time)."""

from typing import Any

from app.i18n import TextLike, say
from app.panel.widgets.switch import Switch
from app.robot.command_status import IDLE
from app.robot.state import RobotState
from app.view.display_values import field_state, shown_value


def switch(widget: Switch, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a switch, and when they change: `state` and `note` are those of the reported field,
    `at` is "on", "off" or, where it is not known now, "", and `text` the word for it. `awaited` is the
    position of a press whose report is awaited, "" without one."""
    field = field_state(widget.reported, robot, now)
    at = widget.position(field.value) if field.state == "live" else ""
    note: TextLike = "" if at else field.note
    if field.state == "live" and not at:
        note = say("switch_other_value", value=shown_value(field.value))
    is_busy = robot.command_status.get(widget.id, IDLE).busy
    awaited = ("on" if robot.switched_to.get(widget.id) else "off") if is_busy else ""
    words = {"on": widget.on, "off": widget.off}
    text = words.get(at) or say("condition_unknown")
    shown = {"state": field.state, "note": note, "at": at, "text": text, "awaited": awaited}
    return shown, field.until
