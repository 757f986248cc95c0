"""Keys of a panel file's tables that are unknown, missing or in the wrong table, and the places of
faults."""

import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Final, TypeVar, get_args

from pydantic import BaseModel

from app.panel.file.toml_lines import Path, lines_of
from app.panel.file.wording import closest_name
from app.panel.model import Panel
from app.panel.source import NAME as SOURCE
from app.panel.source import Source, reads_source
from app.panel.texts import key_in_place
from app.panel.widgets.families import BaseWidget
from app.panel.widgets.kinds import KINDS
from app.ros.messages.validation import format_value
from app.system.errors import Fault, Remark

# What other programs call a key, and what is written here.

_LIMIT: Final = "a limit is high, high_high, low or low_low, such as high = 80"
_USERS: Final = "users are not in the panel file: `operator-panel users add` adds them"
_CONNECT: Final = 'where it is reached is connect = ["tcp/robot1:7447"]'
_FONT: Final = 'a font is two files, regular = "corp.ttf" and bold = "corp-bold.ttf"'
_KIND: Final = "a page has no kind; that of the robots' tiles has overview = true"

# The table's name → the key of other programs → the sentence about what is written here.
OTHER_KEYS: Final[Mapping[str, Mapping[str, str]]] = {
    "alarm": {
        **dict.fromkeys(
            ("severity", "level", "urgency", "class"),
            "its urgency is priority, such as priority = 2: 1 high, 2 medium, 3 low, 4 diagnostic",
        ),
        **dict.fromkeys(
            ("message", "title", "label", "name", "description"),
            'what the operator reads is text, such as text = "Motor hot"',
        ),
        **dict.fromkeys(
            ("delay", "delay_s", "on_delay", "debounce", "debounce_s"),
            "it is raised after on_delay_s, such as on_delay_s = 2.0",
        ),
        **dict.fromkeys(
            ("max", "min", "above", "below", "limit", "limits", "threshold", "upper", "lower"), _LIMIT
        ),
        **dict.fromkeys(
            ("hysteresis", "dead_band"), "the hysteresis of a limit is deadband, such as deadband = 2"
        ),
        **dict.fromkeys(
            ("condition", "equals", "value", "trigger", "active", "if"),
            "a value that raises it is in a table of its own: [alarm.when] with topic, type and equals",
        ),
        **dict.fromkeys(
            ("lists", "of_list", "entries"),
            "the alarms of a robot's list are list = { topic, type, field } in an [[alarm]]",
        ),
        **dict.fromkeys(
            ("locks", "lock", "interlock", "blocks"),
            'the controls that it locks are inhibits, such as inhibits = ["start"]',
        ),
    },
    "widget": {
        **dict.fromkeys(
            ("decimals", "digits", "precision", "decimal_places"),
            'how many digits a number has is format, such as format = ".2f"',
        ),
        **dict.fromkeys(
            (
                "visible_if",
                "visible",
                "show_if",
                "hidden",
                "hide_if",
                "enabled",
                "enable_if",
                "disabled",
            ),
            'a widget is always on its page; what locks it is interlock, such as interlock = "ready"',
        ),
        **dict.fromkeys(
            ("width", "height", "w", "h", "x", "y", "col", "row", "colspan", "rowspan"),
            "its width is span, in twelfths of the page, and its height rows",
        ),
        **dict.fromkeys(
            ("color", "colour", "background", "style", "css"),
            "the colour of a button follows from its role, that of an indicator from its states",
        ),
    },
    "access": {
        **dict.fromkeys(
            ("timeout", "timeout_s", "timeout_min", "idle", "idle_min", "idle_minutes", "logout_s"),
            "after how long a user is signed out is idle_s, in seconds, such as idle_s = 600",
        ),
        **dict.fromkeys(("user", "users", "password", "passwords", "pin", "pins", "login"), _USERS),
    },
    "font": dict.fromkeys(("family", "name", "file", "files", "path", "src", "url"), _FONT),
    "robot": {
        **dict.fromkeys(("ip", "host", "hostname", "address", "endpoint", "url", "port"), _CONNECT),
        **dict.fromkeys(("prefix", "ns"), 'its namespace is namespace, such as namespace = "/robot1"'),
    },
    "overview": dict.fromkeys(
        ("widget", "widgets", "value", "figure"),
        "its figure is topic, type and field, or source, as those of a readout",
    ),
    "page": dict.fromkeys(("kind", "type"), _KIND),
}
# The keys that such a sentence names: none of them is reported as missing too.
ANSWERED: Final[Mapping[str, tuple[str, ...]]] = {
    "font": ("regular", "bold"),
    "overview": ("topic", "type"),
}


