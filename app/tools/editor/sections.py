"""The text of a panel file as sections: a header with the keys below it and the comments that belong
to it. Their texts in sequence are the file, byte for byte; an edit replaces, moves or removes sections.
"""

import re
import tomllib
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Any, Final

from app.panel.file.toml_lines import Layout, Path, layout_of
from app.system.toml_values import key_text, value_text

Tables = dict[str, Any]
Keys = tuple[str, ...]  # of a header: ("page", "widget") for [[page.widget]]

# What an author reads first in a table.
FIRST: Final = ("same", "id", "kind", "role", "label", "title")
WIDTH: Final = 104  # of a line, before a list gets a line for each element

# The tables that are written with a header; all others are written inline.
LISTS: Final[tuple[Keys, ...]] = (
    ("font",), ("robot",), ("source",), ("condition",), ("interlock",), ("alarm",), ("place",),
    ("zone",), ("zone_file",), ("recipe",), ("page",), ("page", "widget"), ("page", "group"),
    ("page", "group", "widget"), ("frame", "widget"), ("state", "detail"),
    ("oee", "reason"), ("oee", "counter"),
    ("page", "widget", "column"), ("page", "widget", "pen"),
    ("page", "group", "widget", "column"), ("page", "group", "widget", "pen"),
)  # fmt: skip
SINGLE: Final[tuple[Keys, ...]] = (
    ("texts",), ("screen",), ("brand",), ("log",), ("diagnostics",), ("control",), ("access",),
    ("access", "oidc"), ("embed",), ("site",), ("record",), ("robot", "overview"), ("state",),
    ("oee",), ("demo",), ("alarms",), ("alarms", "mqtt"), ("frame",), ("recipe", "parameters"),
    ("recipe", "readback"),
)  # fmt: skip
# Of the tables at the top of a new file.
ORDER: Final = (
    "texts", "font", "screen", "brand", "log", "diagnostics", "control", "access", "embed",
    "site", "record", "robot", "state", "oee", "source", "condition", "interlock", "alarms", "alarm",
    "place",
    "zone", "zone_file", "recipe", "frame", "page", "demo",
)  # fmt: skip


@dataclass(frozen=True, eq=False)
class Section:
    """A header with what belongs to it. `above` are the comments directly above it, `body` ends with
    its last key and the comments directly below that, `loose` are the blank lines and comments after
    that.

    `own` are the values of the keys in `body`. `bracket` is where in `header` its last bracket ends.
    The first section of a file is that of the keys before all headers: it has neither.
    """

    above: str
    header: str
    body: str
    loose: str
    keys: Keys
    many: bool
    bracket: int
    own: Tables

    @property
    def text(self) -> str:
        return self.above + self.header + self.body + self.loose

    @cached_property
    def layout(self) -> Layout:
        """That of `body`."""
        return layout_of(self.body)

    @cached_property
    def lines(self) -> tuple[int, int, int, int]:
        """How many lines `above`, `header`, `body` and `loose` have."""
        above, header, body, loose = (
            part.count("\n") for part in (self.above, self.header, self.body, self.loose)
        )
        return above, header, body, loose

    def with_body(self, body: str) -> "Section":
        """With other keys; `body` is valid TOML."""
        return Section(
            self.above, self.header, body, self.loose, self.keys, self.many, self.bracket, parsed(body)
        )

    def with_loose(self, loose: str) -> "Section":
        return Section(
            self.above, self.header, self.body, loose, self.keys, self.many, self.bracket, self.own
        )

    def with_end(self, newline: str) -> "Section":
        """With a newline after its last line."""
        if not self.text or self.text.endswith("\n"):
            return self
        if self.loose:
            return self.with_loose(self.loose + newline)
        if self.body:
            return self.with_body(self.body + newline)
        header = self.header + newline
        return Section(
            self.above, header, self.body, self.loose, self.keys, self.many, self.bracket, self.own
        )

    def with_keys(self, keys: Keys) -> "Section":
        """With another header; the comment beside it stays."""
        bracket = header_text(keys, self.many)
        return Section(
            self.above,
            bracket + self.header[self.bracket :],
            self.body,
            self.loose,
            keys,
            self.many,
            len(bracket),
            self.own,
        )


def parsed(body: str) -> Tables:
    return tomllib.loads(body)


def header_text(keys: Keys, many: bool) -> str:
    name = ".".join(map(key_text, keys))
    return f"[[{name}]]" if many else f"[{name}]"


def keys_of(path: Path) -> Keys:
    """Those of the header of the table at a path."""
    return tuple(step for step in path if isinstance(step, str))


def is_list(keys: Keys) -> bool:
    return keys in LISTS


