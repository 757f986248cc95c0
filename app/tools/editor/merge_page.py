"""The page of what both this editor and others have changed in the file, and that of unsaved work."""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from app.panel.file.toml_lines import Path
from app.system.clock import format_datetime
from app.system.texts import TextLike, say
from app.system.toml_values import value_text
from app.tools.editor.document import Document, diff_lines
from app.tools.editor.editor import PartRequest
from app.tools.editor.merge import Conflict, merge
from app.tools.editor.paths import Tables, at, tag_of

SHOWN: Final = 40  # characters of a value


class ChangeRow(NamedTuple):
    """A key that one side has changed; a value is "" where the side has it as before."""

    about: str
    ours: str
    theirs: str
    result: TextLike


class ConflictCard(NamedTuple):
    """`name` is that of the conflict. A text is "" where the side has removed the table."""

    name: str
    about: str
    base: str
    ours: str
    theirs: str


def merge_page(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """What both have changed, with the choices; nothing without a conflict."""
    session = request.editor.session
    cards = [_card(conflict, session.document.tables) for conflict in session.conflicts]
    try:
        disk = session.path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError):
        disk = session.base_text
    base, theirs = Document(session.base_text).tables, Document(disk).tables
    merged = merge(session.base_text, session.document.text, disk)
    rows = _rows(base, session.document.tables, theirs) if cards else ()
    return "_merge.html", {
        "cards": cards,
        "rows": [*rows],
        "lines": [(line.kind, line.number, line.text) for line in diff_lines(disk, merged.text)],
        "title": say("editor_merge_title", file=session.path.name),
        "words": {
            "about": say("editor_merge_about"),
            "change": say("editor_merge_change"),
            "ours": say("editor_merge_ours"),
            "theirs": say("editor_merge_theirs"),
            "another": say("editor_merge_another"),
            "take": say("editor_merge_take"),
            "removed": say("editor_merge_removed"),
            "result": say("editor_merge_result"),
            "same": say("editor_merge_same"),
            "later": say("editor_merge_later"),
        },
    }


def recovered_page(request: PartRequest) -> tuple[str, Mapping[str, Any]]:
    """The question whether to go on with what was not saved; nothing without such work."""
    kept = request.editor.session.recovered
    lines = [] if kept is None else diff_lines(kept.base, kept.text)
    return "_recovered.html", {
        "is_there": kept is not None,
        "title": say("editor_recovered", time=format_datetime(kept.saved_s) if kept else ""),
        "lines": lines,
        "take": say("editor_recovered_take"),
        "drop": say("editor_recovered_drop"),
    }


def _card(conflict: Conflict, tables: Tables) -> ConflictCard:
    about = tag_of(tables, conflict.place) if conflict.place else conflict.name
    return ConflictCard(
        conflict.name, about, conflict.base or "", conflict.ours or "", conflict.theirs or ""
    )


def _rows(base: Tables, ours: Tables, theirs: Tables) -> Iterator[ChangeRow]:
    """Each key that only one side has changed."""
    before, mine, other = _named(base), _named(ours), _named(theirs)
    for name in dict.fromkeys((*mine, *other, *before)):
        was, here, there = before.get(name), mine.get(name), other.get(name)
        if here == there or (here != was and there != was):
            continue
        is_ours = here != was
        yield ChangeRow(
            name,
            _shown(here) if is_ours else "",
            "" if is_ours else _shown(there),
            say("editor_merge_ours" if is_ours else "editor_merge_theirs"),
        )


def _named(tables: Tables) -> dict[str, Any]:
    """The values of all keys by "page: cell, widget: start, label"; tables of lists by their ids."""
    named: dict[str, Any] = {}

    def gather(table: Mapping[str, Any], path: Path, about: str) -> None:
        for key, value in table.items():
            if isinstance(value, list) and value and all(isinstance(each, dict) for each in value):
                for number, each in enumerate(value):
                    own = tag_of(tables, (*path, key, number))
                    gather(each, (*path, key, number), f"{about}{own}, ")
            else:
                named[f"{about}{key}"] = at(tables, (*path, key))

    gather(tables, (), "")
    return named


def _shown(value: Any) -> str:
    text = "–" if value is None else value_text(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}…"
