"""What the forms of the editor know of keys beyond their schema: their section, their name, what an id
refers to. A table is named as the reference names it, a widget's by its kind."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from app.panel.roles import ROLES
from app.panel.widgets.displays import Readout
from app.panel.widgets.families import Command, Input, PressCommand
from app.panel.widgets.kinds import KINDS
from app.panel.widgets.service_action import Action
from app.system.texts import TextLike, say

Tables = Mapping[str, Any]

# Sections in their order: the code of the title, and the keys. A section without keys has all others.
REST: Final = ()


class SectionKeys(NamedTuple):
    """A section of a form: the code of its title, and its keys in their order."""

    title: str
    keys: tuple[str, ...]


_LABEL: Final = SectionKeys(
    "form_section_label", ("label", "show_label", "title", "name", "text", "note", "icon", "size")
)
_VALUE: Final = SectionKeys("form_section_value", REST)
_PEOPLE: Final = SectionKeys(
    "form_section_people",
    ("interlock", "needs", "confirm_press", "confirm_edit", "confirm_act", "consequence", "robot"),
)
_PLACE: Final = SectionKeys("form_section_place", ("span", "rows", "grow", "columns"))
SECTIONS: Final[tuple[SectionKeys, ...]] = (_LABEL, _VALUE, _PEOPLE, _PLACE)
# Of commands: their locks are what people look for first.
SECTIONS_OF_COMMANDS: Final = (_LABEL, _VALUE, _PEOPLE._replace(title="form_section_lock"), _PLACE)
SECTIONS_BY_TABLE: Final[Mapping[str, tuple[SectionKeys, ...]]] = {
    "alarm": (
        SectionKeys(
            "form_section_limits",
            (
                *("high_high", "high", "low", "low_low", "deadband", "on_delay_s", "off_delay_s"),
                *("priority", "critical_priority"),
            ),
        ),
        SectionKeys("form_section_text", ("text",)),
        SectionKeys("form_section_to_do", ("cause", "action", "consequence", "picture")),
        _VALUE,
        SectionKeys(
            "form_section_alarm_people",
            ("ack", "ack_command", "ack_input", "inhibits", "confirm_act", "needs", "robot"),
        ),
    ),
    "interlock": (
        SectionKeys("form_section_label", ("label", "locked", "action", "help")),
        _VALUE,
        SectionKeys("form_locks", ("robot", "needs")),
    ),
    "condition": (SectionKeys("form_section_label", ("label", "action")), _VALUE),
    "panel": (
        SectionKeys("form_section_label", ("title", "language", "languages", "stop_hint", "texts")),
        SectionKeys("form_section_contents", ("page", "frame", "state", "oee")),
        SectionKeys(
            "form_section_robot",
            (
                *("mode", "distro", "dialect", "namespace", "domain", "interfaces", "robot", "source"),
                *("demo_story", "demo_heals_s", "demo"),
            ),
        ),
        SectionKeys(
            "form_section_rules",
            (
                *("interlock", "condition", "alarm", "alarms", "recipe", "access", "control", "log"),
                *("record", "diagnostics", "embed", "site", "press_expires_s"),
            ),
        ),
        SectionKeys(
            "form_section_look",
            (
                *("theme", "text_size", "hand", "keyboard", "screens", "screen", "brand", "font"),
                *("pictures", "mm_per_px", "display_hz"),
            ),
        ),
        SectionKeys("form_section_map", ("place", "zone", "zone_file")),
        SectionKeys("form_section_value", REST),
    ),
}

# Shown although the file does not have them. Others are folded until they are set or required.
COMMON: Final = frozenset(
    {
        *("label", "title", "name", "text", "note", "icon", "role", "source", "topic", "service"),
        *("action", "node", "parameter", "type", "field", "unit", "format", "min", "max", "step"),
        *("low_low", "low", "high", "high_high", "normal", "target", "setpoint", "segments"),
        *("states", "options", "options_from", "pen", "steps", "recovery", "current", "column"),
        *("joint", "line", "detail", "message", "request", "goal", "reported", "on", "off", "value"),
        *("interlock", "needs", "confirm_press", "consequence", "span", "rows", "columns", "robot"),
        *("max_age_s", "default", "window", "on_message", "off_message", "on_request", "off_request"),
        *("deadband", "on_delay_s", "off_delay_s", "priority", "critical_priority", "cause", "group"),
        *("picture", "ack", "inhibits", "locked", "help", "equals", "widget", "page", "frame", "state"),
        *("language", "languages", "mode", "distro", "theme", "screens", "alarm", "alarms", "recipe"),
        *("condition", "access", "control", "log", "demo", "src", "conditions", "fields", "readback"),
        *("x", "y", "yaw", "points", "kind", "shape", "colour", "connect", "namespace", "dialect"),
        *("map", "places", "layer", "rate_hz", "x_axis", "y_axis", "across", "along", "layers"),
        *("range", "values", "period_s", "open", "groups", "required", "days", "topics", "logo"),
        *("before_s", "after_s", "sound", "lamp", "words", "fault", "reliability", "durability"),
        *("depth", "demo_story", "stop_hint", "screen", "brand", "record", "success"),
        *("progress", "fit", "overview", "publishers", "require_publisher", "keep", "idle_s"),
        *("stale_s", "when"),
    }
)  # fmt: skip

# Keys that stand beside another in its row, by that key.
BESIDE: Final[Mapping[str, str]] = {
    "unit": "format",
    "min": "max",
    "scale": "offset",
    "on_delay_s": "off_delay_s",
    "target": "segments",
    "before_s": "after_s",
    "x": "y",
    "days": "size_mb",
    "across": "along",
    "span": "rows",
}
BESIDE_BY_TABLE: Final[Mapping[str, Mapping[str, str]]] = {
    "alarm": {
        "high_high": "critical_priority",
        "high": "priority",
        "low": "priority",
        "low_low": "critical_priority",
        "on_delay_s": "off_delay_s",
        "unit": "format",
        "scale": "offset",
    },
}
# Of an alarm: what raises it in place of limits.
RAISED_BY: Final = ("when", "list", "diagnostics", "node", "lost", "stale_s")
LIMITS: Final = ("high_high", "high", "low", "low_low")
# Of an alarm with limits: keys that say nothing where something else raises it.
ONLY_WITH_LIMITS: Final = (
    *LIMITS,
    *("deadband", "critical_priority", "source", "topic", "type", "field", "unit", "format"),
    *("scale", "offset", "max_age_s", "qos"),
)
# Texts that people write in several lines.
LONG_TEXTS: Final = frozenset({"action", "cause", "consequence", "help", "stop_hint", "locked"})

# Tables with a form of their own, opened from a list; other tables are within the form that has them.
OPENED: Final = frozenset(
    {
        *("page", "group", "frame", "state", "oee", "alarm", "alarms", "interlock", "condition"),
        *("source", "recipe", "robot", "place", "zone", "zone_file", "access", "control", "log"),
        *("record", "diagnostics", "embed", "site", "screen", "brand", "font", "demo", "texts"),
    }
)

# The names of the keys that people meet most; others are named as the file names them.
NAMES: Final[Mapping[str, str]] = {
    "ack": "form_key_ack",
    "action": "form_key_action",
    "cause": "form_key_cause",
    "colour": "form_key_colour",
    "columns": "form_key_columns",
    "confirm_press": "form_key_confirm_press",
    "consequence": "form_key_consequence",
    "deadband": "form_key_deadband",
    "default": "form_key_default",
    "field": "form_key_field",
    "format": "form_key_format",
    "group": "form_key_group",
    "grow": "form_key_grow",
    "high": "form_key_high",
    "high_high": "form_key_high_high",
    "icon": "form_key_icon",
    "id": "form_key_id",
    "inhibits": "form_key_inhibits",
    "interlock": "form_key_interlock",
    "kind": "form_key_kind",
    "label": "form_key_label",
    "line": "form_key_line",
    "locked": "form_key_locked",
    "low": "form_key_low",
    "low_low": "form_key_low_low",
    "max": "form_key_max",
    "max_age_s": "form_key_max_age_s",
    "message": "form_key_message",
    "min": "form_key_min",
    "needs": "form_key_needs",
    "node": "form_key_node",
    "normal": "form_key_normal",
    "note": "form_key_note",
    "off_delay_s": "form_key_off_delay_s",
    "on_delay_s": "form_key_on_delay_s",
    "options": "form_key_options",
    "page": "form_key_page",
    "picture": "form_key_picture",
    "priority": "form_key_priority",
    "robot": "form_key_robot",
    "role": "form_key_role",
    "rows": "form_key_rows",
    "scale": "form_key_scale",
    "segments": "form_key_segments",
    "service": "form_key_service",
    "shape": "form_key_shape",
    "source": "form_key_source",
    "span": "form_key_span",
    "states": "form_key_states",
    "step": "form_key_step",
    "target": "form_key_target",
    "text": "form_key_text",
    "title": "form_key_title",
    "topic": "form_key_topic",
    "type": "form_key_type",
    "unit": "form_key_unit",
    "value": "form_key_value",
    "widget": "form_key_widget",
}
# The names of keys that say something else of a command.
NAMES_OF_COMMANDS: Final[Mapping[str, str]] = {
    "interlock": "form_key_locked_unless",
    "needs": "form_key_pressed_by",
    "consequence": "form_key_press_does",
}
# The words of tables with tabs and lists of their own.
TABLE_NAMES: Final[Mapping[str, str]] = {
    "alarm": "form_table_alarm",
    "condition": "form_table_condition",
    "frame": "form_table_frame",
    "group": "form_table_group",
    "interlock": "form_table_interlock",
    "page": "form_table_page",
    "panel": "form_table_panel",
    "place": "form_table_place",
    "recipe": "form_table_recipe",
    "robot": "form_table_robot",
    "source": "form_table_source",
    "state": "form_table_state",
    "widget": "form_table_widget",
    "zone": "form_table_zone",
}
PRIORITIES: Final[Mapping[int, str]] = {
    1: "alarm_priority_1",
    2: "alarm_priority_2",
    3: "alarm_priority_3",
    4: "alarm_priority_4",
}
ROLE_NAMES: Final[Mapping[str, str]] = {
    "viewer": "role_viewer",
    "operator": "role_operator",
    "maintenance": "role_maintenance",
    "engineer": "role_engineer",
}
# The unit that a key's name ends with.
UNITS: Final[Mapping[str, str]] = {
    "_s": "s",
    "_hz": "Hz",
    "_px": "px",
    "_mb": "MB",
    "mm_per_px": "mm/px",
}
# Numbers in the unit of the value that their table shows.
IN_THE_UNIT: Final = frozenset(
    {
        *("min", "max", "step", "low_low", "low", "high", "high_high", "deadband", "target"),
        *("setpoint", "normal", "near", "default"),
    }
)


def key_name(key: str, table: str = "") -> TextLike:
    """The name of a key in the form of a table."""
    if is_command(table) and key in NAMES_OF_COMMANDS:
        return say(NAMES_OF_COMMANDS[key])
    return say(NAMES[key]) if key in NAMES else _plain_name(key)


def is_command(table: str) -> bool:
    """Whether it is the table of a widget with which people act on the robot."""
    kind = KINDS.get(table)
    return kind is not None and issubclass(kind.model, Command)


def table_name(table: str) -> TextLike:
    """The name of a table in a tab, a list or a button."""
    return say(TABLE_NAMES[table]) if table in TABLE_NAMES else _plain_name(table)


def unit_of(key: str) -> str:
    """The unit that the name of a key says; "" for none."""
    return next((unit for ending, unit in UNITS.items() if key.endswith(ending)), "")


def _plain_name(key: str) -> str:
    bare = next((key.removesuffix(end) for end in UNITS if end[0] == "_" and key.endswith(end)), key)
    words = bare.replace("_", " ")
    return words[:1].upper() + words[1:]


# What ids refer to.


class Named(NamedTuple):
    """Something that an id names: its `id`, and the text that a person knows it by."""

    id: str
    text: TextLike = ""


Names = Callable[[Tables], Iterator[Named]]


def widgets(tables: Tables) -> Iterator[tuple[tuple[str | int, ...], Mapping[str, Any]]]:
    """(path, table) of each widget of the pages and of the frame."""
    for p, page in enumerate(list_of(tables.get("page"))):
        for w, widget in enumerate(list_of(page.get("widget"))):
            yield ("page", p, "widget", w), widget
        for g, group in enumerate(list_of(page.get("group"))):
            for w, widget in enumerate(list_of(group.get("widget"))):
                yield ("page", p, "group", g, "widget", w), widget
    frame = tables.get("frame")
    for w, widget in enumerate(list_of(frame.get("widget") if isinstance(frame, dict) else None)):
        yield ("frame", "widget", w), widget


def list_of(value: Any) -> Sequence[Mapping[str, Any]]:
    """The tables of a list; others are a fault of their own."""
    return [each for each in value if isinstance(each, dict)] if isinstance(value, list) else []


def plain(value: Any, language: str = "en") -> str:
    """A text of the file in one language."""
    if isinstance(value, dict):
        return str(value.get(language) or next(iter(value.values()), ""))
    return value if isinstance(value, str) else ""


def title_of(table: Mapping[str, Any], language: str = "en") -> str:
    """How a person calls a table: its id, else its title, label, text or value."""
    for key in ("id", "same", "title", "label", "text", "name", "regular", "file", "topic", "field"):
        if text := plain(table.get(key), language):
            return text
    return plain(table.get("value")) or (str(table["value"]) if "value" in table else "")


def _listed(*keys: str) -> Names:
    def names(tables: Tables) -> Iterator[Named]:
        for key in keys:
            for table in list_of(tables.get(key)):
                if isinstance(table.get("id"), str):
                    shown = plain(table.get("label") or table.get("title") or table.get("text"))
                    yield Named(table["id"], shown or plain(table.get("name")))

    return names


def _widgets_of(*families: type) -> Names:
    def names(tables: Tables) -> Iterator[Named]:
        for _, table in widgets(tables):
            kind = KINDS.get(str(table.get("kind")))
            if isinstance(table.get("id"), str) and kind and issubclass(kind.model, families):
                yield Named(table["id"], plain(table.get("label")))

    return names


def _maps(tables: Tables) -> Iterator[Named]:
    for _, table in widgets(tables):
        if table.get("kind") == "map" and isinstance(table.get("id"), str):
            yield Named(table["id"], plain(table.get("label")))


def _levels(tables: Tables) -> Iterator[Named]:
    for _, table in widgets(tables):
        for level in list_of(table.get("level")):
            if isinstance(level.get("id"), str):
                yield Named(level["id"], plain(level.get("label")))


def _roles(tables: Tables) -> Iterator[Named]:
    yield from (Named(role, say(ROLE_NAMES[role])) for role in ROLES)
    access = tables.get("access")
    groups = access.get("groups") if isinstance(access, dict) else None
    yield from (Named(group) for group in (groups if isinstance(groups, list) else ()) if group)


def _alarm_groups(tables: Tables) -> Iterator[Named]:
    groups = (plain(alarm.get("group")) for alarm in list_of(tables.get("alarm")))
    yield from (Named(group) for group in dict.fromkeys(filter(None, groups)))


def _words_of_the_state(tables: Tables) -> Iterator[Named]:
    state = tables.get("state")
    for row in list_of(state.get("states") if isinstance(state, dict) else None):
        yield Named(str(row.get("value", "")), plain(row.get("text")))


# What a form offers, by "table.key", or by the key alone; `references.py` has each key with ids.
REFERENCES: Final[Mapping[str, Names]] = {
    "interlock": _listed("interlock"),
    "condition": _listed("interlock", "condition"),
    "conditions": _listed("interlock", "condition"),
    "fault": _listed("interlock", "condition"),
    "source": _listed("source"),
    "robot": _listed("robot"),
    "link.page": _listed("page"),
    "map": _maps,
    "place_widget.places": _listed("place"),
    "tour.places": _listed("place"),
    "tour.action": _widgets_of(Action),
    "sequence.alarms": _listed("alarm"),
    "recipe.fields": _widgets_of(Input),
    "alarm.ack_command": _widgets_of(PressCommand),
    "alarm.ack_input": _widgets_of(Input),
    "alarm.inhibits": _widgets_of(Command),
    "alarm.state": _words_of_the_state,
    "site.figures": _widgets_of(Readout),
    "state.stops": _words_of_the_state,
    "state.effects": _listed("interlock", "condition", "alarm"),
    "alarm_list.group": _alarm_groups,
    "alarm_line.group": _alarm_groups,
    "same": _widgets_of(object),
    "needs": _roles,
    **{
        f"{table}.level": _levels for table in ("place", "zone", "zone_file", "layer", "plan", "routes")
    },
}


def references(table: str, key: str) -> Names | None:
    """What the ids of a key refer to; None where it has no ids."""
    if table == "panel":
        return None
    return REFERENCES.get(f"{table}.{key}") or REFERENCES.get(key)
