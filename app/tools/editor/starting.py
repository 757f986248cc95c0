"""What a panel file can be started from: an empty one, or a page of another panel file with all that it
refers to. Pure."""

from collections.abc import Iterable
from typing import Any, Final

from app.panel.file.same_widgets import NAME as SAME
from app.panel.file.same_widgets import PLACING
from app.panel.file.toml_lines import Path
from app.system.texts import say
from app.system.toml_values import value_text
from app.tools.editor.document import (
    Document,
    Edit,
    EditError,
    Paste,
    Rename,
    SetValue,
)
from app.tools.editor.paths import at
from app.tools.editor.references import (
    ROLES,
    Owner,
    free_id,
    ids_in,
    owners,
    references,
    taken_ids,
)

# What comes along with a page that names it. Pages that its links name do not.
BROUGHT: Final = ("condition", "source", "robot", "place", "zone", "alarm")
EMPTY: Final = """\
title = {title}
mode = "live"

[[page]]
id = "main"
title = {title}
"""


def empty_text(title: str) -> str:
    """A panel file with one page that has nothing on it."""
    return EMPTY.format(title=value_text(title))


def page_edits(target: Document, other: Document, path: Path) -> list[Edit]:
    """The edits that bring a page of another panel file into a document, as its last one: with its
    comments, and with the interlocks, conditions, sources, robots, places and alarms that it names.
    What both files have alike is not brought. Ids that the document has already get a number. A widget
    that the page shares with another page of its file is brought whole."""
    if path[:-1] != ("page",) or at(other.tables, path) is None:
        raise EditError(say("edit_no_place", place=str(path[-1:])), path)
    source = Document(other.text)
    source.apply(_whole_widgets(source, path), "")
    tables = source.tables
    brought = _named_by(tables, path)
    alike = {owner for owner in brought if _is_alike(owner, tables, target.tables)}
    taken, own = taken_ids(target.tables), taken_ids(tables)
    inside = list(owners(tables, path))
    for owner in [*inside, *(owner for owner in brought if owner not in alike)]:
        if owner.id in taken[owner.group]:
            new = free_id(owner.id, taken[owner.group] | own[owner.group])
            own[owner.group].add(new)
            source.apply([Rename(owner.path, new)], "")
    edits: list[Edit] = []
    numbers: dict[str, int] = {}
    for owner in (*(each for each in brought if each not in alike), Owner("page", "", path, path)):
        if owner.group == "role":
            continue
        name = str(owner.path[0])
        have = target.tables.get(name, [])
        numbers[name] = numbers.get(name, len(have) if isinstance(have, list) else 0)
        edits.append(Paste((name, numbers[name]), source.text_of(owner.path)))
        numbers[name] += 1
    return [*_role_edits(target.tables, tables, path), *edits]


def _whole_widgets(document: Document, path: Path) -> Iterable[Edit]:
    """Edits that write widgets of other pages whole into a page."""
    tables = document.tables
    places = {owner.id: owner.path for owner in owners(tables) if owner.group == "widget"}
    for place, table in _widgets(tables, path):
        origin = places.get(table[SAME]) if isinstance(table.get(SAME), str) else None
        if origin is None or origin[: len(path)] == path:
            continue
        whole = at(tables, origin)
        own = {key: value for key, value in table.items() if key in PLACING}
        yield SetValue(place, {**whole, **own})


def _widgets(tables: Any, path: Path) -> Iterable[tuple[Path, dict[str, Any]]]:
    for key in ("widget", "group"):
        value = at(tables, (*path, key))
        for number, table in enumerate(value if isinstance(value, list) else []):
            place = (*path, key, number)
            if key == "group":
                yield from _widgets(tables, place)
            elif isinstance(table, dict):
                yield place, table


def _named_by(tables: Any, path: Path) -> list[Owner]:
    """The tables that a page names, and those that these name, in the order of the file."""
    known = {(owner.group, owner.id): owner for owner in reversed(list(owners(tables)))}
    named: dict[Owner, None] = {}
    to_search = [path]
    while to_search:
        for reference, groups in references(tables, to_search.pop()):
            for group in groups:
                if group not in BROUGHT:
                    continue
                for name in ids_in(reference, group):
                    owner = known.get((group, name))
                    if owner is not None and owner not in named:
                        named[owner] = None
                        to_search.append(owner.path)
    order = [owner.path for owner in owners(tables)]
    return sorted(named, key=lambda owner: order.index(owner.path))


def _is_alike(owner: Owner, tables: Any, others: Any) -> bool:
    """Whether the other file has the same table with the same id."""
    table = at(tables, owner.path)
    return any(
        (other.group, other.id) == (owner.group, owner.id) and at(others, other.path) == table
        for other in owners(others)
    )


def _role_edits(target: Any, tables: Any, path: Path) -> list[Edit]:
    """The groups of users that a page needs, as further ones of the document."""
    known = taken_ids(tables)["role"]
    needed = {
        name
        for reference, groups in references(tables, path)
        if "role" in groups
        for name in ids_in(reference, "role")
        if name in known
    }
    have = at(target, ROLES)
    new = sorted(needed - taken_ids(target)["role"])
    return [SetValue(ROLES, [*(have if isinstance(have, list) else []), *new])] if new else []
