"""Which key of a panel file names the id of which table, and where an id is named."""

import re
from collections.abc import Iterator, Mapping, Sequence, Set
from string import Formatter
from typing import Any, Final, Literal, NamedTuple

from app.panel.alarm import NAME as CONTROL
from app.panel.base import ID
from app.panel.file.toml_lines import Path

Tables = Mapping[str, Any]
# What shares its ids: recipes are pressed as widgets are, interlocks and conditions are named alike.
Group = Literal[
    "widget", "condition", "source", "alarm", "robot", "page", "place", "zone", "role", "level",
    "reason",
]  # fmt: skip
# How an id is named: as a text or in a list, as the keys of a table, as a control that may have its
# robot before it, or between braces in a message.
Form = Literal["id", "keys", "control", "template"]

MAX_ID: Final = 64
NAMED: Final = re.compile(ID)

# Header's keys → what its tables are.
OWNERS: Final[Mapping[tuple[str, ...], Group]] = {
    ("robot",): "robot",
    ("source",): "source",
    ("interlock",): "condition",
    ("condition",): "condition",
    ("alarm",): "alarm",
    ("place",): "place",
    ("zone",): "zone",
    ("recipe",): "widget",
    ("frame", "widget"): "widget",
    ("page",): "page",
    ("page", "widget"): "widget",
    ("page", "group", "widget"): "widget",
    ("page", "widget", "level"): "level",
    ("page", "group", "widget", "level"): "level",
    ("oee", "reason"): "reason",
}
# Each table around them has ids of its own: a copy keeps them.
LOCAL: Final[Set[Group]] = {"level", "reason"}
ROLES: Final = ("access", "groups")  # a list of the names themselves

# "table.key" → what it names; "*" is each table. A table is called as the JSON schema calls it.
REFERENCES: Final[Mapping[str, tuple[Form, tuple[Group, ...]]]] = {
    "*.robot": ("id", ("robot",)),
    "*.needs": ("id", ("role",)),
    "*.source": ("id", ("source",)),
    "*.interlock": ("id", ("condition",)),
    "same.same": ("id", ("widget",)),
    "link.page": ("id", ("page",)),
    "place_widget.map": ("id", ("widget",)),
    "place_widget.places": ("id", ("place",)),
    "tour.map": ("id", ("widget",)),
    "tour.places": ("id", ("place",)),
    "tour.action": ("id", ("widget",)),
    "conditions_widget.conditions": ("id", ("condition",)),
    "sequence.fault": ("id", ("condition",)),
    "sequence.alarms": ("id", ("alarm",)),
    "steps.condition": ("id", ("condition",)),
    "recovery.condition": ("id", ("condition",)),
    "state.effects": ("id", ("condition", "alarm")),
    "alarm.inhibits": ("control", ("widget", "robot")),
    "alarm.ack_command": ("id", ("widget",)),
    "alarm.ack_input": ("id", ("widget",)),
    "site.figures": ("id", ("widget",)),
    "recipe.fields": ("id", ("widget",)),
    "recipe.parameters": ("keys", ("widget",)),
    "recipe.parameter_types": ("keys", ("widget",)),
    "readback.fields": ("keys", ("widget",)),
    "readback.parameters": ("keys", ("widget",)),
    "readback.parameter_types": ("keys", ("widget",)),
    "confirm.equals": ("template", ("widget",)),
    **{
        f"{table}.level": ("id", ("level",))
        for table in ("place", "zone", "zone_file", "layer", "plan", "routes")
    },
    **{
        f"{table}.{key}": ("template", ("widget",))
        for table, keys in {
            "publish": ("message",),
            "call": ("request",),
            "action": ("goal",),
            "hold": ("message", "release"),
            "joystick": ("message", "release"),
            "step": ("message",),
            "recipe": ("message", "request"),
            "switch": ("on_message", "off_message", "on_request", "off_request"),
        }.items()
        for key in keys
    },
}
# Names between braces that are no ids there.
OWN_NAMES: Final[Mapping[str, Set[str]]] = {"joystick": {"x", "y"}, "step": {"value"}}
# Tables whose keys are not those of the panel file.
FREE_FORM: Final = ("demo", "texts", "message", "request", "goal", "release")
KINDS_WITH_SUFFIX: Final = ("log", "conditions", "place")  # other tables have these names


class Owner(NamedTuple):
    """A table with an id; `place` is the path of that id."""

    group: Group
    id: str
    path: Path
    place: Path


class Reference(NamedTuple):
    """A place that names an id. `path` is that of the text, or of the key (form "keys"). `table` is the
    name of the table around it."""

    path: Path
    form: Form
    text: str
    table: str


def owners(tables: Tables, inside: Path = ()) -> Iterator[Owner]:
    """All tables with an id, of those at or below a path."""
    for keys, group in OWNERS.items():
        for path, table in _tables_at(tables, keys):
            if path[: len(inside)] == inside and isinstance(table.get("id"), str):
                yield Owner(group, table["id"], path, (*path, "id"))
    groups = _at(tables, ROLES)
    for n, name in enumerate(groups if isinstance(groups, list) else []):
        path = (*ROLES, n)
        if isinstance(name, str) and path[: len(inside)] == inside:
            yield Owner("role", name, path, path)


def _tables_at(tables: Any, keys: tuple[str, ...], path: Path = ()) -> Iterator[tuple[Path, Tables]]:
    if not keys:
        yield path, tables
        return
    inner = tables.get(keys[0])
    if isinstance(inner, dict) and len(keys) > 1:
        yield from _tables_at(inner, keys[1:], (*path, keys[0]))
    for n, each in enumerate(inner if isinstance(inner, list) else []):
        if isinstance(each, dict):
            yield from _tables_at(each, keys[1:], (*path, keys[0], n))


