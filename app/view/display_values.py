"""What readouts and lamps show: pure, from (widget, robot, time)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Final, Literal

from app.clock import format_age, format_time
from app.i18n import PanelText, TextLike, number, say
from app.i18n.values import with_unit
from app.panel.values import same_value
from app.panel.widgets.displays import Indicator, Readout
from app.panel.widgets.families import Display
from app.permission.interlocks import topic_mismatch
from app.printable import printable
from app.robot.state import RobotState

LONGEST_TEXT: Final = 200  # characters of a value that a readout shows
LONGEST_NUMBER: Final = 32  # a larger one has an exponent, whatever its format
NOTHING: Final = "—"

State = Literal["waiting", "live", "old", "unreadable", "missing"]
SHAPES: Final = {"waiting": "waiting", "old": "old", "unreadable": "unreadable", "missing": "waiting"}


@dataclass(frozen=True, slots=True)
class FieldState:
    """What is known of a field: its `value`, if there is one; `until` (monotonic seconds) is when time
    alone changes it."""

    state: State
    note: TextLike
    value: Any = None
    until: float = math.inf


def field_state(widget: Display, robot: RobotState, now: float) -> FieldState:
    """What is known of a widget's field at `now`."""
    topic = widget.topic
    if doubt := topic_mismatch("MS", widget, robot):
        return FieldState("unreadable", doubt.reason or "")
    reading = robot.reading(topic)
    if reading.status == "unreadable":
        return FieldState("unreadable", say("readout_unreadable", topic=topic, wanted=widget.type))
    if reading.fields is None:
        return FieldState("waiting", say("readout_waiting", topic=topic))
    time = format_time(reading.wall)
    value = reading.value(widget.field)
    if value is None:
        code = "readout_several" if reading.is_ambiguous(widget.field) else "readout_missing"
        return FieldState("missing", say(code, field=widget.field, time=time))
    seen = FieldState("live", say("readout_time", time=time), value)
    if reading.status == "cut":
        return replace(seen, state="old", note=say("readout_cut", time=time))
    if widget.max_age_s is None:
        return seen
    old = now - reading.at
    if old < widget.max_age_s:
        return replace(seen, until=reading.at + widget.max_age_s)
    step = 1 if old < 60 else 60
    until = reading.at + (old // step + 1) * step
    return replace(seen, state="old", note=say("readout_old", age=format_age(old)), until=until)


def value(widget: Display, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of any display: `state`, `text` (its value as it is) and `note`; and when they
    change."""
    seen = field_state(widget, robot, now)
    return {"state": seen.state, "text": shown_value(seen.value), "note": seen.note}, seen.until


def readout(widget: Readout, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a readout: `state`, `text` and `note`; and when they change."""
    seen = field_state(widget, robot, now)
    text = NOTHING if seen.value is None else _value(widget, seen.value, robot)
    return {"state": seen.state, "text": text, "note": seen.note}, seen.until


def indicator(widget: Indicator, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a lamp: `state`, `text`, `shape`, `colour` and `note`; and when they change.

    What is not known now has a shape and a text of its own, and never a colour.
    """
    seen = field_state(widget, robot, now)
    text, shape, colour = _lamp(widget, seen.value)
    note = seen.note
    if seen.state != "live":
        if seen.state == "old":
            note = say("lamp_was", text=text, note=note)
        text, shape, colour = say(f"lamp_{seen.state}"), SHAPES[seen.state], "none"
    shown = {"state": seen.state, "text": text, "shape": shape, "colour": colour, "note": note}
    return shown, seen.until


def _lamp(widget: Indicator, value: Any) -> tuple[TextLike, str, str]:
    for state in widget.states:
        if same_value(state.value, value):
            return state.text, state.shape, state.colour
    return say("lamp_unknown", value=shown_value(value)), "unknown", "none"


def _value(widget: Readout, value: Any, robot: RobotState) -> TextLike:
    if widget.constants is not None:
        return _constant(widget.constants, robot.constants(widget), value)
    if not is_number(value):
        return written(value)
    if (widget.scale, widget.offset) != (1.0, 0.0):
        value = value * widget.scale + widget.offset
    text = written(value)
    if widget.format is not None and math.isfinite(value):
        text = _formatted(value, widget.format)
    return number(text, widget.unit)


def _formatted(value: float, given: str) -> str:
    text = format(value, given)  # "inf%" where a percentage is larger than any float
    return text if len(text) <= LONGEST_NUMBER and "inf" not in text else f"{value:.6g}"


def _constant(prefix: str, constants: Mapping[str, Any], value: Any) -> str:
    """The name of the constant that a value is, without the prefix where that is whole words
    of it."""
    for name, its in constants.items():
        if name.startswith(prefix) and same_value(its, value):
            return _without(prefix, name)
    return written(value)


def _without(prefix: str, name: str) -> str:
    rest = name.removeprefix(prefix)
    whole = prefix.endswith("_") or rest.startswith("_")
    return rest.lstrip("_") if whole and rest.strip("_") else name


def shown_value(value: Any, unit: str | PanelText = "") -> TextLike:
    """A field's value as its reader's language writes it, cut to what a readout can show."""
    text = written(value)
    return number(text, unit) if is_number(value) else with_unit(text, unit)


def is_number(value: Any) -> bool:
    """Whether a field's value is a number."""
    return isinstance(value, int | float) and not isinstance(value, bool)


def written(value: Any) -> str:
    """A field's value as Python and ROS write it, cut to what a readout can show; None is a value that
    is not there."""
    if value is None:
        return NOTHING
    if isinstance(value, bool):
        return "true" if value else "false"
    text = _number(value) if isinstance(value, float) else printable(str(value)[: LONGEST_TEXT + 1])
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 1] + "…"


def _number(value: float) -> str:
    """Six digits where they are enough: a float32's 0.1 is not 0.10000000149011612."""
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return f"{value:.6g}" if 1e-4 <= abs(value) < 1e6 else repr(value)
