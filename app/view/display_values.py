"""What readouts and lamps show: pure, from (widget, robot, time)."""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final, Literal, NamedTuple, Protocol

from app.clock import age_changes_at, format_age, format_time
from app.i18n import PanelText, Text, TextLike, number, say
from app.i18n.values import with_unit
from app.panel.base import HasTopic, TopicQos
from app.panel.values import same_value
from app.panel.widgets.displays import Indicator, LampState, Readout, WrittenNumber
from app.panel.widgets.families import Display
from app.panel.widgets.key_lamp import KeyLamp
from app.permission.conditions import ABSENCES
from app.permission.mismatches import topic_mismatch
from app.printable import readable
from app.robot.keyed_values import kept_s
from app.robot.state import Reading, RobotState
from app.view.time_values import stamp_seconds, time_style, time_text

LONGEST_TEXT: Final = 200  # characters of a value that a readout shows
LONGEST_NUMBER: Final = 32  # a larger one has an exponent, whatever its format
NOTHING: Final = "—"
NO_CONSTANTS: Final[Mapping[str, Any]] = {}

State = Literal["waiting", "live", "old", "unreadable", "missing"]
SHAPES: Final = {"waiting": "waiting", "old": "old", "unreadable": "unreadable", "missing": "waiting"}


class ShownField(HasTopic, Protocol):
    """A field of a topic: that of a display, or one of several that a widget shows."""

    @property
    def field(self) -> str: ...
    @property
    def max_age_s(self) -> float | None: ...


class FieldOf(NamedTuple):
    """One of several fields that a widget shows."""

    topic: str
    type: str
    qos: TopicQos
    field: str
    max_age_s: float | None = None


@dataclass(frozen=True, slots=True)
class FieldState:
    """The state of a field: its `value`, None if there is none; `until` (monotonic seconds) is when
    time alone changes the state."""

    state: State
    note: TextLike
    value: Any = None
    until: float = math.inf


class ShownTopic(HasTopic, Protocol):
    """A topic that is shown as a whole."""

    @property
    def max_age_s(self) -> float | None: ...


def topic_state(widget: ShownTopic, robot: RobotState, now: float) -> FieldState:
    """The state of a topic at `now`, without a value; never "missing"."""
    reading = _reading(widget, robot)
    return reading if isinstance(reading, FieldState) else _dated(reading, None, widget.max_age_s, now)


def field_state(widget: ShownField, robot: RobotState, now: float) -> FieldState:
    """The state of a field at `now`; the panel must subscribe to its topic and read the field."""
    reading = _reading(widget, robot)
    if isinstance(reading, FieldState):
        return reading
    reading = reading.of_field(widget.field, kept_s(widget.max_age_s))
    value = reading.value(widget.field)
    if value is None:
        return FieldState("missing", _missing(reading, widget.field))
    dated = _dated(reading, value, widget.max_age_s, now)
    if is_nan(value) and dated.state == "live":
        return replace(dated, note=say("gauge_no_number"))
    return dated


def _missing(reading: Reading, field: str) -> Text:
    """Why a message has no value of a field."""
    time = format_time(reading.wall)
    if (absence := reading.absence(field)) is not None:
        return say("readout_no_value", field=field, time=time, reason=ABSENCES[absence])
    code = "readout_several" if reading.is_ambiguous(field) else "readout_missing"
    return say(code, field=field, time=time)


def _reading(widget: ShownTopic, robot: RobotState) -> Reading | FieldState:
    """The last message of a topic, or why there is none that can be shown."""
    topic = widget.topic
    if mismatch := topic_mismatch("MS", widget, robot):
        return FieldState("unreadable", mismatch.reason or "")
    reading = robot.reading(topic)
    if reading.status == "unreadable":
        return FieldState("unreadable", say("readout_unreadable", topic=topic, wanted=widget.type))
    if reading.fields is None:
        return FieldState("waiting", say("readout_waiting", topic=topic))
    return reading


def _dated(reading: Reading, value: Any, max_age_s: float | None, now: float) -> FieldState:
    """The state of a received message with this value, by its age."""
    if reading.status == "cut":
        return FieldState(
            "old", say("readout_before_disconnect", time=format_time(reading.wall)), value
        )
    if reading.status == "foreign":
        return FieldState("old", say("readout_foreign", time=format_time(reading.wall)), value)
    until = math.inf if max_age_s is None else reading.at + max_age_s
    if now < until:
        return FieldState("live", _received(format_time(reading.wall)), value, until)
    note = say("readout_old", age=format_age(now - reading.at))
    return FieldState("old", note, value, age_changes_at(reading.at, now))


