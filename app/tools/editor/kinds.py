"""What can be added to a panel without the robot's list: kinds of widgets, groups, pages and tables,
with their names, icons and what they are for. Pure."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from app.panel.file.toml_lines import Path
from app.system.texts import Text, say
from app.tools.editor.references import OWNERS, taken_ids
from app.tools.editor.suggestions import Drop, Suggestion, drop_of, lock_by, value_of
from app.tools.scaffold.parts import id_of


@dataclass(frozen=True, slots=True)
class Kind:
    """`table` is the name by which `app/panel/reference` describes it, `name` what a person says."""

    table: str
    name: Text
    icon: str


# The widgets by what they are for, each kind once; then what is no widget.
FAMILIES: Final[Mapping[str, Sequence[Kind]]] = {
    "show": (
        Kind("readout", say("editor_kind_readout"), "hash"),
        Kind("figure", say("editor_kind_figure"), "a-large-small"),
        Kind("gauge", say("editor_kind_gauge"), "gauge"),
        Kind("indicator", say("editor_kind_indicator"), "lightbulb"),
        Kind("trend", say("editor_kind_trend"), "chart-line"),
        Kind("table", say("editor_kind_table"), "table-2"),
        Kind("joints", say("editor_kind_joints"), "bot"),
        Kind("camera", say("editor_kind_camera"), "camera"),
        Kind("map", say("editor_kind_map"), "map"),
        Kind("pallet", say("editor_kind_pallet"), "boxes"),
        Kind("sequence", say("editor_kind_sequence"), "workflow"),
        Kind("conditions", say("editor_kind_conditions"), "list-checks"),
        Kind("log", say("editor_kind_log"), "file-text"),
        Kind("alarm_list", say("editor_kind_alarm_list"), "bell"),
        Kind("alarm_line", say("editor_kind_alarm_line"), "circle-alert"),
    ),
    "enter": (
        Kind("text", say("editor_kind_text"), "type"),
        Kind("number", say("editor_kind_number"), "keyboard"),
        Kind("slider", say("editor_kind_slider"), "sliders-horizontal"),
        Kind("select", say("editor_kind_select"), "list"),
        Kind("toggle", say("editor_kind_toggle"), "toggle-left"),
        Kind("place", say("editor_kind_place"), "map-pin"),
        Kind("tour", say("editor_kind_tour"), "route"),
    ),
    "act": (
        Kind("publish", say("editor_kind_publish"), "radio"),
        Kind("call", say("editor_kind_call"), "play"),
        Kind("action", say("editor_kind_action"), "target"),
        Kind("hold", say("editor_kind_hold"), "hand"),
        Kind("step", say("editor_kind_step"), "plus"),
        Kind("switch", say("editor_kind_switch"), "power"),
        Kind("joystick", say("editor_kind_joystick"), "joystick"),
        Kind("parameter", say("editor_kind_parameter"), "settings-2"),
    ),
    "around": (
        Kind("label", say("editor_kind_label"), "message-square"),
        Kind("image", say("editor_kind_image"), "image"),
        Kind("link", say("editor_kind_link"), "link"),
    ),
    "file": (
        Kind("page", say("editor_kind_page"), "file"),
        Kind("group", say("editor_kind_group"), "square"),
        Kind("interlock", say("editor_kind_interlock"), "lock"),
        Kind("condition", say("editor_kind_condition"), "check"),
        Kind("alarm", say("editor_kind_alarm"), "bell"),
        Kind("source", say("editor_kind_source"), "antenna"),
    ),
}
NO_WIDGETS: Final = tuple(kind.table for kind in FAMILIES["file"])
PLACELESS: Final = tuple(kind for kind in NO_WIDGETS if kind != "group")  # on no page
NAMES: Final[Mapping[str, Text]] = {
    kind.table: kind.name for family in FAMILIES.values() for kind in family
}
ICONS: Final[Mapping[str, str]] = {
    kind.table: kind.icon for family in FAMILIES.values() for kind in family
}

FAMILY_NAMES: Final[Mapping[str, Text]] = {
    "show": say("editor_family_show"),
    "enter": say("editor_family_enter"),
    "act": say("editor_family_act"),
    "around": say("editor_family_around"),
    "file": say("editor_family_file"),
}


def added(kind: str, label: Any, tables: Mapping[str, Any], at: Path, on: Path | None = None) -> Drop:
    """The edits that add a table of this kind with a label. A widget is inserted `at` its place in a
    list of widgets, a group `at` its place in a page's groups, others at the end of their lists. Keys
    that it needs and that only a person knows are missing: `check` names them. An interlock locks the
    command `on`, an alarm is about the value `on`, if there is one."""
    if kind not in NO_WIDGETS:
        return drop_of(Suggestion("widget", kind, {"label": label}, kind), tables, at)
    if kind == "group":
        return Drop([{"op": "insert", "path": [*at], "value": {"title": label}}], at)
    listed = tables.get(kind, ())
    named = {"page": {"title": label}, "alarm": {"text": label}, "source": {}}
    keys = named.get(kind, {"label": label})
    value = {"id": id_of(kind, taken_ids(tables)[OWNERS[(kind,)]]), **keys}
    if kind == "alarm" and on is not None:
        value |= value_of(tables, on)
    place = (kind, len(listed))
    edits: list[Mapping[str, Any]] = [{"op": "insert", "path": [*place], "value": value}]
    if kind == "interlock" and on is not None and (lock := lock_by(tables, on, str(value["id"]))):
        edits.append(lock)
    return Drop(edits, place)


def place_near(tables: Mapping[str, Any], near: Path, page_id: str, *, group: bool = False) -> Path:
    """Where a widget is added without a pointer: behind the widget `near`, or at the end of the group
    `near`, else of the page's first group, or of the page. With `group`: where a group is added."""
    pages = [page for page in tables.get("page", ()) if isinstance(page, Mapping)]
    ids = [page.get("id") for page in pages]
    if len(near) > 1 and near[0] == "page" and isinstance(near[1], int) and near[1] < len(pages):
        number = near[1]
    else:
        number, near = (ids.index(page_id) if page_id in ids else 0), ()
    page = pages[number] if pages else {}
    groups = page.get("group", ())
    within = near[3] if len(near) > 3 and near[2] == "group" and isinstance(near[3], int) else None
    if group:
        return ("page", number, "group", len(groups) if within is None else within + 1)
    if near and near[-2] == "widget" and isinstance(near[-1], int):
        return (*near[:-1], near[-1] + 1)
    if groups:
        place = within if within is not None and within < len(groups) else 0
        return ("page", number, "group", place, "widget", len(groups[place].get("widget", ())))
    return ("page", number, "widget", len(page.get("widget", ())))
