"""Paths of tables in a panel file: as text, as the places of faults, and what they are called."""

import json
import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, Final

from app.panel.file.toml_lines import Path
from app.tools.editor.document import path_from

_STEP: Final = re.compile(r"\.?([A-Za-z0-9_-]+)|\[(\d+)\]")
EMPTY: Final = "+"  # the last step of the path of an empty place: a table would come before it
TITLED: Final = ("id", "title", "name", "label", "text", "topic")

Tables = Mapping[str, Any]


def path_of(text: str) -> Path:
    """A path in the JSON of a query; EditError for anything else, "" is the whole file."""
    try:
        return path_from(json.loads(text or "[]"))
    except ValueError:
        return path_from(None)


def path_at(place: str) -> Path:
    """The path of a place such as `page[0].widget[2].topic`."""
    return tuple(int(index) if index else key for key, index in _STEP.findall(place))


def at(tables: Any, path: Sequence[str | int]) -> Any:
    """The value at a path; None without one."""
    value = tables
    for step in path:
        try:
            value = value[step]
        except (KeyError, IndexError, TypeError):
            return None
    return value


def table_at(tables: Tables, path: Path) -> Path:
    """The path of the innermost table around a place that an editor selects: an element of an array of
    tables, or a table of the file."""
    for end in range(len(path), 0, -1):
        value = at(tables, path[:end])
        if isinstance(value, Mapping) and (end == 1 or isinstance(path[end - 1], int)):
            return path[:end]
    return ()


def title_of(table: Any) -> str:
    """What a table is called: its id, or what it shows."""
    if not isinstance(table, Mapping):
        return ""
    for key in TITLED:
        value = table.get(key)
        if isinstance(value, Mapping):
            value = next((text for text in value.values() if isinstance(text, str)), "")
        if isinstance(value, str) and value:
            return value
    return ""


def kind_of(tables: Tables, path: Path) -> str:
    """What stands at a path, as the panel file says it: a widget's kind, else the name of its table."""
    table = at(tables, path)
    if isinstance(table, Mapping) and path[-2:-1] == ("widget",):
        return str(table.get("kind", "widget"))
    names = [step for step in path if isinstance(step, str)]
    return names[-1] if names else "panel"


def tag_of(tables: Tables, path: Path) -> str:
    """`figure: boxes`."""
    return ": ".join(filter(None, (kind_of(tables, path), title_of(at(tables, path)))))


def widget_paths(tables: Tables) -> Iterator[tuple[Path, Mapping[str, Any]]]:
    """(path, table) of each widget, in the order of the file."""

    def inside(table: Any, path: Path) -> Iterator[tuple[Path, Mapping[str, Any]]]:
        for number, widget in enumerate(_tables(table, "widget")):
            yield (*path, "widget", number), widget
        for number, group in enumerate(_tables(table, "group")):
            yield from inside(group, (*path, "group", number))

    yield from inside(tables.get("frame"), ("frame",))
    for number, page in enumerate(_tables(tables, "page")):
        yield from inside(page, ("page", number))


def _tables(table: Any, key: str) -> list[Mapping[str, Any]]:
    value = table.get(key) if isinstance(table, Mapping) else None
    listed = value if isinstance(value, list) else []
    return [entry if isinstance(entry, Mapping) else {} for entry in listed]