def other_key(table: str, key: str) -> str:
    """The sentence about a key that is not known in a table; "" for keys that no one writes there."""
    return OTHER_KEYS.get(table, {}).get(key.lower(), "")


# Adds line numbers and ids to places of a panel file.

MAX_ID: Final = 64
SAME: Final = "same"  # in place of an id: the widget is one of another page
_OWNER: Final = re.compile(
    r"(?:^|\.)(page|group|frame|widget|interlock|alarm|robot|source)(?:\[([0-9]+)\])?(?=\.|$)"
)
_WITH_ID: Final = ("page", "widget", "interlock", "alarm", "robot", "source")
_STEP: Final = re.compile(r'"([^"]*)"|([^.\[\]"]+)|\[([0-9]+)\]')
_LAST: Final = re.compile(r"(?:\[[0-9]+\]|\.?[^.\[\]]*)$")

# Ends a message about a second table with an id or a name; (1) is the place of the first.
_FIRST: Final = re.compile(r"is already the (?:id|name) of ([a-z_.]+(?:\[[0-9]+\][a-z_.]*)*)$")

AnyRemark = TypeVar("AnyRemark", bound=Remark)


def place_of(path: Path) -> str:
    """("page", 0, "widget", 2, "topic") → `page[0].widget[2].topic`."""
    place = ""
    for step in path:
        if isinstance(step, int):
            place += f"[{step}]"
            continue
        key = key_in_place(step)
        place += f".{key}" if place else key
    return place


def path_of(place: str) -> Path:
    """`page[0].widget[2].topic` → ("page", 0, "widget", 2, "topic"): the inverse of `place_of`."""
    return tuple(
        int(index) if index else quoted or bare for quoted, bare, index in _STEP.findall(place)
    )


LineOf = Callable[[str], int]  # the line of a place, or of the nearest place around it; 0 without one


def lines_in(text: str) -> LineOf:
    """The lines of the places of a text, which is read at the first call."""
    lines: dict[str, int] = {}

    def line_of(place: str) -> int:
        if not lines:
            for path, line in _lines(text).items():
                lines.setdefault(place_of(path), line)
        return _nearest_line(place, lines)

    return line_of


def add_locations(remarks: Iterable[AnyRemark], line_of: LineOf, tables: Any) -> Iterator[AnyRemark]:
    """The remarks with their ids and lines; `tables` is the parsed text."""
    for remark in remarks:
        place = remark.place
        known = remark.line or line_of(place)
        message = _FIRST.sub(lambda first: _with_line(first, line_of), remark.message)
        yield replace(remark, message=message, id=remark.id or id_at(place, tables), line=known)


def _with_line(first: re.Match[str], line_of: LineOf) -> str:
    """The place of the first of two tables, with its line."""
    line = line_of(first[1])
    return f"{first[0]}, line {line}" if line else first[0]


def id_at(place: str, tables: Any) -> str:
    """The id of the widget, page, interlock, alarm or robot around a place; "" without one."""
    known: Any = ""
    around = tables
    for name, index in _OWNER.findall(place):
        if name == "robot" and not index:  # a key of the table
            break
        try:
            around = around[name][int(index)] if index else around[name]
            known = around[SAME if SAME in around else "id"] if name in _WITH_ID else known
        except (LookupError, TypeError):
            return ""
        if name in ("widget", "alarm"):
            break
    is_valid = isinstance(known, str) and known.isprintable() and '"' not in known
    return known[:MAX_ID] if is_valid else ""


def _lines(text: str) -> dict[Path, int]:
    try:
        return lines_of(text)
    except RecursionError:  # too many nested brackets: reported without lines
        return {}


def _nearest_line(place: str, lines: Mapping[str, int]) -> int:
    """The line of a place, or of the nearest place around it; 0 without one."""
    while place and place not in lines:
        shorter = _LAST.sub("", place)
        place = shorter if shorter != place else place[:-1]  # in a quoted name
    return lines.get(place, 0)


# Keys of a panel file's tables that are unknown, missing or in the wrong table.

Model = type[BaseModel]

WHOLE_PAGE: Final = 2  # steps of its path
ITS_HEADER: Final = "is its header missing above?"


