"""The panes "Robot" and "Parts": what can be added to the panel, and adding it by a drop or a key."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any, Final, NamedTuple

from pydantic import BaseModel, Field

from app.panel.file.toml_lines import Path
from app.panel.layout import COLUMNS
from app.panel.reference.schema import WORDS
from app.system.errors import NotFound
from app.system.texts import TextLike, render, say
from app.tools.editor.document import Change, edit_from, path_from
from app.tools.editor.editor import Editor, PartRequest
from app.tools.editor.help import help_in
from app.tools.editor.kinds import FAMILIES, FAMILY_NAMES, ICONS, NAMES, PLACELESS, added, place_near
from app.tools.editor.paths import EMPTY
from app.tools.editor.paths import at as value_at
from app.tools.editor.robot_list import SECTIONS, Row, Section
from app.tools.editor.suggestions import Drop, Suggestion, drop_of, is_command

HEADINGS: Final = {
    "topics": say("editor_topics"),
    "services": say("editor_services"),
    "actions": say("editor_actions"),
    "parameters": say("editor_parameters"),
}


class RowSection(NamedTuple):
    """`about` says how many rows have a value, and how many the panel uses."""

    name: Section
    title: TextLike
    about: TextLike
    rows: Sequence[Row]


def robot_pane(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    editor = request.editor
    robots = editor.robots
    robots.look()
    rows = robots.rows(editor.preview.panel)
    sections = [
        RowSection(name, HEADINGS[name], _about(rows[name]), rows[name])
        for name in SECTIONS
        if rows[name]
    ]
    status: TextLike = ""
    if robots.robot is None:
        status = say("editor_no_robot", why=robots.fault) if robots.fault else say("editor_robot_waits")
    return "_robot.html", {
        "sections": sections,
        "status": status,
        "words": {"search": say("editor_search_robot"), "unused": say("editor_not_used")},
    }


def _about(rows: Sequence[Row]) -> TextLike:
    used = sum(bool(row.used) for row in rows)
    live = sum(bool(row.value) for row in rows)
    return say("editor_live_used", live=live, used=used) if live else str(len(rows))


def parts_pane(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    def described(table: str) -> str:
        words = WORDS["tables"]
        return help_in(str(words.get(f"{table}_widget") or words[table]), request.language)

    families = [(FAMILY_NAMES[name], kinds) for name, kinds in FAMILIES.items()]
    return "_parts.html", {
        "families": families,
        "described": described,
        "placeless": PLACELESS,
        "words": {"search": say("editor_search_parts")},
    }


def empty_pane(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """What can come at an empty place of a page: groups, or widgets."""
    _, context = parts_pane(request)
    in_page = request.path[-3] == "group"
    families = FAMILIES.items()
    shown = [
        (FAMILY_NAMES[name], [kind for kind in kinds if (kind.table == "group") == in_page])
        for name, kinds in families
        if (name == "file") == in_page
    ]
    return "_empty.html", {
        **context,
        "families": shown,
        "path": request.path,
        "words": {
            "empty": say("editor_empty_place"),
            "fill": say("editor_fill_place"),
        },
    }


class Pick(NamedTuple):
    """One line of the question how an item is shown; `number` is that of its suggestion."""

    number: int
    icon: str
    title: TextLike
    about: TextLike


def pick_pane(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """How an item of the robot's list can be shown, the likeliest first for what it is dropped `on`."""
    section, key = _item(request.query.get("section", ""), request.query.get("key", ""))
    suggestions = request.editor.robots.suggestions(section, key, request.editor.preview.panel)
    if suggestions is None:
        raise NotFound(say("editor_item_gone", name=key[:64]))
    numbered = list(enumerate(suggestions.choices))
    on = _table(request.editor, request.path)
    numbered.sort(key=lambda each: not _is_for(each[1], on))
    return "_pick.html", {
        "title": say("editor_show_as", name=key),
        "picks": [
            Pick(number, ICONS[choice.kind], NAMES[choice.kind], choice.about or _label(choice))
            for number, choice in numbered
        ],
        "why": suggestions.why_none and say("editor_none_for", name=key, why=suggestions.why_none),
    }