def _at(tables: Any, path: Path) -> Any:
    for step in path:
        try:
            tables = tables[step]
        except (LookupError, TypeError):
            return None
    return tables


def owner_at(tables: Tables, path: Path) -> Owner | None:
    """The table with an id at a path, which may be that of its id too."""
    table = path[:-1] if path[-1:] == ("id",) else path
    keys = tuple(step for step in table if isinstance(step, str))
    value = _at(tables, table)
    if keys == ROLES and isinstance(value, str):
        return Owner("role", value, table, table)
    group = OWNERS.get(keys)
    if group is None or not isinstance(value, dict) or not isinstance(value.get("id"), str):
        return None
    return Owner(group, value["id"], table, (*table, "id"))


def taken_ids(tables: Tables) -> dict[Group, set[str]]:
    taken: dict[Group, set[str]] = {group: set() for group in (*OWNERS.values(), "role")}
    for owner in owners(tables):
        taken[owner.group].add(owner.id)
    return taken


def free_id(name: str, taken: Set[str]) -> str:
    """The id with the first number behind it that is not taken: start, start_2, start_3."""
    stem = re.sub(r"_[0-9]+$", "", name)
    number = 2
    while (candidate := f"{stem[: MAX_ID - 1 - len(str(number))]}_{number}") in taken:
        number += 1
    return candidate if name in taken else name


def references(tables: Tables, inside: Path = ()) -> Iterator[tuple[Reference, tuple[Group, ...]]]:
    """Every place that names an id, of those at or below a path, with what the id may be of."""
    for reference, groups in _references("panel", tables, (), inside):
        if reference.path[: len(inside)] == inside:
            yield reference, groups


def references_to(tables: Tables, owner: Owner, inside: Path = ()) -> list[Reference]:
    """The places that name the id of a table, of those at or below a path."""
    return [
        reference
        for reference, groups in references(tables, inside)
        if owner.group in groups and names(reference, owner)
    ]


def names(reference: Reference, owner: Owner) -> bool:
    return owner.id in ids_in(reference, owner.group)


def ids_in(reference: Reference, group: Group) -> list[str]:
    """The ids of a group that a place names."""
    match reference.form:
        case "template":
            named = (name.partition(".")[0] for _, name in _parsed(reference.text) if name is not None)
            own = OWN_NAMES.get(reference.table, set())
            return [name for name in named if name not in own]
        case "control":
            control = CONTROL.fullmatch(reference.text)
            part = "robot" if group == "robot" else "control"
            return [control[part]] if control and control[part] else []
    return [reference.text]


def renamed(reference: Reference, renames: Sequence[tuple[Owner, str]]) -> str:
    """The text of a place with the new ids of some tables that it names."""
    new = {(owner.group, owner.id): name for owner, name in renames}
    match reference.form:
        case "template":
            parts = []
            for literal, name in _parsed(reference.text):
                parts.append(literal.replace("{", "{{").replace("}", "}}"))
                if name is not None:
                    own, dot, part = name.partition(".")
                    is_id = own not in OWN_NAMES.get(reference.table, set())
                    own = new.get(("widget", own), own) if is_id else own
                    parts.append(f"{{{own}{dot}{part}}}")
            return "".join(parts)
        case "control":
            robot, slash, control = reference.text.rpartition("/")
            robot, control = new.get(("robot", robot), robot), new.get(("widget", control), control)
            return f"{robot}{slash}{control}"
    return renames[0][1]


def _parsed(text: str) -> list[tuple[str, str | None]]:
    """(literal text, name between braces after it or None); none for unmatched braces."""
    try:
        return [(literal, name) for literal, name, _, _ in Formatter().parse(text)]
    except ValueError:
        return []


def _references(
    table: str, keys: Tables, path: Path, inside: Path
) -> Iterator[tuple[Reference, tuple[Group, ...]]]:
    for key, value in keys.items():
        at = (*path, key)
        if at != inside[: len(at)] and len(at) <= len(inside):
            continue
        form, groups = REFERENCES.get(f"{table}.{key}") or REFERENCES.get(f"*.{key}", ("id", ()))
        if groups and form == "template":
            for place, text in _texts(value, at):
                yield Reference(place, form, text, table), groups
        elif groups and form == "keys" and isinstance(value, dict):
            for name in value:
                yield Reference((*at, name), form, name, table), groups
        elif groups and isinstance(value, str):
            yield Reference(at, form, value, table), groups
        elif groups and isinstance(value, list) and all(isinstance(item, str) for item in value):
            for n, item in enumerate(value):
                yield Reference((*at, n), form, item, table), groups
        elif key in FREE_FORM:
            continue
        elif isinstance(value, dict):
            yield from _references(_name(key, value), value, at, inside)
        elif isinstance(value, list):
            chosen = inside[len(at)] if len(inside) > len(at) else None
            for n, item in enumerate(value):
                if isinstance(item, dict) and chosen in (None, n):
                    yield from _references(_name(key, item), item, (*at, n), inside)


def _name(key: str, table: Tables) -> str:
    """The name of a table as the JSON schema has it: a widget's is its kind."""
    if key != "widget":
        return key
    kind = str(table.get("kind", "same" if "same" in table else key))
    return f"{kind}_widget" if kind in KINDS_WITH_SUFFIX else kind


def _texts(value: Any, path: Path) -> Iterator[tuple[Path, str]]:
    """Every text in a message."""
    if isinstance(value, str):
        yield path, value
    elif isinstance(value, dict):
        for key, item in value.items():
            yield from _texts(item, (*path, key))
    elif isinstance(value, list):
        for n, item in enumerate(value):
            yield from _texts(item, (*path, n))