def widget_path(path: Path) -> Path:
    """The path of the widget's table that a path is in; empty without one."""
    for n, step in enumerate(path[:-1]):
        if step == "widget" and isinstance(path[n + 1], int):
            return path[: n + 2]
    return ()


@dataclass(frozen=True, slots=True)
class TableKeys:
    """The missing and unknown keys of one table. `around` is the table of the widget that it is in."""

    path: Path
    model: Model
    table: Mapping[str, Any]
    around: Mapping[str, Any] = field(default_factory=dict)
    missing: list[str] = field(default_factory=list)
    unknown: list[str] = field(default_factory=list)

    def fault(self, key: str, message: str) -> Fault:
        """A fault of a key or, if that is "", of the table."""
        return Fault(place_of((*self.path, key) if key else self.path), message)


@cache
def inner_model(model: Model, key: str | int) -> Model | None:
    """The description of a table under `key`; None if the key is no table."""
    for name, about in model.model_fields.items():
        if (about.alias or name) == key:
            return next((t for t in _types(about.annotation) if issubclass(t, BaseModel)), None)
    return None


def _types(annotation: Any) -> Iterator[type]:
    if isinstance(annotation, type) and not get_args(annotation):
        yield annotation
    for each in get_args(annotation):
        yield from _types(each)


def known_keys(model: Model) -> list[str]:
    """The keys of a description, the id first, and `source` where a source may stand in place of a
    topic."""
    keys = [about.alias or name for name, about in model.model_fields.items() if not about.exclude]
    keys.sort(key=lambda key: key != "id")
    return [*keys, SOURCE] if reads_source(model) else keys


def _required_keys(model: Model) -> set[str]:
    return {about.alias or name for name, about in model.model_fields.items() if about.is_required()}


Consequences = list[tuple[str, Fault]]  # (place, the fault that causes all others in it)


def key_faults(tables: Mapping[Path, TableKeys]) -> tuple[list[Fault], Consequences]:
    """The faults of tables (by path), and their consequences."""
    faults: list[Fault] = []
    follow: Consequences = []
    for table in tables.values():
        faults += _other_keys(table)
        faults += _misplaced_keys(table, tables)
        faults += _misspelt_keys(table, follow)
    for table in tables.values():
        faults += (
            _wrong_kind(table, follow) or _missing_header(table, follow) or _remaining_faults(table)
        )
    return faults, follow


def _other_keys(table: TableKeys) -> Iterator[Fault]:
    """Faults of keys that have another name here."""
    header = next((step for step in reversed(table.path) if isinstance(step, str)), "")
    hints = {key: other_key(header, key) for key in table.unknown}
    if not all(hints.values()) or _missing_header(table, []):
        return
    answered = ANSWERED.get(header, ()) if hints else ()
    table.missing[:] = [name for name in table.missing if name not in answered]
    table.unknown.clear()
    yield from (table.fault(key, f"unknown key; {hint}") for key, hint in hints.items())


def _misplaced_keys(table: TableKeys, tables: Mapping[Path, TableKeys]) -> Iterator[Fault]:
    """Faults of keys that belong to a table around this one."""
    path = table.path
    for key in list(table.unknown) if path else ():
        around = (tables[path[:n]] for n in range(len(path)) if path[:n] in tables)
        outer = next((candidate for candidate in around if key in candidate.missing), None)
        if outer is None and (
            key not in known_keys(Panel) or inner_model(Panel, key) or len(table.unknown) > 1
        ):
            continue
        table.unknown.remove(key)
        where = "the file itself: write it above the first table"
        if outer is not None:
            outer.missing.remove(key)
        if outer is not None and outer.path:
            names = ".".join(step for step in path[: len(outer.path) + 1] if isinstance(step, str))
            where = f"{place_of(outer.path)}: write it above its [[{names}]]"
        yield table.fault(key, f"unknown key; it belongs to {where}")


def _misspelt_keys(table: TableKeys, follow: Consequences) -> Iterator[Fault]:
    """Faults of unknown keys that are similar to a known one."""
    for key in list(table.unknown):
        meant = closest_name(key, table.missing) or closest_name(key, known_keys(table.model))
        if not meant:
            continue
        table.unknown.remove(key)
        if meant == SOURCE and reads_source(table.model):
            table.missing[:] = [name for name in table.missing if name not in known_keys(Source)]
        if meant in table.missing:
            table.missing.remove(meant)
        fault = table.fault(key, f'unknown key; did you mean "{meant}"?')
        if inner_model(table.model, meant):
            follow.append((place_of((*table.path, meant)), fault))
        yield fault