def has_header(keys: Keys, value: Any) -> bool:
    """Whether a new value is written with headers."""
    if isinstance(value, list):
        return is_list(keys) and bool(value) and all(isinstance(item, dict) for item in value)
    return isinstance(value, dict) and keys in SINGLE


def split(text: str, tables: Mapping[str, Any]) -> list[Section]:
    """The sections of a text; `tables` is the text as it was parsed."""
    layout = layout_of(text)
    last_pair = {}
    body_keys: dict[Path, set[str]] = {}
    for table, key, span in layout.pairs:
        last_pair[table] = span.end
        body_keys.setdefault(table, set()).add(key)
    children: dict[Path, set[str]] = {}
    for header in layout.headers:
        path: Path = ()
        for step in header.path:
            if isinstance(step, str):
                children.setdefault(path, set()).add(step)
            path = (*path, step)
    starts = [*(_line_start(text, header.span.start) for header in layout.headers), len(text)]
    last_end, begins = 0, [0]  # where the part of each section begins, with its comments
    for table, start in zip([(), *(h.path for h in layout.headers)], starts, strict=True):
        keys_end = _line_end(text, last_pair[table]) if table in last_pair else last_end
        begins.append(_comment_start(text, keys_end, start) if start < len(text) else start)
        last_end = _line_end(text, start)
    sections = []
    for number, (begin, end) in enumerate(pairwise(begins)):
        opened = layout.headers[number - 1] if number else None
        table = opened.path if opened else ()
        start = starts[number - 1] if opened else 0
        below = _line_end(text, opened.span.end) if opened else 0
        keys_end = _line_end(text, last_pair[table]) if table in last_pair else below
        keys_end = _comment_end(text, keys_end, end)
        body = text[below:keys_end]
        inner = children.get(table, set())
        node = _at(tables, table)
        own = (
            parsed(body)
            if inner & body_keys.get(table, set())
            else {key: value for key, value in node.items() if key not in inner}
        )
        sections.append(
            Section(
                above=text[begin:start] if opened else "",
                header=text[start:below],
                body=body,
                loose=text[keys_end:end],
                keys=opened.keys if opened else (),
                many=opened.many if opened else False,
                bracket=opened.span.end - start if opened else 0,
                own=own,
            )
        )
    return sections


def _at(tables: Any, path: Path) -> Any:
    for step in path:
        tables = tables[step]
    return tables


def _line_start(text: str, at: int) -> int:
    return text.rfind("\n", 0, at) + 1


def _line_end(text: str, at: int) -> int:
    """After the newline of the line that the character before `at` is in."""
    end = text.find("\n", at)
    return len(text) if end < 0 else end + 1


def _comment_start(text: str, begin: int, end: int) -> int:
    """Where the comment lines directly above `end` begin."""
    while end > begin:
        start = _line_start(text, end - 1)
        if start < begin or not text[start:end].lstrip(" \t").startswith("#"):
            break
        end = start
    return end


def _comment_end(text: str, begin: int, end: int) -> int:
    """Where the comment lines directly below `begin` end."""
    while begin < end and re.compile(r"[ \t]*#").match(text, begin, end):
        begin = min(_line_end(text, begin), end)
    return begin


def paths_of(sections: Sequence[Section]) -> list[Path]:
    """The path of each section's table."""
    counts: dict[Path, int] = {}
    paths = []
    for section in sections:
        path: Path = ()
        for key in section.keys[:-1]:
            path = (*path, key)
            if path in counts:
                path = (*path, counts[path] - 1)
        if section.keys:
            path = (*path, section.keys[-1])
        if section.many:
            counts[path] = counts.get(path, 0) + 1
            path = (*path, counts[path] - 1)
        paths.append(path)
    return paths


def assembled(sections: Sequence[Section], previous: Tables) -> Tables:
    """The tables of a file. Tables that are the same as in `previous` are the same objects."""
    root = dict(sections[0].own)
    made = {id(root)}  # dicts and lists that are in no section, which may be changed here

    def editable(container: Any, key: Any) -> Any:
        """The table at a key, as one that may be changed."""
        child = container.get(key, None) if isinstance(container, dict) else container[key]
        if child is None:
            child = {}
        elif id(child) in made:
            return child
        else:
            child = child.copy()
        made.add(id(child))
        container[key] = child
        return child

    for section in sections[1:]:
        node: Any = root
        for key in section.keys[:-1]:
            node = editable(node, key)
            if isinstance(node, list):
                node = editable(node, -1)
        last = section.keys[-1]
        if section.many:
            if last not in node:
                node[last] = []
                made.add(id(node[last]))
            node[last].append(section.own)
        elif last in node:
            editable(node, last).update(section.own)
        else:
            node[last] = section.own
    _reuse(previous, root, made)
    return root


