"""What displays and controls with a reported value show: pure, from (widget, robot, time)."""

import hashlib
import json
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any, Final, Literal, NamedTuple, Protocol

from app.cell.alarms.shown import more_text
from app.cell.permission.conditions import ABSENCES
from app.cell.permission.interlocks import reported_value
from app.cell.permission.robot_options import options_now
from app.cell.permission.verdict import topic_mismatch
from app.cell.recipes.reported import reported_fields
from app.cell.robot.alarmed import NO_SELECTION
from app.cell.robot.state import Reading, RobotState
from app.cell.robot.topics import kept_s
from app.cell.view.times import stamp_seconds, time_style, time_text
from app.panel.base import HasTopic, TopicQos
from app.panel.known_values import known_value
from app.panel.numbers import Scaled, WrittenNumber, formatted, is_beyond_battery, shown_number
from app.panel.robot_texts import NO_TEXTS, RobotTexts, robot_text
from app.panel.shared_keys import stale_at
from app.panel.values import number_text, same_value
from app.panel.widgets.alarm_views import AlarmLineView, AlarmListView
from app.panel.widgets.displays import (
    Camera,
    Indicator,
    KeyLamp,
    LampState,
    LogView,
    Pallet,
    Readout,
)
from app.panel.widgets.families import Display
from app.panel.widgets.inputs import SelectInput
from app.panel.widgets.publish import Step
from app.panel.widgets.recipe_load import RecipeLoad
from app.panel.widgets.switch import Switch
from app.records.entry import IDLE
from app.system.clock import age_changes_at, format_age, format_time
from app.system.printable import readable
from app.system.texts import PanelText, Text, TextLike, number, say

# What readouts and lamps show: pure, from (widget, robot, time).

LONGEST_TEXT: Final = 200  # characters of a value that a readout shows
NOTHING: Final = "—"
NO_CONSTANTS: Final[Mapping[str, Any]] = {}

State = Literal["waiting", "live", "old", "unreadable", "missing"]
SHAPES: Final = {"waiting": "waiting", "old": "old", "unreadable": "unreadable", "missing": "waiting"}
LAMP_WORDS: Final = {
    "waiting": "lamp_waiting",
    "old": "lamp_old",
    "unreadable": "lamp_unreadable",
    "missing": "lamp_missing",
}


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
    if dated.state == "live" and is_not_finite(value):
        return replace(dated, note=say("gauge_no_number" if is_nan(value) else "number_infinite"))
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
    if mismatch := topic_mismatch("MS", widget, robot):
        return FieldState("unreadable", mismatch.reason or "")
    reading = robot.reading(widget.topic)
    if reading.status == "unreadable":
        return FieldState("unreadable", say("readout_unreadable", wanted=widget.type))
    if reading.fields is None:
        return FieldState("waiting", say("readout_waiting"))
    return reading


def _dated(reading: Reading, value: Any, max_age_s: float | None, now: float) -> FieldState:
    """The state of a received message with this value, by its age."""
    if reading.status in ("cut", "ended"):
        code = "readout_before_disconnect" if reading.status == "cut" else "readout_publisher_ended"
        return FieldState("old", say(code, time=format_time(reading.wall)), value)
    if reading.status == "foreign":
        return FieldState("old", say("readout_foreign", time=format_time(reading.wall)), value)
    until = stale_at(reading.at, max_age_s)
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
    return {
        "state": field.state,
        "text": shown_value(field.value, robot.texts),
        "note": field.note,
    }, field.until