@lru_cache(maxsize=1000)
def _received(time: Text) -> Text:
    """The same text for all that arrived in one second."""
    return say("readout_time", time=time)


def value(widget: Display, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of any display: `state`, `text` (the plain value) and `note`; and when they change."""
    field = field_state(widget, robot, now)
    return {"state": field.state, "text": shown_value(field.value), "note": field.note}, field.until


def readout(widget: Readout, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a readout: `state`, `text` and `note`; and when they change."""
    field = field_state(widget, robot, now)
    if style := time_style(widget.format, field.value):
        reading = robot.reading(widget.topic).of_field(widget.field, math.inf)
        wall = reading.wall + now - reading.at
        text, changes_in = shown_time(widget, style, field.value, wall)
        until = min(field.until, now + changes_in)
        return {"state": field.state, "text": text, "note": field.note}, until
    text = NOTHING if field.value is None else _value(widget, field.value, robot)
    return {"state": field.state, "text": text, "note": field.note}, field.until


def shown_time(widget: WrittenNumber, style: str, value: Any, wall: float) -> tuple[TextLike, float]:
    """A value as a time, and the seconds after which its text changes."""
    seconds = stamp_seconds(value)
    if seconds is None and is_number(value):
        seconds = float(scaled(widget, value))
    return (NOTHING, math.inf) if seconds is None else time_text(style, seconds, wall)


def indicator(
    widget: Indicator | KeyLamp, robot: RobotState, now: float
) -> tuple[dict[str, Any], float]:
    """Attributes of a lamp: `state`, `text`, `shape`, `colour` and `note`; and when they change.

    What is not known now has a shape and a text of its own, and never a colour.
    """
    field = field_state(widget, robot, now)
    text, shape, colour = lamp_of(widget.states, field.value)
    note = field.note
    if field.state != "live":
        if field.state == "old":
            note = say("lamp_was", text=text, note=note)
        text, shape, colour = say(f"lamp_{field.state}"), SHAPES[field.state], "none"
    shown = {"state": field.state, "text": text, "shape": shape, "colour": colour, "note": note}
    return shown, field.until


def lamp_of(states: Iterable[LampState], value: Any) -> tuple[TextLike, str, str]:
    """Text, shape and colour of a value."""
    for state in states:
        if same_value(state.value, value):
            return state.text, state.shape, state.colour
    return say("lamp_unknown", value=shown_value(value)), "unknown", "none"


def _value(widget: Readout, value: Any, robot: RobotState) -> TextLike:
    return cell_text(
        widget, value, NO_CONSTANTS if widget.constants is None else robot.constants(widget)
    )


class WrittenValue(WrittenNumber, Protocol):
    """What is written as a readout writes it."""

    @property
    def unit(self) -> str | PanelText: ...
    @property
    def constants(self) -> str | None: ...


def cell_text(widget: WrittenValue, value: Any, constants: Mapping[str, Any]) -> TextLike:
    """A value in a format and with its unit, or as the name of one of `constants`."""
    if widget.constants is not None:
        return _constant(widget.constants, constants, value)
    if not is_number(value):
        return written(value)
    return written_number(scaled(widget, value), widget.format, widget.unit)


def scaled(widget: WrittenNumber, value: float) -> float:
    """The number that is shown for one in a message."""
    if (widget.scale, widget.offset) != (1.0, 0.0):
        return value * widget.scale + widget.offset
    return value


def written_number(value: float, style: str | None = None, unit: str | PanelText = "") -> TextLike:
    """A number that is shown, in a format of the panel file, as its reader's language writes it."""
    text = written(value)
    if style is not None and math.isfinite(value):
        text = _formatted(value, style)
    return number(text, unit)


def _formatted(value: float, style: str) -> str:
    text = format(value, style)  # "inf%" where a percentage is larger than any float
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


def is_nan(value: Any) -> bool:
    """Whether a value is a float that is not a number."""
    return isinstance(value, float) and math.isnan(value)


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
    text = _number(value) if isinstance(value, float) else _shown_text(value)
    return text if len(text) <= LONGEST_TEXT else text[: LONGEST_TEXT - 1] + "…"


def _shown_text(value: Any) -> str:
    """The beginning of a text; the codes of terminals in it are not shown."""
    return readable(str(value)[: 4 * LONGEST_TEXT])[: LONGEST_TEXT + 1]


def _number(value: float) -> str:
    """Six digits where they are enough: a float32's 0.1 is not 0.10000000149011612."""
    if not math.isfinite(value):
        return "NaN" if math.isnan(value) else "Infinity" if value > 0 else "-Infinity"
    return f"{value:.6g}" if 1e-4 <= abs(value) < 1e6 else repr(value)