def _label(choice: Suggestion) -> str:
    """What it would be called: one message may have several values."""
    return str(choice.table.get("label", ""))


def _is_for(choice: Suggestion, on: Mapping[str, Any]) -> bool:
    """Whether a choice is about the widget that it is dropped on: a lock of a command, an alarm of a
    value."""
    if not on.get("kind"):
        return choice.where == "widget"
    return choice.where == ("interlock" if is_command(on) else "alarm")


class Addition(BaseModel):
    """What is added: the suggestion `choice` of an item of the robot's list, or a `kind`. `at` is its
    place among widgets or groups, without it near the path `near`, on the page `page`; `on` is the
    widget that it is dropped on, [] for none. What is added by a key is dropped on what is selected.
    `span` are the columns of an empty place, 0 for all of its group's."""

    revision: int
    section: str = ""
    key: str = ""
    choice: int = 0
    kind: str = ""
    at: list[str | int] | None = None
    near: list[str | int] | None = None
    on: list[str | int] | None = None
    span: int = Field(default=0, ge=0, le=COLUMNS)
    page: str = ""


def add(editor: Editor, addition: Addition, language: str, author: str = "") -> Change:
    """One step of the document; NotFound if the item or its choice is gone."""
    tables = editor.document.tables
    near = path_from(addition.near) if addition.near else ()
    near = near[:-3] if near[-1:] == (EMPTY,) else near
    on = near if addition.kind and addition.on is None else path_from(addition.on or ())
    dropped_on = on if _table(editor, on) else None
    if addition.kind:
        if addition.kind not in NAMES:
            raise NotFound(f'there is no kind "{addition.kind:.64}"')
        own = tables.get("language", language)
        label = render(NAMES[addition.kind], own if isinstance(own, str) else language)
        group = addition.kind == "group"
        at = path_from(addition.at) if addition.at else ()
        if at[-2:-1] != ("group" if group else "widget",):
            at = place_near(tables, near, addition.page, group=group)
        drop = added(addition.kind, label, tables, at, dropped_on)
    else:
        section, key = _item(addition.section, addition.key)
        known = editor.robots.suggestions(section, key, editor.preview.panel)
        if known is None or addition.choice not in range(len(known.choices)):
            raise NotFound(say("editor_item_gone", name=key[:64]))
        choice = known.choices[addition.choice]
        at = path_from(addition.at) if addition.at else place_near(tables, near, addition.page)
        drop = drop_of(choice, tables, at, dropped_on)
    return _applied(editor, _narrowed(drop, addition.span), addition, author)


def _narrowed(drop: Drop, span: int) -> Drop:
    """The drop with a widget of at most so many columns; 0: of any."""
    if not span or drop.select[-2:-1] != ("widget",):
        return drop
    first, *others = drop.edits
    value = {**first["value"], "span": min(span, first["value"].get("span", span))}
    return replace(drop, edits=[{**first, "value": value}, *others])


def _applied(editor: Editor, drop: Drop, addition: Addition, author: str) -> Change:
    """The change by a drop; none where the file has it already."""
    label = addition.kind or addition.key
    if not drop.edits:
        return Change(editor.document.revision, label, (), drop.select)
    change = editor.apply(map(edit_from, drop.edits), label, addition.revision, author)
    return replace(change, select=drop.select)


def _item(section: str, key: str) -> tuple[Section, str]:
    for name in SECTIONS:
        if name == section:
            return name, key
    raise NotFound(f'there is no section "{section:.64}"')


def _table(editor: Editor, path: Path) -> Mapping[str, Any]:
    """The table at a path; empty if there is none."""
    value = value_at(editor.document.tables, path)
    return value if path and isinstance(value, Mapping) else {}