def _missing_header(table: TableKeys, follow: Consequences) -> list[Fault]:
    """A fault of keys of another table whose header is missing."""
    moved = _moved_keys(table)
    names = [name for name, model in _other_tables(table) if {*moved} <= set(known_keys(model))]
    if len(moved) < 2 or not names:
        return []
    fault = table.fault(moved[0], f"{_quote_names(moved)} are keys of {names[0]}: {ITS_HEADER}")
    around = widget_path(table.path) or table.path[:WHOLE_PAGE]
    follow += [(place_of(around), fault)] if table.path else []
    return [fault]


def _moved_keys(table: TableKeys) -> list[str]:
    """The unknown keys, and with them the topic of another type than those of the table: below their
    own header all of them would be good."""
    about = table.model.model_fields.get("type")
    types = get_args(about.annotation) if about is not None else ()
    is_other = bool(table.unknown and types) and table.table.get("type") not in (None, *types)
    if not is_other or not all(isinstance(each, str) for each in types):
        return table.unknown
    return [key for key in table.table if key in table.unknown or key in ("topic", "type")]


def _other_tables(table: TableKeys) -> Iterator[tuple[str, Model]]:
    """(name, description) of the tables that may be in this one, in its widget, then of all others of
    the file."""
    header = ".".join(step for step in table.path if isinstance(step, str))
    for key in known_keys(table.model):
        if key not in table.table and (model := inner_model(table.model, key)):
            yield (f"{header}.{key}" if header else key), model
    around = KINDS.get(str(table.around.get("kind")))
    beside = known_keys(around.model) if around is not None and table.around is not table.table else ()
    header = ".".join(step for step in widget_path(table.path) if isinstance(step, str))
    for key in sorted(beside, key=lambda key: key in table.around):
        if around is not None and (model := inner_model(around.model, key)):
            yield f"{header}.{key}", model
    for kind in KINDS.values():
        if table.path[-2:-1] != ("widget",):
            yield "[[page.widget]]", kind.model
        for key in known_keys(kind.model):
            if model := inner_model(kind.model, key):
                yield f"page.widget.{key}", model
    for key in known_keys(Panel):
        if model := inner_model(Panel, key):
            yield f'"{key}"', model


def _wrong_kind(table: TableKeys, follow: Consequences) -> list[Fault]:
    """A fault of a widget that has the keys of another kind."""
    keys = set(table.table)
    kinds = [
        name
        for name, kind in KINDS.items()
        if table.path[-2:-1] == ("widget",)
        and _required_keys(kind.model) <= keys <= set(known_keys(kind.model))
    ]
    if not kinds or not table.unknown:
        return []
    kind_text, listed = format_value(table.table["kind"]), _quote_names(kinds)
    if len(table.missing) + len(table.unknown) == 1:
        message = f"unknown key of {kind_text}; all the keys are those of {listed}"
        return [table.fault(table.unknown[0], message)]
    needs = f" and needs {_quote_names(table.missing)}" if table.missing else ""
    message = f"{kind_text} has no {_quote_names(table.unknown)}{needs}; the keys are those of {listed}"
    fault = table.fault("kind", message)
    follow.append((place_of(table.path), fault))
    return [fault]


def _remaining_faults(table: TableKeys) -> list[Fault]:
    """One fault for the remaining unknown keys, and one for the missing keys."""
    missing, unknown = table.missing, table.unknown
    here = f"known here: {', '.join(known_keys(table.model))}"
    if len(missing) == len(unknown) == 1:
        hint = f'is it the "{missing[0]}" that is missing? {here}'
        return [table.fault(unknown[0], f"unknown key; {hint}")]
    faults = []
    if unknown:
        more = f", as {_quote_names(unknown[1:])}" if len(unknown) > 1 else ""
        faults.append(table.fault(unknown[0], f"unknown key{more}; {here}"))
    if len(missing) == 1:
        model = table.model
        why = model.why_needed.get(missing[0]) if issubclass(model, BaseWidget) else None
        faults.append(table.fault(missing[0], f"is missing: {why}" if why else "is missing"))
    elif missing:
        faults.append(table.fault("", f"{_quote_names(missing)} are missing"))
    return faults


def _quote_names(names: Sequence[str]) -> str:
    """Quoted names with commas and an "and"."""
    *others, last = (f'"{name}"' for name in names)
    return f"{', '.join(others)} and {last}" if others else last
