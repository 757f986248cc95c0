"""What a panel can have of a robot's topic, service, action or parameter: the tables that a drag from
the robot's list to a page writes. Pure.

They are those of `operator-panel scaffold`, and beside each display what else can show its value, an
alarm of it, and the interlock that it may be.
"""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from math import floor, isfinite, log10
from typing import Any, Final, Literal

from app.panel.condition import COMPARISONS
from app.panel.file.toml_lines import Path
from app.panel.shared_keys import NumberKeys
from app.panel.widgets.families import Command
from app.panel.widgets.kinds import KINDS
from app.ros.graph.model import Server, SurveyedTopic
from app.ros.graph.node_services import NodeParameter
from app.ros.messages import Interfaces
from app.system.errors import InterfaceError
from app.system.texts import TextLike, say
from app.tools.editor.references import OWNERS, taken_ids
from app.tools.scaffold import widgets
from app.tools.scaffold.parts import NEGATIVE, NUMBERS, DraftWidget, Omission, id_of, label_of, permits
from app.tools.scaffold.widgets import BOOL

Where = Literal["widget", "alarm", "interlock"]
Item = SurveyedTopic | Server | NodeParameter

# The keys of a display that say which number it shows.
NUMBER_KEYS: Final = ("topic", "type", "qos", "field", "scale", "offset", "unit", "format", "max_age_s")
TREND_KEYS: Final = ("topic", "type", "qos", "field", "label", "unit", "scale", "format")
ALARM_KEYS: Final = ("topic", "type", "qos", "field", "scale", "offset", "unit", "max_age_s")
FALLS: Final = ("pressure", "vacuum", "battery", "level", "charge", "fill", "fuel", "flow")
NEAR_END: Final = 0.1  # of a scale: where an alarm begins
LEAST_DIGITS: Final = 2
MINUTES: Final = 10  # of a trend
KEPT: Final = "8h"
AGE_S: Final = 2.0
# The part of a group's columns that a new widget takes.
HALF, THIRD = 1 / 2, 1 / 3
ANY_SCALE: Final = (0, 100)
WIDE: Final = (
    *("trend", "table", "joints", "camera", "map", "pallet", "sequence", "conditions", "log"),
    *("alarm_list", "alarm_line", "label"),
)


@dataclass(frozen=True, slots=True)
class Suggestion:
    """One table, without its id, for the list `where`. `name` is the ROS name that the id is made of;
    `about` says in a reader's language with which values."""

    where: Where
    kind: str
    table: Mapping[str, Any]
    name: str
    about: TextLike = ""


@dataclass(frozen=True, slots=True)
class Suggestions:
    """All of one item, the likeliest first, or why there is none."""

    choices: Sequence[Suggestion] = ()
    why_none: str = ""


def suggestions_for(
    item: Item, interfaces: Interfaces, sample: Any = None, period_s: float | None = None
) -> Suggestions:
    """What a panel can have of an item of the robot's list. `sample` is a message of a topic;
    `period_s` are the seconds between two."""
    try:
        drafts = [*_drafts(item, interfaces, sample, period_s)]
    except InterfaceError as error:
        return Suggestions(why_none=str(error))
    choices = [
        choice
        for draft in drafts
        if isinstance(draft, DraftWidget)
        for choice in _choices(draft, _is_number(draft, interfaces))
    ]
    if isinstance(item, SurveyedTopic) and item.type == BOOL and item.publishers:
        choices.insert(0 if permits(item.name) else len(choices), _interlock(item))
    omitted = [draft.why for draft in drafts if isinstance(draft, Omission)]
    return Suggestions(choices, "" if choices else next(iter(omitted), ""))


def _drafts(
    item: Item, interfaces: Interfaces, sample: Any, period_s: float | None
) -> Iterator[DraftWidget | Omission]:
    if isinstance(item, NodeParameter):
        yield from widgets.parameter(item)
    elif isinstance(item, Server):
        make = widgets.goals if "/action/" in item.type else widgets.calls
        yield from make(item, interfaces)
    else:
        interfaces.require(item.type)
        if item.publishers:
            yield from widgets.displays(item, interfaces, sample, period_s)
        if item.subscribers:
            yield from widgets.publishers(item, interfaces, has_dds_qos=True)


