"""The editor's page and its panes: what their templates are rendered with."""

import re
import shlex
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path as FilePath
from typing import Any, Final, NamedTuple

from app.panel.file.toml_lines import Path
from app.ros.messages import Interfaces, load_interfaces
from app.system.errors import InterfaceError, NotFound, Remark
from app.system.pictures import shipped_pictures
from app.system.texts import TextLike, render, say
from app.system.texts.locales import own_name
from app.tools.editor.adding import empty_pane, parts_pane, pick_pane, robot_pane
from app.tools.editor.alarm_curve import curve_pane
from app.tools.editor.document import DiffLine
from app.tools.editor.editor import Editor, Part, PartRequest
from app.tools.editor.form_keys import list_of
from app.tools.editor.forms import (
    FormPage,
    Link,
    NoTableError,
    RobotNames,
    element_id,
    form_context,
    form_of,
    schema,
    table_path,
)
from app.tools.editor.forms import table_at as table_name_at
from app.tools.editor.merge_page import merge_page, recovered_page
from app.tools.editor.outline import outline, text_of
from app.tools.editor.paths import (
    EMPTY,
    at,
    kind_of,
    path_at,
    path_of,
    table_at,
    tag_of,
    title_of,
    widget_paths,
)
from app.tools.editor.places import page_of, places_on
from app.tools.editor.repairs import Repair
from app.tools.editor.send_page import send_pane
from app.tools.editor.start import start_pane

SIZES: Final = ((1280, 800), (1024, 600), (800, 480))
THEMES: Final = (
    ("light", "sun", "display_theme_light"),
    ("dark", "moon", "display_theme_dark"),
    ("contrast", "contrast", "display_theme_contrast"),
)
LEFT: Final = ("robot", "outline", "parts")
LEFT_WORDS: Final = {
    "robot": "editor_tab_robot",
    "outline": "editor_tab_outline",
    "parts": "editor_tab_parts",
}

_FITS: Final = re.compile(r"fits ([0-9x, ]+)")
# A key in a message of `check`: "topic", max_age_s, role = "stop".
_KEY_NAMED: Final = re.compile(r'"([a-z_]+)"|\b([a-z]+(?:_[a-z]+)+)\b|\b([a-z]+) = ')
_NO_FIT: Final = re.compile(r"does not fit (\d+x\d+): ([^;]+)")
# The words of the page itself.
WORDS: Final = {
    "close": say("editor_close"),
    "close_unsaved": say("editor_close_unsaved"),
    "undo": say("editor_undo"),
    "redo": say("editor_redo"),
    "arrange": say("editor_arrange"),
    "try": say("editor_try"),
    "save": say("editor_save"),
    "sizes": say("editor_sizes"),
    "languages": say("editor_languages"),
    "theme": say("editor_theme"),
    "mode": say("editor_mode"),
    "before_faults": say("editor_before_faults"),
    "preview_keys": say("editor_preview_keys"),
    "file_pane": say("editor_file_pane"),
    "table_pane": say("editor_table_pane"),
    "faults": say("editor_faults"),
    "diff": say("editor_diff"),
    "pages_of_panel": say("editor_pages_of_panel"),
    "conflict": say("editor_conflict"),
    "lost": say("editor_lost"),
    "start": say("editor_start"),
    "empty_place": say("editor_empty_place"),
    "fill_place": say("editor_fill_place"),
    "curve": say("editor_curve"),
    "write_again": say("editor_write_again"),
    "send": say("send_title"),
    "panes": say("editor_panes"),
    "view": say("editor_view"),
}


class PageTab(NamedTuple):
    id: str
    title: str
    icon: str


def page_context(editor: Editor, language: str, revision: str, person: str) -> dict[str, Any]:
    """The variables of `edit.html`."""
    tables, panel = editor.document.tables, editor.preview.panel
    named = [tables.get("language", "en"), *_strings(tables.get("languages"))]
    languages = [*dict.fromkeys(name for name in named if isinstance(name, str))]
    if panel is not None:
        languages = [*panel.readers_languages]
    return {
        "revision": revision,
        "sign_out": say("editor_sign_out", name=person) if person else "",
        "file": editor.session.path.name,
        "sizes": SIZES,
        "languages": [(tag, own_name(tag)) for tag in languages],
        "shown_language": panel.language if panel is not None else languages[0],
        "themes": [(name, icon, say(word)) for name, icon, word in THEMES],
        "shown_theme": panel.theme if panel is not None else "light",
        "left": [(name, say(LEFT_WORDS[name])) for name in LEFT],
        "shown_left": _shown_left(editor),
        "words": {**WORDS, "preview": _preview_words(editor)},
    }


def _shown_left(editor: Editor) -> str:
    """The pane on the left at first: of a new file the one that adds to it."""
    if not editor.is_new:
        return "outline"
    return "robot" if editor.preview.is_live else "parts"


def _preview_words(editor: Editor) -> TextLike:
    return say("editor_preview" if editor.preview.is_live else "editor_preview_simulated")


def _strings(value: Any) -> list[str]:
    return [entry for entry in value if isinstance(entry, str)] if isinstance(value, list) else []


