"""Where a table goes that is pasted, by its text and what is selected."""

import re
import tomllib
from typing import Any, Final

from app.panel.file.toml_lines import Path
from app.system.texts import say
from app.tools.editor.document import EditError, Paste
from app.tools.editor.paths import EMPTY, Tables, at

_HEADER: Final = re.compile(r"^[ \t]*\[\[([A-Za-z0-9_.-]+)\]\]", re.MULTILINE)


def paste(tables: Tables, selected: Path, text: str) -> Paste:
    """The table of a text, after the selected one or at its end; EditError if the text is not that
    of one table, or it does not fit there."""
    header = _HEADER.search(text)
    try:
        tomllib.loads(text)
    except tomllib.TOMLDecodeError:
        header = None
    if header is None:
        raise EditError(say("editor_paste_unreadable"))
    keys = tuple(header[1].split("."))
    path = _target(tables, selected, keys[-1])
    if path is None:
        raise EditError(say("editor_paste_nowhere"), selected)
    own = ".".join(key for key in path if isinstance(key, str))
    prefix = re.compile(rf"^([ \t]*\[\[?){re.escape(header[1])}(?=[.\]])", re.MULTILINE)
    return Paste(path, prefix.sub(rf"\g<1>{own}", text))


def _target(tables: Tables, selected: Path, kind: str) -> Path | None:
    """The path of a new table of a kind; None where there is no place for it."""
    if selected[-1:] == (EMPTY,):
        if selected[-3] == kind:
            return selected[:-1]
        selected = selected[:-3]
    for end in range(len(selected), 0, -1):  # beside one of its kind
        if isinstance(selected[end - 1], int) and selected[end - 2] == kind:
            return (*selected[: end - 1], int(selected[end - 1]) + 1)
    around = {"widget": ("group", "page"), "group": ("page",)}.get(kind)
    if around is None:
        return (kind, _number(tables.get(kind)))
    for end in range(len(selected), 0, -1):
        if isinstance(selected[end - 1], int) and selected[end - 2] in around:
            table = at(tables, selected[:end])
            groups = _number(table.get("group")) if isinstance(table, dict) else 0
            if kind == "widget" and selected[end - 2] == "page" and groups:
                group = (*selected[:end], "group", groups - 1)
                return (*group, "widget", _number(at(tables, (*group, "widget"))))
            return (*selected[:end], kind, _number(at(tables, (*selected[:end], kind))))
    if kind == "widget" and selected[:1] == ("frame",):
        return ("frame", "widget", _number(at(tables, ("frame", "widget"))))
    return None


def _number(value: Any) -> int:
    return len(value) if isinstance(value, list) else 0