def readout(widget: Readout, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a readout: `state`, `text` and `note`; and when they change."""
    field = field_state(widget, robot, now)
    if style := time_style(widget.format, field.value):
        reading = robot.reading(widget.topic).of_field(widget.field, math.inf)
        wall = robot.clock.time_at(reading.wall + now - reading.at)
        text, changes_in = shown_time(widget, style, field.value, wall)
        until = min(field.until, now + changes_in)
        return {"state": field.state, "text": text, "note": field.note}, until
    text = NOTHING if field.value is None else _value(widget, field.value, robot)
    state, note = number_state(widget, field)
    return {"state": state, "text": text, "note": note}, field.until


def number_state(widget: Scaled, field: FieldState) -> tuple[State, TextLike]:
    """The state and the note of a field that is shown as a number: what is not finite can't be read,
    and a charge beyond 1 is not known."""
    if field.state != "live" or not is_number(field.value):
        return field.state, field.note
    if is_beyond_battery(widget, field.value):
        return "unreadable", say("battery_beyond")
    return ("unreadable" if is_not_finite(field.value) else "live"), field.note


def shown_time(widget: WrittenNumber, style: str, value: Any, wall: float) -> tuple[TextLike, float]:
    """A value as a time, and the seconds after which its text changes."""
    seconds = stamp_seconds(value)
    if seconds is None and is_number(value):
        seconds = float(shown_number(widget, value))
    return (NOTHING, math.inf) if seconds is None else time_text(style, seconds, wall)


def indicator(
    widget: Indicator | KeyLamp, robot: RobotState, now: float
) -> tuple[dict[str, Any], float]:
    """Attributes of a lamp: `state`, `text`, `shape`, `colour` and `note`; and when they change.

    What is not known now has a shape and a text of its own, and never a colour.
    """
    field = field_state(widget, robot, now)
    text, shape, colour = lamp_of(widget.states, field.value, robot.texts)
    note = field.note
    if field.state != "live":
        if field.state == "old":
            note = say("lamp_was", text=text, note=note)
        text, shape, colour = say(LAMP_WORDS[field.state]), SHAPES[field.state], "none"
    shown = {"state": field.state, "text": text, "shape": shape, "colour": colour, "note": note}
    return shown, field.until


def lamp_of(
    states: Iterable[LampState], value: Any, texts: RobotTexts = NO_TEXTS
) -> tuple[TextLike, str, str]:
    """Text, shape and colour of a value."""
    for state in states:
        if same_value(state.value, value):
            return state.text, state.shape, state.colour
    return say("lamp_unknown", value=shown_value(value, texts)), "unknown", "none"


def _value(widget: Readout, value: Any, robot: RobotState) -> TextLike:
    is_plain = widget.constants is None and widget.format is None
    if is_plain and (known := known_value(widget.type, widget.field, value)):
        return known
    constants = NO_CONSTANTS if widget.constants is None else robot.constants(widget)
    return cell_text(widget, value, constants, robot.texts)


class WrittenValue(WrittenNumber, Protocol):
    """What is written as a readout writes it."""

    @property
    def unit(self) -> str | PanelText: ...
    @property
    def constants(self) -> str | None: ...


def cell_text(
    widget: WrittenValue, value: Any, constants: Mapping[str, Any], texts: RobotTexts
) -> TextLike:
    """A value in a format and with its unit, or as the name of one of `constants`."""
    if widget.constants is not None:
        return _constant(widget.constants, constants, value)
    if not is_number(value):
        return shown_value(value, texts)
    return written_number(shown_number(widget, value), widget.format, widget.unit)


def written_number(value: float, style: str | None = None, unit: str | PanelText = "") -> TextLike:
    """A number that is shown, in a format of the panel file, as its reader's language writes it."""
    text = written(value)
    if style is not None and math.isfinite(value):
        text = formatted(value, style)
    return number(text, unit)


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


def shown_value(value: Any, texts: RobotTexts = NO_TEXTS) -> TextLike:
    """A field's value as its reader's language writes it, cut to what a readout can show; `texts` are
    those of the panel file."""
    text = written(value)
    return number(text) if is_number(value) else robot_text(texts, value, text)


def is_not_finite(value: Any) -> bool:
    """Whether a value is NaN or infinite."""
    return isinstance(value, float) and not math.isfinite(value)


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
    value += 0.0  # no negative zero
    return f"{value:.6g}" if 1e-4 <= abs(value) < 1e6 else repr(value)


# What a step shows: pure, from (widget, robot, time).


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


# What a switch shows: pure, from (widget, robot, time).


def switch(widget: Switch, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a switch, and when they change: `state` and `note` are those of the reported field,
    `at` is "on", "off" or, where it is not known now, "", and `text` the word for it. `awaited` is the
    position of a press whose report is awaited, "" without one."""
    field = field_state(widget.reported, robot, now)
    at = widget.position(field.value) if field.state == "live" else ""
    note: TextLike = "" if at else field.note
    if field.state == "live" and not at:
        note = say("switch_other_value", value=shown_value(field.value, robot.texts))
    is_busy = robot.command_status.get(widget.id, IDLE).busy
    awaited = ("on" if robot.switched_to.get(widget.id) else "off") if is_busy else ""
    words = {"on": widget.on, "off": widget.off}
    text = words.get(at) or say("condition_unknown")
    shown = {"state": field.state, "note": note, "at": at, "text": text, "awaited": awaited}
    return shown, field.until


# What a select shows whose options the robot has: pure, from (select, robot, time).


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


# What the page of recipes shows of the robot: pure, from (the load of a set, robot, time).


def recipe(widget: RecipeLoad, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of the load of a set: `reported` changes with what the robot has, or is known to have.
    And when they change by time."""
    fields = reported_fields(widget, robot, now)
    known = {name: (field.value, str(field.why)) for name, field in fields.items()}
    text = json.dumps(known, default=str)
    until = min(field.until for field in fields.values())
    return {"reported": hashlib.sha256(text.encode()).hexdigest()[:16]}, until


# What a log shows beside its lines, which each browser asks for: pure, from (widget, robot).


def log(widget: LogView, robot: RobotState) -> tuple[dict[str, Any], float]:
    """Attributes: `state`, `note` and `count`, the number of all lines that came."""
    count = robot.log_lines[robot.key(widget.topic)].count
    shown: dict[str, Any] = {"state": "live", "note": "", "count": str(count)}
    if mismatch := topic_mismatch("MS", widget, robot):
        shown |= {"state": "unreadable", "note": mismatch.reason or ""}
    elif not robot.link_up or not robot.graph.peers:
        shown |= {"state": "old", "note": say("rosout_no_connection")}
    elif not count:
        shown |= {"state": "waiting", "note": say("readout_waiting")}
    return shown, math.inf


# What a camera shows beside its picture: pure, from (widget, robot, time).


def camera(widget: Camera, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes: `state` and `note`; and when they change. Unknown while no browser shows it."""
    received = robot.camera_topics.get(robot.key(widget.topic))
    mismatch = topic_mismatch("MS", widget, robot)
    unrouted = robot.traits.sentences.unrouted  # the peer forwards it while a browser shows it
    if mismatch and mismatch.code != unrouted:
        return {"state": "unreadable", "note": mismatch.reason or ""}, math.inf
    if received is None or received.at == -math.inf:
        return {"state": "waiting", "note": say("readout_waiting")}, math.inf
    if received.problem:
        return {"state": "unreadable", "note": received.problem}, math.inf
    until = stale_at(received.at, widget.max_age_s)
    if now < until:
        return {"state": "live", "note": ""}, until
    note = say("camera_old", age=format_age(now - received.at), time=format_time(received.wall))
    return {"state": "old", "note": note}, age_changes_at(received.at, now)


# What a plan of a pallet shows: pure, from (widget, robot, time).


def pallet(widget: Pallet, robot: RobotState, now: float) -> tuple[dict[str, Any], float]:
    """Attributes of a plan, and when they change: `state`, `note` and `text` (the layer and the place
    of the next box); `filled` is the area of the boxes in the layer, as the path of an SVG whose unit
    is a box, and `next` the place of the next box, "2 1", "" where there is none."""
    field = field_state(widget, robot, now)
    text: TextLike = NOTHING
    filled = place = ""
    if field.value is not None:
        text, filled, place = _layer(widget, int(field.value))
    shown = {"state": field.state, "note": field.note, "text": text, "filled": filled, "next": place}
    return shown, field.until


def _layer(widget: Pallet, count: int) -> tuple[TextLike, str, str]:
    places, layers, across = widget.in_layer, widget.layers, widget.across
    if count >= places * layers:
        return say("pallet_full"), f"M0 0H{across}V{widget.along}H0z", ""
    layer, on_it = divmod(max(count, 0), places)
    rows, boxes = divmod(on_it, across)
    filled = f"M0 0H{across}V{rows}H0z" if rows else ""
    filled += f"M0 {rows}H{boxes}V{rows + 1}H0z" if boxes else ""
    text = say("pallet_layer", layer=layer + 1, layers=layers, place=on_it + 1, places=places)
    return text, filled, f"{boxes} {rows}"


# What widgets with alarms show: pure, from (widget, robot).

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
    """Attributes: `state`, and `alarms` with `line` and how many there are."""
    shown = robot.alarm_selections.get(widget.id, NO_SELECTION)
    line = shown.line and {key: shown.line[key] for key in LINE_KEYS}
    counts = {
        "standing": shown.standing,
        "active": shown.active,
        "unacknowledged": shown.unacknowledged,
    }
    return {"state": "live", "alarms": {"line": line, **counts}}, math.inf


def alarm_list(widget: AlarmListView, robot: RobotState) -> tuple[dict[str, Any], float]:
    """Attributes: `state`, and `alarms` with `rows`, each with the `act` of its button and its
    `act_text`, "" without one. `more` says how many are not shown; `below` the same where the last
    row, the last two and so on are out of sight."""
    shown = robot.alarm_selections.get(widget.id, NO_SELECTION)
    firsts = {row["follows"] for row in shown.rows}
    rows = [_row(row, row["id"] in firsts) for row in shown.rows[: widget.lines]]
    more = shown.more + len(shown.rows) - len(rows)
    hidden = range(1, len(rows) + 1)
    hidden = range(1, len(rows) + 1)
    below = [say("alarms_below", count=number(str(count + more))) for count in hidden]
    alarms = {"rows": rows, "more": more_text(more), "below": below}
    return {"state": "live", "alarms": alarms}, math.inf


def _row(row: Mapping[str, Any], is_first: bool) -> dict[str, Any]:
    act = next((act for act in ROW_ACTS if act in row["acts"]), "")
    shown = {key: row[key] for key in ROW_KEYS}
    return {**shown, "first": is_first, "act": act, "act_text": ROW_ACTS.get(act, "")}