def _is_number(draft: DraftWidget, interfaces: Interfaces) -> bool:
    """Whether the value of a drafted display is a number, by its type alone: it may have none yet."""
    if draft.kind == "gauge":
        return True
    if draft.kind != "readout" or "constants" in draft.keys:
        return False
    return interfaces.field_type(draft.keys["type"], draft.keys.get("field", "data")) in NUMBERS


def _choices(draft: DraftWidget, is_number: bool) -> Iterator[Suggestion]:
    """The drafted widget, and the others that fit its value. The scale of a number that was never seen
    is a guess."""
    keys = _without_size(draft.keys)
    about: TextLike = ""
    if draft.kind == "gauge":
        high = f"{keys['max']} {keys.get('unit', '')}".strip()
        about = say("editor_from_to", low=f"{keys['min']}", high=high)
    yield Suggestion("widget", draft.kind, keys, draft.name, about)
    if draft.kind == "indicator" and [state["value"] for state in keys["states"]] == [True, False]:
        yield _bool_alarm(draft, keys)
    if not is_number:
        return
    shown: dict[str, Any] = {"label": keys["label"]}
    shown |= {key: keys[key] for key in NUMBER_KEYS if key in keys}
    yield Suggestion("widget", "figure", shown, draft.name)
    if draft.kind == "gauge":
        yield Suggestion("widget", "readout", shown, draft.name)
    pen = {key: keys[key] for key in TREND_KEYS if key in keys}
    trend = {"label": keys["label"], "window": f"{MINUTES}m", "keep": KEPT, "pen": [pen]}
    yield Suggestion(
        "widget", "trend", trend, f"{draft.name}/trend", say("editor_last_minutes", minutes=10)
    )
    if draft.kind != "gauge":
        keys = {**keys, "min": ANY_SCALE[0], "max": ANY_SCALE[1]}
        about = say("editor_from_to", low=f"{keys['min']}", high=f"{keys['max']}")
        yield Suggestion("widget", "gauge", keys, draft.name, about)
    yield _limit_alarm(draft, keys)


def _without_size(keys: Mapping[str, Any]) -> dict[str, Any]:
    """In the grid of a group a widget takes one column, unless a person says more."""
    return {key: value for key, value in keys.items() if key != "span"}


def _limit_alarm(draft: DraftWidget, keys: Mapping[str, Any]) -> Suggestion:
    """An alarm near that end of the scale which is the bad one by the topic's name."""
    low, high = float(keys["min"]), float(keys["max"])
    falls = any(word in draft.name.lower() for word in FALLS)
    near = low + (high - low) * NEAR_END if falls else high - (high - low) * NEAR_END
    limit = _rounded(near, high - low)
    table = {key: keys[key] for key in ALARM_KEYS if key in keys}
    table |= {"low" if falls else "high": limit, "deadband": _rounded((high - low) * 0.02, high - low)}
    words = "low" if falls else "high"
    table |= {"priority": 3, "text": f"{keys['label']} {words}"}
    shown = f"{limit} {keys.get('unit', '')}".strip()
    about = say("editor_alarm_below" if falls else "editor_alarm_above", limit=shown)
    return Suggestion("alarm", "alarm", table, f"{draft.name}/{words}", about)


def _rounded(value: float, span: float) -> float:
    """With the digits that a scale of this length shows."""
    digits = LEAST_DIGITS - floor(log10(span)) if span > 0 and isfinite(span) else LEAST_DIGITS
    rounded = round(value, digits)
    return int(rounded) if rounded == int(rounded) else rounded


def _bool_alarm(draft: DraftWidget, keys: Mapping[str, Any]) -> Suggestion:
    """Raised while a fault is true, or while a good state is not."""
    when = {key: keys[key] for key in ("topic", "type", "qos", "field") if key in keys}
    bad = bool(NEGATIVE.search(draft.name))
    when["equals"] = bad
    text = keys["label"] if bad else f"No {str(keys['label']).lower()}"
    table = {"priority": 2, "text": text, "when": when}
    about = say("editor_alarm_while", value="true" if bad else "false")
    return Suggestion("alarm", "alarm", table, draft.name, about)