def with_own(tables: Tables, path: Path, old: Tables, new: Tables) -> Tables | None:
    """The tables with other keys in the body of one table. None where a header below it adds to one of
    the keys: then the tables are assembled again."""
    if not path:
        inner = {key: value for key, value in tables.items() if key not in old}
        if any(tables[key] is not old[key] for key in old) or inner.keys() & new.keys():
            return None
        return {**new, **inner}
    step, *rest = path
    copied: Any = tables.copy()
    copied[step] = with_own(copied[step], tuple(rest), old, new)
    return None if copied[step] is None else copied


def _reuse(old: Any, new: Any, made: set[int]) -> Any:
    """`old` where `new` is the same. What was made for `new` gets the same parts of `old`."""
    if old is new or id(new) not in made or type(old) is not type(new):
        return new
    if isinstance(new, dict):
        for key in new.keys() & old.keys():
            new[key] = _reuse(old[key], new[key], made)
        same = list(new) == list(old) and all(new[key] is old[key] for key in new)
        return old if same else new
    for at in range(min(len(new), len(old))):
        new[at] = _reuse(old[at], new[at], made)
        if new[at] is not old[at]:
            break
    for at in range(1, min(len(new), len(old)) + 1):
        new[-at] = _reuse(old[-at], new[-at], made)
        if new[-at] is not old[-at]:
            break
    same = len(new) == len(old) and all(a is b for a, b in zip(old, new, strict=True))
    return old if same else new


def written(value: Any, begins: int = 0) -> str:
    """A value as TOML, inline; a long list of tables or texts has a line for each element. `begins` is
    the length of what stands before it on its line."""
    line = value_text(value)
    several = isinstance(value, list) and len(value) > 1 and isinstance(value[0], dict | list)
    if not isinstance(value, list) or not value or (begins + len(line) <= WIDTH and not several):
        return line
    return "[\n" + "".join(f"  {value_text(item)},\n" for item in value) + "]"


def in_order(table: Mapping[str, Any]) -> Tables:
    """With the keys that an author reads first at its beginning."""
    first = {key: table[key] for key in FIRST if key in table}
    return first | {key: value for key, value in table.items() if key not in first}


def new_sections(keys: Keys, value: Mapping[str, Any], many: bool, newline: str) -> list[Section]:
    """The sections of a new table, in the style of the examples."""
    table = in_order(value)
    apart = {key: item for key, item in table.items() if has_header((*keys, key), item)}
    lines = [
        f"{key_text(key)} = {written(item, len(key) + 3)}\n"
        for key, item in table.items()
        if key not in apart
    ]
    body = "".join(lines).replace("\n", newline)
    bracket = header_text(keys, many)
    header = bracket + newline
    own = Section("", header, body, newline, keys, many, len(bracket), parsed(body))
    sections = [own] if many or body or not apart else []
    for key, item in apart.items():
        for inner in item if isinstance(item, list) else [item]:
            sections += new_sections((*keys, key), inner, isinstance(item, list), newline)
    return sections


def has_comment(loose: str) -> bool:
    return "#" in loose


def without(sections: Sequence[Section], gone: Iterable[int]) -> list[Section]:
    """Without some sections. Comments between them that stand alone stay."""
    left: list[Section] = []
    removed = set(gone)
    last = max((n for n in range(len(sections)) if n not in removed), default=0)
    for number, section in enumerate(sections):
        if number not in removed:
            left.append(section)
            continue
        loose = left[-1].loose
        if number + 1 in removed:
            continue  # what is between tables that go goes too
        if has_comment(section.loose):
            after = section.loose.lstrip("\r\n") if has_comment(loose) else section.loose
            loose = loose + after if has_comment(loose) else after
        elif not has_comment(loose):
            loose = max(loose, section.loose, key=len) if number < last else ""
        left[-1] = left[-1].with_loose(loose)
    return left


def with_sections(
    sections: Sequence[Section],
    at: int,
    new: Sequence[Section],
    separator: str,
    before: bool,
    newline: str,
) -> list[Section]:
    """With new sections at an index. `separator` are the blank lines between them and their neighbour:
    the section at `at` (`before`), or the one before it."""
    ahead = sections[at - 1].with_end(newline)
    *first, last = new
    last = last.with_end(newline)
    if before:
        last = last.with_loose(separator)
        if not ahead.loose and ahead.text and separator:
            ahead = ahead.with_loose(separator)
    else:
        last = last.with_loose(ahead.loose if at < len(sections) or has_comment(ahead.loose) else "")
        ahead = ahead.with_loose(separator if ahead.text else "")
    return [*sections[: at - 1], ahead, *first, last, *sections[at:]]
