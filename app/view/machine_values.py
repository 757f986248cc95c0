"""What the machine is doing, as the frame shows it: pure, from (display, robot, time)."""

import math
from typing import Any, Final

from app.i18n import TextLike, say
from app.panel.machine_state import MAX_DETAILS, MachineState, StateDetail
from app.robot.state import RobotState
from app.view.display_values import NOTHING, SHAPES, field_state, lamp_of, shown_value
from app.view.time_values import span_text

MINUTE_S: Final = 60.0


def machine_state(display: MachineState, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of the machine's state: those of a lamp, `since` (how long it has been so, "" where
    that was not heard) and `detail0`, `detail1`; and when time alone changes them.

    A state that is not known now has a shape and a word of its own, and never a colour. An active alarm
    with a `state` replaces what the robot says.
    """
    details, changes = _details(display, robot, now)
    if (alarmed := robot.alarmed.state) is not None:
        text, shape, colour = lamp_of(display.states, alarmed.value)
        since, until = _for_s(now - alarmed.since, now)
        shown = {"state": "live", "text": text, "shape": shape, "colour": colour, "note": ""}
        return {**shown, "since": since, **details}, min(until, changes)
    field = field_state(display, robot, now)
    text, shape, colour = lamp_of(display.states, field.value)
    since, until = _since(display, robot, now)
    if field.state != "live":
        text, shape, colour = say(f"lamp_{field.state}"), SHAPES[field.state], "none"
        since, until = "", math.inf
    shown = {"state": field.state, "text": text, "shape": shape, "colour": colour, "note": field.note}
    return {**shown, "since": since, **details}, min(field.until, until, changes)


def _since(display: MachineState, robot: RobotState, now: float) -> tuple[TextLike, float]:
    reading = robot.reading(display.topic)
    changed = reading.since.get(display.field)
    if changed is None:
        return "", math.inf
    return _for_s(max(0.0, reading.wall - changed) + max(0.0, now - reading.at), now)


def _for_s(age: float, now: float) -> tuple[TextLike, float]:
    """For how long the state has been so, and when that text changes."""
    step = 1.0 if age < MINUTE_S else MINUTE_S
    return say("machine_state_for", duration=span_text(age)), now + step - age % step


def _details(display: MachineState, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attribute → text of each detail, "" for those that the panel lacks."""
    texts: dict[str, Any] = {f"detail{number}": "" for number in range(MAX_DETAILS)}
    until = math.inf
    for number, detail in enumerate(display.details):
        texts[f"detail{number}"], changes = _detail(detail, robot, now)
        until = min(until, changes)
    return texts, until


def _detail(detail: StateDetail, robot: RobotState, now: float) -> tuple[TextLike, float]:
    """The label and the value; a dash in place of a value that is not known now."""
    field = field_state(detail, robot, now)
    value = shown_value(field.value) if field.state == "live" else NOTHING
    value = detail.words.get(str(value), value)
    if not detail.label:
        return value, field.until
    return say("machine_state_detail", label=detail.label, value=value), field.until