def _interlock(topic: SurveyedTopic) -> Suggestion:
    table: dict[str, Any] = {
        "label": label_of(topic.name).lower(),
        "topic": topic.name,
        "type": topic.type,
        "publishers": "one",
    }
    table |= {"require_publisher": True} if topic.latched else {"max_age_s": AGE_S}
    return Suggestion("interlock", "interlock", table, topic.name, say("editor_locks_unless_true"))


# The edits of a document that a suggestion becomes.


@dataclass(frozen=True, slots=True)
class Drop:
    """`edits` as JSON, and the place of the new table."""

    edits: Sequence[Mapping[str, Any]]
    select: Path


def drop_of(
    suggestion: Suggestion, tables: Mapping[str, Any], at: Path, on: Path | None = None
) -> Drop:
    """The edits that write a suggestion. A widget is inserted `at` its place in a list of widgets, an
    alarm and an interlock behind the others. A command is locked by the panel's only interlock. An
    interlock that is dropped `on` a command locks it; one that the file has is not written again."""
    if suggestion.where == "widget":
        own_id = id_of(suggestion.name, taken_ids(tables)["widget"])
        table = {"id": own_id, "kind": suggestion.kind, **suggestion.table}
        interlocks = tables.get("interlock", ())
        if columns := _columns_at(tables, at):
            part = 1.0 if suggestion.kind in WIDE else THIRD if is_command(table) else HALF
            table["span"] = max(1, round(columns * part))
        if len(interlocks) == 1 and is_command(table) and table.get("role") != "stop":
            table["interlock"] = interlocks[0]["id"]
        return Drop([{"op": "insert", "path": list(at), "value": table}], at)
    listed = tables.get(suggestion.where, ())
    edits: list[Mapping[str, Any]] = []
    number = _same_interlock(suggestion, listed)
    if number is None:
        number = len(listed)
        own_id = id_of(suggestion.name, taken_ids(tables)[OWNERS[(suggestion.where,)]])
        value = {"id": own_id, **suggestion.table}
        edits.append({"op": "insert", "path": [suggestion.where, number], "value": value})
    else:
        own_id = str(listed[number]["id"])
    if suggestion.where == "interlock" and on is not None and (lock := lock_by(tables, on, own_id)):
        edits.append(lock)
    return Drop(edits, (suggestion.where, number))


def _columns_at(tables: Any, at: Path) -> int:
    """The columns of the group that a place is in, where it says how many; 0 without."""
    try:
        for step in at[:-2]:
            tables = tables[step]
    except (LookupError, TypeError):
        return 0
    columns = tables.get("columns") if isinstance(tables, Mapping) else None
    return columns if isinstance(columns, int) else 0


def _same_interlock(suggestion: Suggestion, listed: Sequence[Mapping[str, Any]]) -> int | None:
    """The number of the interlock that waits for the same topic to be true."""
    if suggestion.where != "interlock":
        return None
    for number, table in enumerate(listed):
        compares = any(key in table for key in COMPARISONS)
        if table.get("topic") == suggestion.table["topic"] and not compares:
            return number
    return None


def lock_by(tables: Any, on: Path, interlock: str) -> Mapping[str, Any] | None:
    """The edit by which an interlock locks a command; None for a widget that is none, or has it."""
    widget = tables
    for step in on:
        widget = widget[step]
    if not is_command(widget):
        return None
    known = widget.get("interlock", [])
    names = [known] if isinstance(known, str) else list(known)
    if interlock in names:
        return None
    value = interlock if not names else [*names, interlock]
    return {"op": "set", "path": [*on, "interlock"], "value": value}


def value_of(tables: Any, on: Path) -> Mapping[str, Any]:
    """What the value of a widget is, as an alarm has it; empty for a widget without one."""
    widget = tables
    for step in on:
        widget = widget[step]
    kind = KINDS.get(str(widget.get("kind")))
    is_value = kind is not None and issubclass(kind.model, NumberKeys)
    return {key: widget[key] for key in ("source", *ALARM_KEYS) if key in widget} if is_value else {}


def is_command(widget: Mapping[str, Any]) -> bool:
    """Whether the table of a widget is a command's."""
    kind = KINDS.get(str(widget.get("kind")))
    return kind is not None and issubclass(kind.model, Command)
