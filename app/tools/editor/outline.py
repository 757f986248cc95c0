"""The tables of a panel file as a tree."""

from collections.abc import Iterator, Mapping
from typing import Any, Final, NamedTuple

from app.panel.file.toml_lines import Path
from app.system.pictures import icons
from app.system.texts import TextLike, say
from app.system.texts.catalogue import files
from app.tools.editor.paths import Tables, title_of

# The tables in the order of a panel's parts, each with its icon; others follow as they are in the file.
SECTIONS: Final[Mapping[str, tuple[str, str]]] = {
    "page": ("editor_pages", "layout-grid"),
    "frame": ("editor_frame", "square"),
    "state": ("editor_state", "activity"),
    "interlock": ("editor_interlocks", "lock"),
    "condition": ("editor_conditions", "circle-check"),
    "source": ("editor_sources", "radio"),
    "alarm": ("editor_alarms", "bell"),
    "alarms": ("editor_alarm_rules", "bell"),
    "recipe": ("editor_recipes", "clipboard-list"),
    "robot": ("editor_robots", "bot"),
    "access": ("editor_access", "user"),
    "demo": ("editor_demo", "play"),
}
# Icons of kinds of widgets, in place of their own.
KINDS: Final[Mapping[str, str]] = {
    **dict.fromkeys(("figure", "readout", "list", "table", "text"), "hash"),
    **dict.fromkeys(("gauge", "bar", "joints"), "gauge"),
    **dict.fromkeys(("trend",), "chart-line"),
    **dict.fromkeys(("indicator", "conditions", "state"), "lightbulb"),
    **dict.fromkeys(("call", "publish", "action", "hold", "sequence"), "hand"),
    **dict.fromkeys(("switch",), "toggle-left"),
    **dict.fromkeys(("number", "slider", "select", "step", "parameter"), "sliders-horizontal"),
    **dict.fromkeys(("camera",), "camera"),
    **dict.fromkeys(("map",), "map"),
    **dict.fromkeys(("log",), "history"),
}
LANGUAGES: Final = frozenset(files())
ANY_ICON: Final = "circle-dot"


class Node(NamedTuple):
    """A line of the tree; `level` is 1 for a section. `inside` is the number of tables in it, and
    `detail` what stands at the end of the line."""

    path: Path
    level: int
    icon: str
    title: TextLike
    detail: TextLike
    inside: int


def outline(tables: Tables, language: str) -> Iterator[Node]:
    """The lines of the tree, all open; the first is the panel itself."""
    title = text_of(tables, language)
    yield Node((), 1, _known("panels-top-left"), say("form_table_panel"), title, 0)
    names = [*SECTIONS, *(key for key in tables if key not in SECTIONS)]
    for name in names:
        value = tables.get(name)
        if isinstance(value, Mapping) and not value.keys() <= LANGUAGES:  # a text in some languages
            word, icon = SECTIONS.get(name, ("", ANY_ICON))
            inside = [*_inside(value, (name,), 2, language)] if name in ("frame",) else []
            yield Node((name,), 1, _known(icon), say(word) if word else name, "", _own(inside, 2))
            yield from inside
        elif isinstance(value, list) and value and all(isinstance(table, dict) for table in value):
            word, icon = SECTIONS.get(name, ("", ANY_ICON))
            yield Node((name,), 1, _known(icon), say(word) if word else name, "", len(value))
            for number, table in enumerate(value):
                yield from _table(table, (name, number), 2, language)


def _table(table: Mapping[str, Any], path: Path, level: int, language: str) -> Iterator[Node]:
    inside = [*_inside(table, path, level + 1, language)]
    title = text_of(table, language) or say("editor_unnamed")
    yield Node(path, level, _icon(table, path), title, _detail(table, path), _own(inside, level + 1))
    yield from inside


def _inside(table: Mapping[str, Any], path: Path, level: int, language: str) -> Iterator[Node]:
    for key in ("widget", "group"):
        value = table.get(key)
        for number, inner in enumerate(value if isinstance(value, list) else []):
            if isinstance(inner, dict):
                yield from _table(inner, (*path, key, number), level, language)


def _own(nodes: list[Node], level: int) -> int:
    return sum(1 for node in nodes if node.level == level)


def text_of(table: Mapping[str, Any], language: str) -> str:
    """The title of a page or group in the reader's language, else what a table is called."""
    title = table.get("title")
    if isinstance(title, Mapping):
        title = title.get(language) or next(iter(title.values()), "")
    return title if isinstance(title, str) and title else title_of(table)


def _detail(table: Mapping[str, Any], path: Path) -> str:
    return str(table.get("kind", "")) if path[-2] == "widget" else ""


def _icon(table: Mapping[str, Any], path: Path) -> str:
    if isinstance(table.get("icon"), str):
        return _known(table["icon"])
    if path[-2] == "group":
        return _known("square")
    if path[-2] == "widget":
        return _known(KINDS.get(str(table.get("kind")), ANY_ICON))
    return _known(SECTIONS.get(str(path[-2]), ("", ANY_ICON))[1])


def _known(icon: str) -> str:
    return icon if icon in icons() else ANY_ICON