def _pages(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """The keys of the panel's pages, below the preview."""
    panel = request.editor.preview.panel
    shown = request.query.get("language", "") or (panel.language if panel else "")
    if panel is None:  # the file was never good: its pages, as far as it says them
        tables = list_of(request.editor.document.tables.get("page"))
        pages = [PageTab(str(page.get("id", "")), text_of(page, shown), "") for page in tables]
        return "_pages.html", {"pages": pages, "add": say("editor_add_page")}
    pages = [PageTab(page.id, render(page.title, shown), page.icon or "") for page in panel.pages]
    return "_pages.html", {"pages": pages, "add": say("editor_add_page")}


def place_list(editor: Editor, page_id: str) -> dict[str, Any]:
    """The parts of a page that can be selected, and the faulty ones."""
    panel, document = editor.preview.panel, editor.document
    if panel is None:
        return {"page": "", "places": [], "faulty": [], "fits": {}}
    page = panel.page(page_id) or panel.pages[0]
    if page_id and page.id != page_id:
        raise NotFound(f'there is no page "{page_id:.64}"')
    places = [place.as_json() for place in places_on(page, panel, document.tables)]
    faulty = [
        {"path": table_at(document.tables, path_at(fault.place)), "message": fault.message}
        for fault in editor.checked.faults
    ]
    return {"page": page.id, "places": places, "faulty": faulty, "fits": _fits(editor, page.id)}


def _fits(editor: Editor, page_id: str) -> dict[str, str]:
    """Screen → why the page does not fit it, "" if it does, of the panel's screens, as `check` says
    it."""
    fits: dict[str, str] = {}
    for message in (note.message for note in editor.checked.notes if note.id == page_id):
        if fitting := _FITS.match(message):
            fits |= dict.fromkeys(fitting[1].split(", "), "")
        fits |= dict(_NO_FIT.findall(message))
    return fits


def _outline(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    tables = request.editor.document.tables
    return "_outline.html", {
        "nodes": [*outline(tables, request.language)],
        "path": request.path,
        "search": say("editor_search_outline"),
        "label": say("editor_tab_outline"),
    }


class FaultRow(NamedTuple):
    """`path` is the table that it selects, `field` the id of the field there that it is about, "" if it
    is about none. `about` names it, as `check` does."""

    is_fault: bool
    about: str
    message: str
    line: int
    path: Path
    page: str
    field: str = ""
    repair: Repair | None = None


def _faults(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    editor = request.editor
    checked, tables = editor.checked, editor.document.tables
    rows = [
        *(_fault_row(fault, True, tables) for fault in checked.faults),
        *(_fault_row(note, False, tables) for note in checked.notes),
    ]
    # Notes come only without a fault.
    rows = [row._replace(repair=repair) for row, repair in zip(rows, editor.repairs(), strict=True)]
    faults, notes = len(checked.faults), len(checked.notes)
    return "_faults.html", {
        "rows": rows,
        "faults": _counted("editor_fault_one", "editor_fault_many", faults),
        "notes": _counted("editor_note_one", "editor_note_many", notes),
        "good": say("editor_no_faults"),
        "says": say("editor_as_check"),
        "repair": lambda words: say("editor_repair", words=words),
        "line": lambda number: say("editor_line", number=number),
    }


def _counted(singular: str, plural: str, number: int) -> TextLike:
    return say(singular if number == 1 else plural, number=number) if number else ""


def _fault_row(remark: Remark, is_fault: bool, tables: Mapping[str, Any]) -> FaultRow:
    path = path_at(remark.place)
    table = table_at(tables, path)
    key = path[len(table)] if len(path) > len(table) else ""
    name = remark.id or title_of(at(tables, table)) or (kind_of(tables, table) if table else "")
    about = ": ".join(filter(None, (name, str(key))))
    page, field = page_of(table, tables), _field_of(remark, path, table, tables)
    return FaultRow(is_fault, about, remark.message, remark.line, table, page, field)


def _field_of(remark: Remark, path: Path, table: Path, tables: Mapping[str, Any]) -> str:
    """The id of the field of the key that a remark is about: its place, else the first key which it
    names and its table does not have."""
    if len(path) > len(table):
        return element_id(path)
    try:
        known = schema()[table_name_at(tables, table)]["properties"]
    except NoTableError:
        return ""
    there = at(tables, table)
    named = (next(filter(None, match.groups())) for match in _KEY_NAMED.finditer(remark.message))
    missing = (key for key in named if key in known and key not in (there or {}))
    key = next(missing, "")
    return element_id((*table, key)) if key else ""


def _diff(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    document = request.editor.document
    total = document.text.count("\n")
    lines = _with_gaps(document.diff(request.editor.session.base_text), total)
    new = sum(1 for kind, _, _ in lines if kind in ("added", "removed"))
    return "_diff.html", {
        "lines": lines if new else (),
        "title": say("editor_diff"),
        "nothing": say("editor_nothing_to_save"),
        "commands": _commands(request.editor),
        "count": say("editor_diff_count", changed=new, lines=total) if new else "",
    }


def _commands(editor: Editor) -> Sequence[tuple[TextLike, str]]:
    """(what it does, the command) that serve the saved file; none if it has faults or is not there."""
    session = editor.session
    if editor.checked.faults or not session.base_text.strip():
        return ()
    file, folder = session.path.absolute(), FilePath.cwd()
    name = str(file.relative_to(folder) if file.is_relative_to(folder) else file)
    command = shlex.join(["operator-panel", "run", name])
    if editor.document.tables.get("mode", "live") == "demo":
        return ((say("editor_serve_simulated"), command),)
    simulated = (say("editor_serve_simulated"), f"KIOSK_MODE=demo {command}")
    return ((say("editor_serve_live"), command), *(() if editor.preview.is_live else (simulated,)))


def _with_gaps(lines: Sequence[DiffLine], total: int) -> list[tuple[str, int, TextLike]]:
    """(kind, number, text) of the lines; a gap says how many lines it stands for."""
    shown: list[tuple[str, int, TextLike]] = []
    newest = 0  # line of the new text
    for at_line, line in enumerate(lines):
        if line.kind == "gap":
            following = (after.number - 1 for after in lines[at_line + 1 :])
            skipped = next(following, total) - newest
            shown.append(("gap", 0, _counted("editor_gap_one", "editor_gap_many", skipped)))
            continue
        shown.append((line.kind, line.number, line.text))
        if line.kind != "removed":
            newest = line.number
    return shown


def _form(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """The form of the selected table, the tables that refer to it, or its text."""
    editor, query, tables = request.editor, request.query, request.editor.document.tables
    if request.path[-1:] == (EMPTY,) and len(request.path) > 2:
        return empty_pane(request)
    path = table_path(tables, request.path)
    used = [*_users(editor, path)]
    form = form_of(
        tables,
        path,
        interfaces=interfaces_of(editor),
        robot=_robot_names(editor, at(tables, path)),
        faults=editor.checked.faults,
        language=request.language,
        pictures=_pictures(editor),
        kind=query.get("kind", ""),
        used_by=len(used),
    )
    is_there = path == () or at(tables, path) is not None
    page = FormPage(
        view=query.get("view", "form"),
        text=editor.document.text_of(path) if is_there else "",
        lines=editor.document.lines(path) if is_there else (0, 0),
        used=tuple(used),
        pick=path_of(query["pick"]) if query.get("pick") else None,
    )
    return "_form.html", form_context(form, page)


def _users(editor: Editor, path: Path) -> Iterator[Link]:
    """The tables that refer to the one at a path, each once, with the key by which they do."""
    tables = editor.document.tables
    keys = {
        table: str(next(step for step in reversed(reference) if isinstance(step, str)))
        for reference in editor.document.references(path)
        for table in (table_path(tables, reference),)
    }
    for table, key in keys.items():
        yield Link(table, title_of(at(tables, table)) or kind_of(tables, table), key)


def _robot_names(editor: Editor, table: Any) -> RobotNames:
    """What is on the robot, with the newest values of the topic that a table names."""
    robots = editor.robots
    robots.look()
    panel = editor.preview.panel
    topic = table.get("topic") if isinstance(table, Mapping) else None
    values = robots.field_values(topic, panel) if isinstance(topic, str) else {}
    return RobotNames(
        topics=robots.types("topics", panel),
        services=robots.types("services", panel),
        actions=robots.types("actions", panel),
        nodes=robots.nodes,
        values={(str(topic), field): value for field, value in values.items()},
    )


def interfaces_of(editor: Editor) -> Interfaces | None:
    """The message types of the panel; None if its folders have faults."""
    panel = editor.preview.panel
    try:
        return load_interfaces(panel.distro, panel.interfaces) if panel else load_interfaces("jazzy")
    except InterfaceError:
        return None


def _pictures(editor: Editor) -> Sequence[str]:
    panel = editor.preview.panel
    return sorted({*shipped_pictures(), *(panel.picture_files if panel else ())})


def _delete(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """The question before a table is deleted that others name; nothing if none does."""
    document, path = request.editor.document, request.path
    inside = [
        path,
        *(owner for owner, _ in widget_paths(document.tables) if owner[: len(path)] == path),
    ]
    naming = {
        table_at(document.tables, reference): None
        for owner in inside
        for reference in document.references(owner)
        if reference[: len(path)] != path
    }
    tag = tag_of(document.tables, path)
    return "_delete.html", {
        "title": say("editor_delete_named", name=tag, number=len(naming)),
        "names": [tag_of(document.tables, table) for table in naming],
        "words": {"keep": say("editor_keep"), "delete": say("editor_delete")},
    }


PARTS: Final[Mapping[str, Part]] = {
    "pages": _pages,
    "outline": _outline,
    "faults": _faults,
    "diff": _diff,
    "form": _form,
    "curve": curve_pane,
    "delete": _delete,
    "merge": merge_page,
    "recovered": recovered_page,
    "robot": robot_pane,
    "parts": parts_pane,
    "pick": pick_pane,
    "start": start_pane,
    "send": send_pane,
}
