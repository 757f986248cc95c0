"""The form of a table of a panel file, made from the JSON Schema of its models.

A `Form` is a value: its fields have what the file says, what counts without it, and the edits that a
browser posts (`POST /edits`). Every key of every table has a field; what needs more than a field can
show is the TOML text of its value.
"""

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from typing import Any, Final, Literal

from app.panel.file.keys import place_of
from app.panel.file.toml_lines import Path
from app.panel.reference.schema import REF, ROOT, SAME, WIDGET, Schema, of_kind, panel_schema
from app.panel.widgets.key_parts import COLOURS
from app.panel.widgets.kinds import KINDS
from app.ros.messages import Interfaces
from app.system.errors import InterfaceError, Remark
from app.system.pictures import icons
from app.system.texts import ENGLISH, TextLike, say
from app.system.texts.catalogue import files
from app.system.texts.locales import own_name
from app.system.toml_values import value_text
from app.tools.editor.form_keys import (
    BESIDE,
    BESIDE_BY_TABLE,
    COMMON,
    IN_THE_UNIT,
    LIMITS,
    LONG_TEXTS,
    ONLY_WITH_LIMITS,
    OPENED,
    PRIORITIES,
    RAISED_BY,
    REST,
    SECTIONS,
    SECTIONS_BY_TABLE,
    SECTIONS_OF_COMMANDS,
    Named,
    Tables,
    is_command,
    key_name,
    list_of,
    plain,
    references,
    table_name,
    title_of,
    unit_of,
    widgets,
)
from app.tools.editor.help import help_in, plain_words
from app.tools.editor.kinds import NAMES as KIND_NAMES

Edit = Mapping[str, Any]  # as `POST /edits` takes it
Edits = tuple[Edit, ...]

# How a field is shown.
Control = Literal[
    "text",  # one line
    "lines",  # several lines of one text
    "list",  # a text for each line
    "texts",  # a text for each language
    "number",
    "numbers",  # numbers with commas
    "literal",  # a text, a number or a bool
    "toml",  # the TOML text of a value
    "id",
    "kind",
    "choice",
    "ticks",
    "suggest",  # a text with suggestions
    "icon",
    "file",
    "colour",
    "fields",  # the fields of a message
    "table",  # a table within this one
    "rows",  # a list of tables within this one
    "opened",  # tables with forms of their own
]
# How a browser makes the value of an edit of what was typed.
Sends = Literal[
    "text", "number", "toml", "numbers", "literal", "list", "ticks", "json", "id", "key", ""
]
SENDS: Final[Mapping[Control, Sends]] = {
    "text": "text",
    "lines": "text",
    "list": "list",
    "texts": "text",
    "number": "number",
    "numbers": "numbers",
    "literal": "literal",
    "toml": "toml",
    "id": "id",
    "choice": "json",
    "ticks": "ticks",
    "suggest": "text",
    "icon": "text",
    "file": "text",
    "colour": "text",
}
EXACT: Final = 2.0**53  # the limit of every number in a browser; no limit that a form names
WORD: Final = re.compile(r"[a-z_]+")
LONG: Final = 200  # characters of a text from which on a field has several lines
FEW: Final = 4  # choices that stand side by side, if they are short
SHORT: Final = 8
PRIORITY: Final = 3  # of an alarm that says nothing
MOST_PATHS: Final = 400  # completed paths of a message
DEEP: Final = 5  # steps of a completed path
MESSAGES: Final = frozenset(  # keys with the fields of what is sent
    {
        *("message", "release", "on_message", "off_message"),
        *("request", "on_request", "off_request", "goal"),
    }
)
# Texts that would be read as something else without quotes.
PLAIN: Final = re.compile(r"""(true|false|[-+]?\.?[0-9].*|["'\[].*|\{[^=]*=.*|\{\s*\}|)""", re.DOTALL)
TWELFTHS: Final = 12  # columns of a group that says nothing
PEOPLE: Final = ("form_section_people", "form_section_lock")
PARTS: Final = {4: "¼", 2: "½", 1: ""}  # of a row; the whole is said in words


WORDS: Final = {
    "unset": say("form_unset"),
    "none": say("form_none"),
    "missing": say("form_missing"),
    "copy_text": say("form_copy_text"),
    "choose": say("form_choose"),
    "upload": say("form_upload"),
    "add": say("form_add"),
    "apply": say("form_apply"),
    "cancel": say("form_cancel"),
    "unused": say("form_unused"),
    "text": say("form_text_of_table"),
    "as_text": say("form_as_text"),
}


@dataclass(frozen=True, slots=True)
class RobotNames:
    """What is known of the robot: name → type of its topics, services and actions, its nodes, and the
    newest values as texts by (topic, field)."""

    topics: Mapping[str, str] = field(default_factory=dict)
    services: Mapping[str, str] = field(default_factory=dict)
    actions: Mapping[str, str] = field(default_factory=dict)
    nodes: Sequence[str] = ()
    values: Mapping[tuple[str, str], str] = field(default_factory=dict)


NO_ROBOT: Final = RobotNames()


@dataclass(frozen=True, slots=True)
class Choice:
    """A choice of a field: its value as JSON, what it is called, a colour or an icon as its picture."""

    value: Any
    text: TextLike
    chosen: bool = False
    picture: str = ""


@dataclass(frozen=True, slots=True)
class TextIn:
    """A text in a language. `around`: the rest of a table of texts that it would be in."""

    tag: str
    name: str
    path: Path
    text: str
    missing: bool
    ghost: str = ""
    around: Mapping[str, str] | None = None


@dataclass(frozen=True, slots=True)
class Act:
    """A button of a field: its word, an icon, the edits that it posts."""

    text: TextLike
    icon: str
    edits: Edits
    then: str = ""  # the element that has the focus afterwards
    opens: Path | None = None  # the table whose form comes afterwards


@dataclass(frozen=True, slots=True)
class Link:
    """A table with a form of its own."""

    path: Path
    text: str
    note: TextLike = ""
    acts: tuple[Act, ...] = ()


@dataclass(frozen=True, slots=True)
class Field:
    """A key of a table. `value` is what the file has as text ("" for nothing), `default` what counts
    without it. `help` is the reference's description. `suggestions` name a list of the form."""

    path: Path
    name: TextLike
    control: Control
    value: str = ""
    raw: Any = None
    default: str = ""
    unset: TextLike = ""  # what counts without it, in words
    help: str = ""
    label: str = ""  # of the step that an edit makes
    unit: str = ""
    limits: str = ""
    low: float | None = None
    high: float | None = None
    step: float = 1.0
    required: bool = False
    of_ids: bool = False  # its choices are ids of other tables
    by_edits: bool = False  # the value of a choice is a list of edits
    single: bool = False  # one ticked value is written without a list
    side_by_side: bool = False
    tall: bool = False  # its texts have several lines
    faults: tuple[str, ...] = ()
    choices: tuple[Choice, ...] = ()
    texts: tuple[TextIn, ...] = ()
    suggestions: str = ""
    type_path: Path | None = None  # a chosen name's type is written there
    rows: tuple["Form", ...] = ()
    inner: "Form | None" = None
    links: tuple[Link, ...] = ()
    acts: tuple[Act, ...] = ()
    add_path: Path | None = None  # a typed key is added below
    folder: str = ""
    beside: "Field | None" = None  # in the same row

    @property
    def key(self) -> str:
        return str(self.path[-1])

    @property
    def dom(self) -> str:
        """The id of its element."""
        return element_id(self.path)

    @property
    def plain_help(self) -> str:
        """The description without its marks of Markdown."""
        return plain_words(self.help)

    @property
    def sends(self) -> Sends:
        is_chosen_file = self.control == "file" and self.choices
        return "json" if is_chosen_file else SENDS.get(self.control, "")

    @property
    def is_set(self) -> bool:
        return self.raw is not None

    @property
    def is_bad(self) -> bool:
        """Whether it has a fault, or has to be filled in."""
        return bool(self.faults) or (self.required and not self.is_set and not self.default)


@dataclass(frozen=True, slots=True)
class FormSection:
    """Fields under a title, with a note beside it. It is folded where `folded` says how many keys."""

    title: TextLike
    fields: tuple[Field, ...]
    note: TextLike = ""
    code: str = ""
    folded: bool = False


@dataclass(frozen=True, slots=True)
class Tab:
    text: TextLike
    path: Path
    view: str = "form"
    chosen: bool = False


@dataclass(frozen=True, slots=True)
class KindChange:
    """What happens if a widget becomes another kind: keys that go, keys that are needed then."""

    kind: str
    goes: tuple[str, ...]
    needs: tuple[str, ...]
    edits: Edits


@dataclass(frozen=True, slots=True)
class Form:
    """The form of the table at `path`; `table` is its name in the reference. `suggestions`: the lists
    that its fields name, each of (name, note). `acts` are those of a row in a list."""

    path: Path
    table: str
    title: str
    note: TextLike
    sections: tuple[FormSection, ...]
    tabs: tuple[Tab, ...] = ()
    faults: tuple[str, ...] = ()
    suggestions: Mapping[str, tuple[tuple[str, str], ...]] = field(default_factory=dict)
    acts: tuple[Act, ...] = ()
    change: KindChange | None = None
    help: str = ""

    @property
    def dom(self) -> str:
        """The id of its element."""
        return element_id(self.path)

    @property
    def plain_help(self) -> str:
        return plain_words(self.help)

    @property
    def needed(self) -> str:
        """The id of the field that is filled in first: one that is faulty or required, else the first
        key that a fault asks for, else the first text; "" for none."""
        fields = tuple(self.fields)
        asked = [key for fault in self.faults for key in WORD.findall(fault.rpartition(": ")[2])]
        named = sorted((asked.index(each.key), each.dom) for each in fields if each.key in asked)
        first = (each.dom for each in fields if each.is_bad)
        texts = (each.dom for each in fields if each.control in ("texts", "text"))
        return next(first, next((dom for _, dom in named), next(texts, "")))

    @property
    def fields(self) -> Iterator[Field]:
        """Its fields, with those of tables within it."""
        for section in self.sections:
            for each in section.fields:
                yield each
                if each.beside is not None:
                    yield each.beside
                for form in (*each.rows, *((each.inner,) if each.inner else ())):
                    yield from form.fields


def element_id(path: Path) -> str:
    """The id of the element of what is at a path."""
    return f"form-{place_of(path).replace(' ', '_')}"


@dataclass(frozen=True, slots=True)
class FormPage:
    """What the pane shows beside the form: which `view` of the table, its text and lines, the tables
    that refer to it, the field whose pictures are open."""

    view: str = "form"
    text: str = ""
    lines: tuple[int, int] = (0, 0)
    used: tuple[Link, ...] = ()
    pick: Path | None = None


def form_context(form: Form, page: FormPage) -> dict[str, Any]:
    """The variables of `editor/_form.html`."""
    change = form.change
    tabs = tuple(
        replace(tab, chosen=(tab.chosen and page.view == "form") or tab.view == page.view != "form")
        for tab in form.tabs
    )
    return {
        "form": replace(form, tabs=tabs),
        "view": page.view,
        "text": page.text,
        "lines": say("form_lines", first=page.lines[0], last=page.lines[1]),
        "used": page.used,
        "used_by": len(page.used),
        "used_text": say("form_used_by", number=len(page.used)),
        "pick": page.pick,
        "icons": icons(),
        "missing_text": lambda name: say("form_missing_text", language=name),
        "change_goes": say("form_change_goes", keys=", ".join(change.goes)) if change else "",
        "change_needs": say("form_change_needs", keys=", ".join(change.needs)) if change else "",
        "words": WORDS,
    }


class NoTableError(LookupError):
    """There is no table at a path."""


def form_of(
    tables: Tables,
    path: Path,
    *,
    interfaces: Interfaces | None = None,
    robot: RobotNames = NO_ROBOT,
    faults: Sequence[Remark] = (),
    language: str = ENGLISH,
    pictures: Sequence[str] = (),
    kind: str = "",
    used_by: int | None = None,
) -> Form:
    """The form of the table at `path` of a panel file, or of the nearest table around it. `faults` are
    those of `check`, `pictures` the names of the pictures that a panel may show, `kind` another kind
    that its reader thinks of, `used_by` how many tables refer to it."""
    path = table_path(tables, path)
    made = _Maker(tables, interfaces, robot, faults, language, pictures)
    form = made.form(path)
    change = None
    if kind and form.table in _kind_tables() and kind != form.table:
        change = kind_change(tables, path, kind)
    tabs = tabs_of(tables, path, used_by=used_by)
    return replace(form, tabs=tabs, suggestions=made.suggestions, change=change)


@cache
def schema() -> Mapping[str, Schema]:
    """The tables of a panel file by their names in the reference."""
    whole = panel_schema()
    return {ROOT: whole, **whole["definitions"]}


@cache
def _kind_tables() -> Mapping[str, str]:
    """Kind → table, for each kind of widget."""
    return {kind: of_kind(kind) or kind for kind in KINDS}


def value_at(tables: Any, path: Path) -> Any:
    """What the file has at a path; None for nothing."""
    for step in path:
        try:
            tables = tables[step]
        except (KeyError, IndexError, TypeError):
            return None
    return tables


def table_path(tables: Tables, path: Path) -> Path:
    """The path of the nearest table with a form at a path, or around it."""
    for end in range(len(path), 0, -1):
        value = value_at(tables, path[:end])
        if value is None or isinstance(value, dict):
            try:
                name = table_at(tables, path[:end])
            except NoTableError:
                continue
            step = path[end - 1]
            is_single = name in OPENED and isinstance(step, str) and not _is_list(tables, path[:end])
            if isinstance(value, dict) or is_single:
                return path[:end]
    return ()


def _is_list(tables: Tables, path: Path) -> bool:
    """Whether the key at a path has a list of tables."""
    prop = schema()[table_at(tables, path[:-1])]["properties"].get(path[-1], {})
    return bool(prop.get("type") == "array")


def table_at(tables: Tables, path: Path) -> str:
    """The name of the table at a path, as the reference has it; NoTableError where it knows none."""
    name = ROOT
    value: Any = tables
    for number, step in enumerate(path):
        value = value_at(value, (step,))
        if isinstance(step, int):
            continue
        above = path[number - 1] if number else None
        inner = _inner(schema()[name]["properties"].get(step, {}))
        if (
            inner is None
            and above is not None
            and _by_name(schema()[name]["properties"].get(above, {}))
        ):
            continue
        if inner is None and name in ("demo", "texts") and isinstance(above, str):
            continue
        if inner is None:
            raise NoTableError(place_of(path))
        name = inner
        if name == WIDGET:
            index = path[number + 1] if number + 1 < len(path) else 0
            name = _widget_table(value_at(value, (index,)))
    return name


def _widget_table(table: Any) -> str:
    """The table of a widget: by its kind, `same`, or `widget` where neither is known."""
    if isinstance(table, dict):
        if SAME in table:
            return SAME
        return _kind_tables().get(str(table.get("kind")), WIDGET)
    return WIDGET


def _inner(prop: Schema) -> str | None:
    """The name of the table that a key has, or has a list or a table of."""
    options = [prop, prop.get("items"), prop.get("additionalProperties"), *prop.get("anyOf", ())]
    refs = (option["$ref"] for option in options if isinstance(option, dict) and "$ref" in option)
    return next((ref.removeprefix(REF) for ref in refs), None)


def _by_name(prop: Schema) -> bool:
    inner = prop.get("additionalProperties")
    return isinstance(inner, dict) and ("$ref" in inner or "anyOf" in inner)


def tabs_of(
    tables: Tables, path: Path, view: str = "form", used_by: int | None = None
) -> tuple[Tab, ...]:
    """The tabs above a form: of a widget, a group and a page those around it, of others who uses it and
    its text."""
    around = [path[:end] for end in range(2, len(path) + 1, 2)]
    names = ("page", "group", "widget")
    if path and path[0] in ("page", "frame") and (path[0] == "frame" or len(path) % 2 == 0):
        if path[0] == "frame":
            around = [path[:1], *([path] if len(path) > 1 else ())]
            words = ["frame", "widget"]
        else:
            words = [str(each[-2]) for each in around]
            around = [each for each, word in zip(around, words, strict=True) if word in names]
        tabs = [
            Tab(table_name(word), each, chosen=each == path and view == "form")
            for each, word in zip(around, words, strict=False)
        ]
        return (*reversed(tabs), Tab(table_name(ROOT), ()))
    own = Tab(table_name(str(_last_name(path))), path, chosen=view == "form")
    used = () if not used_by else (Tab(say("form_used_by", number=used_by), path, "used"),)
    shown = (own, *used, Tab(say("form_as_text"), path, "text"))
    return tuple(replace(tab, chosen=tab.view == view) for tab in shown)


def _last_name(path: Path) -> str:
    return next((step for step in reversed(path) if isinstance(step, str)), ROOT)


def kind_change(tables: Tables, path: Path, kind: str) -> KindChange:
    """What a widget keeps, loses and needs as another kind."""
    table = value_at(tables, path) or {}
    known = schema()[_kind_tables()[kind]]
    goes = tuple(key for key in table if key not in known["properties"])
    needs = tuple(key for key in known.get("required", ()) if key not in table)
    edits = [{"op": "set", "path": [*path, "kind"], "value": kind}]
    edits += [{"op": "delete", "path": [*path, key]} for key in goes]
    return KindChange(kind, goes, needs, tuple(edits))


def new_table(tables: Tables, name: str, key: str = "") -> dict[str, Any]:
    """The keys that a new table begins with: an id that no other has, and the first of required
    choices. The others are missing until they are typed."""
    properties = schema()[name]["properties"]
    made: dict[str, Any] = {}
    for needed in schema()[name].get("required", ()):
        prop = properties[needed]
        if needed == "id":
            made["id"] = new_id(tables, key or name)
        elif "const" in prop:
            made[needed] = prop["const"]
        elif "enum" in prop:
            made[needed] = prop["enum"][0]
    return made


def new_id(tables: Tables, name: str) -> str:
    """An id that no table of the file has."""
    known = set(_ids(tables))
    number = 1
    while f"{name}_{number}" in known:
        number += 1
    return f"{name}_{number}"


def _ids(value: Any) -> Iterator[str]:
    if isinstance(value, dict):
        if isinstance(value.get("id"), str):
            yield value["id"]
        for each in value.values():
            yield from _ids(each)
    elif isinstance(value, list):
        for each in value:
            yield from _ids(each)


def panel_languages(tables: Tables) -> tuple[str, ...]:
    """The languages whose texts a form shows: the file's, else its own and those of its texts."""
    own = tables.get("language", ENGLISH)
    listed = tables.get("languages")
    known = [tag for tag in listed if isinstance(tag, str)] if isinstance(listed, list) else []
    tags = known or [own if isinstance(own, str) else ENGLISH, *sorted(set(_tags(tables)))]
    return tuple(dict.fromkeys(tags))


def _tags(value: Any) -> Iterator[str]:
    """The languages of the tables of texts."""
    if isinstance(value, dict):
        if value and all(tag in files() and isinstance(text, str) for tag, text in value.items()):
            yield from value
        for each in value.values():
            yield from _tags(each)
    elif isinstance(value, list):
        for each in value:
            yield from _tags(each)


def field_paths(interfaces: Interfaces, type_name: str) -> Iterator[tuple[str, str]]:
    """(path, type) of the fields of a message: single values, and lists as a whole."""
    structures = interfaces.structures

    def walk(name: str, before: str, depth: int) -> Iterator[tuple[str, str]]:
        for each in structures[name].fields if name in structures else ():
            path = f"{before}{each.name}"
            if each.type.is_nested and str(each.type) == each.type.name:
                if depth < DEEP:
                    yield from walk(each.type.name, f"{path}.", depth + 1)
            else:
                yield path, str(each.type)
                if each.type.is_nested and depth < DEEP:
                    yield from walk(each.type.name, f"{path}[0].", depth + 1)

    for number, found_path in enumerate(walk(type_name, "", 1)):
        if number == MOST_PATHS:
            return
        yield found_path


class _Maker:
    """Makes the forms of one file. `suggestions` collects the lists that fields name."""

    def __init__(
        self,
        tables: Tables,
        interfaces: Interfaces | None,
        robot: RobotNames,
        faults: Sequence[Remark],
        language: str,
        pictures: Sequence[str] = (),
    ) -> None:
        self.tables = tables
        self.interfaces = interfaces
        self.robot = robot
        self.faults = faults
        self.language = language
        self.pictures = pictures
        self.languages = panel_languages(tables)
        self.suggestions: dict[str, tuple[tuple[str, str], ...]] = {}

    def form(self, path: Path, acts: tuple[Act, ...] = ()) -> Form:
        table = value_at(self.tables, path)
        name = table_at(self.tables, path)
        if not isinstance(table, dict):
            table = {}  # of a table that the file does not have yet
        known = schema()[name]
        needed = list(known.get("required", ()))
        for option in known.get("anyOf", ())[1:]:
            needed += option.get("required", ())
        if "source" in table:
            needed = [key for key in needed if key not in ("topic", "type", "states")]
        fields: dict[str, Field] = {}
        for key, prop in known["properties"].items():
            fields[key] = self.field((*path, key), name, table, prop, required=key in needed)
        for key in table:
            if key not in fields:
                fields[key] = self.unknown((*path, key), table[key])
        return Form(
            path,
            name,
            title_of(table, self.language) if path else plain(table.get("title"), self.language),
            self._note(path, name, table),
            tuple(self._sections(name, table, fields, path, is_row=bool(acts))),
            faults=self._faults_at(path),
            acts=acts,
            help=help_in(str(known.get("description", "")), self.language),
        )

    def _note(self, path: Path, name: str, table: Mapping[str, Any]) -> TextLike:
        if "widget" in path[-2:]:
            kind = plain(table.get("kind"))
            return KIND_NAMES.get(kind, kind)
        return table_name(name)

    def _sections(
        self,
        name: str,
        table: Mapping[str, Any],
        fields: dict[str, Field],
        path: Path,
        *,
        is_row: bool,
    ) -> Iterator[FormSection]:
        usual = SECTIONS_OF_COMMANDS if is_command(name) else SECTIONS
        rules = SECTIONS_BY_TABLE.get(name, usual)
        placed = {key for rule in rules for key in rule.keys}
        begins: list[str] = [key for key in ("id", "kind", SAME) if key in fields]
        others = [key for key in fields if key not in placed and key not in begins]
        others.sort(key=lambda key: _order(fields[key]))
        if begins and rules[0].title != "form_section_label":
            head = {str(key): fields[key] for key in begins}
            yield FormSection("", tuple(_paired(head, fields, BESIDE)))
            begins = []
        folded: list[Field] = []
        hidden: set[str] = set()
        if name == "alarm":
            hidden = {key for key in _other_keys(table) if key not in table and not fields[key].faults}
            if not any(key in table for key in LIMITS):  # what raises it comes first
                rules = tuple(sorted(rules, key=lambda rule: rule.keys != REST))
        if any(key in table for key in ("topic", "service", "action")) and "type" in table:
            hidden |= set() if fields["type"].faults else {"type"}  # it stands beside the name
        for number, rule in enumerate(rules):
            keys = [key for key in rule.keys or others if key in fields]
            keys = [*begins, *keys] if number == 0 else keys
            shown = {key: fields[key] for key in keys if _is_shown(fields[key]) and key not in hidden}
            folded += [fields[key] for key in keys if key not in shown]
            rows = [*_paired(shown, fields, BESIDE_BY_TABLE.get(name, BESIDE))]
            if rule.title == "form_section_place" and "widget" in path[-2:]:
                rows = [*self._place(path), *rows]
            if rule in usual and rule.title in PEOPLE and (alarms := self._alarms(path, table)):
                rows = [alarms, *rows]
            if name == "interlock" and rule.title == "form_locks":
                rows = [*self._locks(path, table), *rows]
            if rows:
                note = self._live(table) if not rule.keys else self._languages_of(rows)
                yield FormSection(say(rule.title), tuple(rows), note, rule.title)
        beside = {each.key for each in folded} & {*BESIDE_BY_TABLE.get(name, {}).values()}
        folded = [each for each in folded if each.key not in beside or name != "alarm" or hidden]
        if len(path) > 1 and path[-2] != "widget" and not is_row and (order := self._order_of(path)):
            yield FormSection("", (order,))
        if folded:
            title = say("form_more_keys", number=len(folded))
            yield FormSection(title, tuple(folded), folded=True)

    def _alarms(self, path: Path, table: Mapping[str, Any]) -> Field | None:
        """The alarms of the value that a widget shows."""
        links = []
        for number, alarm in enumerate(list_of(self.tables.get("alarm"))):
            names = [key for key in ("topic", "source") if key in table and key in alarm]
            if any(alarm[key] == table[key] for key in names) and "widget" in path[-2:]:
                code = PRIORITIES.get(alarm.get("priority", PRIORITY))
                links.append(Link(("alarm", number), title_of(alarm), say(code) if code else ""))
        if not links:
            return None
        name = table_name("alarm")
        return Field((*path, "alarm"), name, "opened", raw=links, links=tuple(links))

    def _live(self, table: Mapping[str, Any]) -> TextLike:
        """The newest value of what the table reads."""
        value = self.robot.values.get((str(table.get("topic")), str(table.get("field", "data"))))
        return say("form_now", value=value) if value else ""

    def _languages_of(self, shown: Sequence[Field]) -> TextLike:
        texts = next((each.texts for each in shown if each.texts), ())
        if not any(text.missing for text in texts):
            return ""
        there = sum(not text.missing for text in texts)
        return say("form_languages_there", number=there, all=len(texts))

    def _place(self, path: Path) -> Iterator[Field]:
        """Where a widget is: its group, its place there."""
        *above, index = path
        assert isinstance(index, int)
        siblings = value_at(self.tables, tuple(above)) or []
        count = len(siblings)
        if path[0] == "page":
            page = path[:2]
            choices = [Choice([*page, "widget"], say("form_no_group"), above == [*page, "widget"])]
            for number, group in enumerate(list_of(value_at(self.tables, (*page, "group")))):
                at = [*page, "group", number, "widget"]
                text = plain(group.get("title"), self.language) or f"{number + 1}"
                choices.append(Choice(at, text, above == at))
            yield Field(
                (*path, "group"),
                table_name("group"),
                "choice",
                raw=above,
                choices=tuple(self._moves(path, choices)),
                unit=f"{index + 1} / {count}",
                by_edits=True,
                required=True,
            )
        if order := self._order_of(path):
            yield order

    def _order_of(self, path: Path) -> Field | None:
        """The buttons that move, copy and remove a table of a list; None for others."""
        *above, index = path
        listed = value_at(self.tables, tuple(above))
        if not isinstance(index, int) or not isinstance(listed, list) or index >= len(listed):
            return None
        acts = []
        for to, word, icon_name in (
            (index - 1, "form_move_up", "arrow-up"),
            (index + 1, "form_move_down", "arrow-down"),
        ):
            edits: Edits = ()
            if 0 <= to < len(listed):
                edits = ({"op": "move", "path": [*path], "to": [*above, to]},)
            acts.append(Act(say(word), icon_name, edits))
        acts.append(
            Act(
                say("form_duplicate"),
                "copy",
                ({"op": "duplicate", "path": [*path], "to": [*above, index + 1]},),
            )
        )
        acts.append(Act(say("form_remove"), "x", ({"op": "delete", "path": [*path]},)))
        return Field(path, say("form_order"), "opened", raw=index, acts=tuple(acts), required=True)

    def _locks(self, path: Path, table: Mapping[str, Any]) -> Iterator[Field]:
        """The commands that an interlock locks, and those that it may lock too."""
        own = plain(table.get("id"))
        links, choices = [], []
        for at, widget in widgets(self.tables):
            known = _strings(widget.get("interlock"))
            if own and own in known:
                links.append(Link(at, title_of(widget), plain(widget.get("label"), self.language)))
            elif own and is_command(_kind_tables().get(str(widget.get("kind")), "")):
                value = [*known, own] if known else own
                edit = {"op": "set", "path": [*at, "interlock"], "value": value}
                choices.append(Choice([edit], title_of(widget)))
        name = say("form_locks")
        if links:
            yield Field((*path, "locks"), name, "opened", raw=links, links=tuple(links))
        if choices:
            unset = say("form_lock_another" if links else "form_locks_nothing")
            yield Field(
                (*path, "lock"),
                "" if links else name,
                "choice",
                unset=unset,
                choices=tuple(choices),
                by_edits=True,
            )

    def _moves(self, path: Path, choices: Sequence[Choice]) -> Iterator[Choice]:
        for choice in choices:
            count = len(value_at(self.tables, tuple(choice.value)) or [])
            to = [*choice.value, count]
            edits = [] if choice.chosen else [{"op": "move", "path": [*path], "to": to}]
            yield replace(choice, value=edits)

    def field(
        self, path: Path, name: str, table: Mapping[str, Any], prop: Schema, *, required: bool
    ) -> Field:
        key = str(path[-1])
        made = self._control(path, name, table, prop)
        default = prop.get("default")
        help_text = help_in(str(prop.get("description", "")), self.language)
        limits, low, high = _limits(prop)
        own_unit = plain(table.get("unit"), self.language) if key in IN_THE_UNIT else ""
        return replace(
            made,
            name=key_name(key, name),
            raw=table.get(key),
            default=made.default or ("" if default is None else _shown(default)),
            unset=_unset(name, key) or _default_choice(made, default),
            help=help_text,
            label=f"{title_of(table, self.language)}: {key}".removeprefix(": "),
            unit=unit_of(key) or own_unit or self._type_beside(path, name, table),
            limits=limits,
            low=low,
            high=high,
            step=1.0 if prop.get("type") == "integer" else _step(table.get(key)),
            required=required,
            faults=made.faults or self._faults_of(path, made),
        )

    def _type_beside(self, path: Path, name: str, table: Mapping[str, Any]) -> str:
        """The type of a topic or field, as it stands beside it."""
        key = path[-1]
        if key in ("topic", "service", "action") and "type" in schema()[name]["properties"]:
            return plain(table.get("type")).rpartition("/")[2]
        if key == "field" and self.interfaces is not None:
            type_name, before = self._type_for(path, name, table)
            read = plain(table.get("field")) or plain(self._source(table).get("field"))
            default = schema()[name]["properties"]["field"].get("default", "")
            try:
                return self.interfaces.field_type(type_name, before + (read or str(default)))
            except InterfaceError:
                return ""
        return ""

    def unknown(self, path: Path, value: Any) -> Field:
        """A key that the table does not know: its text, and a button that removes it."""
        remove = Act(say("form_remove"), "x", ({"op": "delete", "path": [*path]},))
        return Field(
            path,
            str(path[-1]),
            "toml",
            value=value_text(value),
            raw=value,
            faults=self._faults_of(path, None),
            acts=(remove,),
        )

    # The control of a key, by its schema.

    def _control(self, path: Path, name: str, table: Mapping[str, Any], prop: Schema) -> Field:
        key, value = str(path[-1]), table.get(str(path[-1]))
        if name == WIDGET and key not in ("id", "kind", "label"):
            prop = {}
        if key == "id":
            return Field(path, "", "id", value=plain(value))
        if key == "kind" and (name in _kind_tables().values() or name == WIDGET):
            kinds = tuple(Choice(kind, _kind_text(kind), kind == value) for kind in KINDS)
            return Field(path, "", "kind", value=plain(value), choices=kinds)
        inner = _inner(prop)
        if inner is not None:
            return self._nested(path, inner, value, prop)
        if key == "texts" and name == ROOT:
            return self._named(path, "texts", value)
        if (names := references(name, key)) is not None:
            ids = self._reference(path, value, names, prop)
            return replace(ids, acts=self._new_lock(path, ids)) if key == "interlock" else ids
        if key in ("priority", "critical_priority", "priorities", "sound_priorities") and (
            prop.get("type") in ("integer", "array")
        ):
            return self._priority(path, value, prop)
        if key == "colour" and "enum" in prop and table.get("kind") is not None:
            role = table.get("role", "neutral")
            usual = COLOURS.get(role, tuple(prop["enum"]))
            return _choices(path, value, [*usual, *([value] if value not in (None, *usual) else ())])
        if key in ("colour",) and "enum" in prop:
            return _choices(path, value, prop["enum"])
        if key == "span" and "widget" in path[-3:]:
            return self._width(path, value)
        return self._plain(path, name, table, prop)

    def _plain(self, path: Path, name: str, table: Mapping[str, Any], prop: Schema) -> Field:
        value = table.get(str(path[-1]))
        options = prop.get("anyOf", ())
        kinds = {option.get("type") for option in options}
        if any("additionalProperties" in option for option in options):
            tall = path[-1] in LONG_TEXTS or "\n" in _texts_in(value)
            return replace(self._texts(path, value), tall=tall)
        if options and any("enum" in option for option in options):  # true, false, "pin"
            values = [v for o in options for v in o.get("enum", [False, True])]
            return _choices(path, value, values)
        if "array" in kinds:
            return Field(path, "", "list", value="\n".join(_strings(value)))
        if options:
            return Field(path, "", "literal", value=_literal(value))
        if "enum" in prop:
            return _choices(path, value, prop["enum"])
        if "const" in prop:
            return _choices(path, value, [prop["const"]])
        match prop.get("type"):
            case "boolean":
                return _choices(path, value, [False, True])
            case "integer" | "number":
                return Field(path, "", "number", value="" if value is None else _shown(value))
            case "array":
                return self._list(path, name, table, value, prop["items"])
            case "object":
                return self._message(path, name, table, value, prop)
            case "string":
                return self._text(path, name, table, value, prop)
        control: Control = "toml" if isinstance(value, dict | list) else "literal"
        return Field(path, "", control, value=_literal(value))

    def _text(self, path: Path, name: str, table: Mapping[str, Any], value: Any, prop: Schema) -> Field:
        title = prop.get("title", "")
        shown = plain(value) if isinstance(value, str) else _literal(value)
        if title == "name of an icon":
            return Field(path, "", "icon", value=shown)
        if title == "file" or "svg|png" in prop.get("pattern", ""):
            if title == "file":
                return Field(path, "", "file", value=shown)
            known = dict.fromkeys((*self.pictures, *([shown] if shown else ())))
            choices = tuple(Choice(each, each, each == value) for each in known)
            return Field(path, "", "file", value=shown, choices=choices, folder="pictures")
        if prop.get("pattern", "").startswith("^#[0-9a-f"):
            return Field(path, "", "colour", value=shown)
        if suggested := self._suggested(path, name, table, title):
            wants_type = title in ("topic name", "service name", "action name")
            has_type = wants_type and "type" in schema()[name]["properties"]
            at = (*path[:-1], "type") if has_type else None
            return Field(path, "", "suggest", value=shown, suggestions=suggested, type_path=at)
        long = prop.get("maxLength", 0) >= LONG and not title and "pattern" not in prop
        return Field(path, "", "lines" if long or "\n" in shown else "text", value=shown)

    def _suggested(self, path: Path, name: str, table: Mapping[str, Any], title: str) -> str:
        """The name of the list of suggestions for a text with this format; "" for none."""
        match title:
            case "topic name":
                return self._suggest("topics", _merged(self._used("topic"), self.robot.topics))
            case "service name":
                return self._suggest("services", _merged(self._used("service"), self.robot.services))
            case "action name":
                return self._suggest("actions", _merged(self._used("action"), self.robot.actions))
            case "node name":
                known = {node: "" for node in self.robot.nodes}
                return self._suggest("nodes", _merged(self._used("node"), known))
            case "message type" | "service type" | "action type" | "message or service type":
                return self._suggest_types(title)
            case "field path":
                return self._suggest_fields(path, name, table)
        return ""

    def _suggest(self, name: str, known: Mapping[str, str]) -> str:
        self.suggestions.setdefault(name, tuple(sorted(known.items())))
        return name

    def _used(self, key: str) -> Mapping[str, str]:
        """Name → type of the topics, services or actions that the file names."""
        return dict(_names_in(self.tables, key))

    def _suggest_types(self, title: str) -> str:
        name = title.replace(" ", "-")
        if name not in self.suggestions and self.interfaces is not None:
            self.suggestions[name] = tuple(
                (each, "") for each in sorted(types_of(self.interfaces, title))
            )
        return name if name in self.suggestions else ""

    def _suggest_fields(self, path: Path, name: str, table: Mapping[str, Any]) -> str:
        type_name, before = self._type_for(path, name, table)
        if not type_name or self.interfaces is None:
            return ""
        listed = f"fields-{type_name}-{before}".replace("/", "-")
        if listed not in self.suggestions:
            topic = str(table.get("topic") or self._source(table).get("topic"))
            known = [
                (each.removeprefix(before), self.robot.values.get((topic, each)) or kind)
                for each, kind in field_paths(self.interfaces, type_name)
                if each.startswith(before)
            ]
            self.suggestions[listed] = tuple(known)
        return listed if self.suggestions[listed] else ""

    def _source(self, table: Mapping[str, Any]) -> Mapping[str, Any]:
        name = table.get("source")
        sources = list_of(self.tables.get("source"))
        return next((each for each in sources if each.get("id") == name), {}) if name else {}

    def _type_for(self, path: Path, name: str, table: Mapping[str, Any]) -> tuple[str, str]:
        """The message that a field's path is in, and what stands before the path in it."""
        key = path[-1]
        around: Mapping[str, Any] = table
        at = path[:-1]
        while "type" not in around and not self._source(around) and at:
            at = at[:-1]
            value = value_at(self.tables, at)
            around = value if isinstance(value, dict) else {}
        type_name = str(around.get("type") or self._source(around).get("type") or "")
        if not type_name:
            default = schema()[name]["properties"].get("type", {}).get("default", "")
            type_name = str(default)
        if key in ("success", "message") and "/srv/" in type_name:
            return f"{type_name}_Response", ""
        if key == "progress":
            return f"{type_name}_Feedback", ""
        if name in ("column", "list") and not (name == "list" and key == "field"):
            listed = table.get("field") if name == "list" else around.get("field")
            return type_name, f"{listed}[0]."
        return type_name, ""

    def _list(
        self, path: Path, name: str, table: Mapping[str, Any], value: Any, items: Schema
    ) -> Field:
        kind = items.get("type")
        if kind == "string" and "enum" in items:
            return self._ticks(path, value, [Named(each, _tick_name(each)) for each in items["enum"]])
        if kind == "string":
            if items.get("title") == "topic name":
                topics = self._used("topic")
                return self._ticks(path, value, [Named(each, topics[each]) for each in sorted(topics)])
            return Field(path, "", "list", value="\n".join(_strings(value)))
        if kind in ("number", "integer"):
            numbers = value if isinstance(value, list) else ()
            return Field(path, "", "numbers", value=", ".join(map(_shown, numbers)))
        return Field(path, "", "toml", value="" if value is None else value_text(value))

    def _texts(self, path: Path, value: Any) -> Field:
        """A text in the languages of the panel."""
        if not isinstance(value, dict):
            shown = plain(value) if isinstance(value, str | None) else _literal(value)
            if len(self.languages) < 2 or not isinstance(value, str):
                single = TextIn("", "", path, shown, missing=False)
                return Field(path, "", "texts", value=shown, texts=(single,))
            own_tag = str(self.tables.get("language", ENGLISH))
            texts = [TextIn(own_tag, _tag_name(own_tag), path, shown, missing=False)]
            for tag in self.languages:
                if tag != own_tag:
                    around = {own_tag: shown} if shown else {}
                    at = TextIn(
                        tag, _tag_name(tag), path, "", missing=False, ghost=shown, around=around
                    )
                    texts.append(at)
            return Field(path, "", "texts", value=shown, texts=tuple(texts))
        tags = dict.fromkeys((*self.languages, *map(str, value)))
        own = plain(value, str(self.tables.get("language", ENGLISH)))
        texts = [
            TextIn(
                tag,
                _tag_name(tag),
                (*path, tag),
                plain(value.get(tag)),
                missing=tag not in value,
                ghost=own,
            )
            for tag in tags
        ]
        return Field(path, "", "texts", value=own, texts=tuple(texts))

    def _reference(self, path: Path, value: Any, names: Any, prop: Schema) -> Field:
        known = list({each.id: each for each in names(self.tables)}.values())
        several = prop.get("type") == "array" or any(
            option.get("type") == "array" for option in prop.get("anyOf", ())
        )
        if several:
            ticks = self._ticks(path, value, known, single="anyOf" in prop)
            return replace(ticks, of_ids=True)
        ids = [each.id for each in known]
        if isinstance(value, str) and value not in ids:
            known.append(Named(value, say("form_not_in_file")))
        choices = [Choice(each.id, _id_text(each), each.id == value) for each in known]
        return Field(path, "", "choice", value=plain(value), choices=tuple(choices), of_ids=True)

    def _new_lock(self, path: Path, ids: Field) -> tuple[Act, ...]:
        """The button that adds an interlock to the file, which locks this command."""
        listed = list_of(self.tables.get("interlock"))
        made = new_id(self.tables, "interlock")
        ticked = [choice.value for choice in ids.choices if choice.chosen]
        edits: Edits = (
            {"op": "insert", "path": ["interlock", len(listed)], "value": {"id": made}},
            {"op": "set", "path": [*path], "value": [*ticked, made] if ticked else made},
        )
        text = say("form_add_table", name=table_name("interlock"))
        return (Act(text, "plus", edits, opens=("interlock", len(listed))),)

    def _ticks(self, path: Path, value: Any, known: Sequence[Named], single: bool = False) -> Field:
        ticked = _strings(value)
        every = [*known, *(Named(i, say("form_not_in_file")) for i in ticked)]
        names = {each.id: each for each in reversed(every)}
        # What is ticked comes first, in the file's order.
        order = dict.fromkeys((*ticked, *(each.id for each in known)))
        choices = [Choice(each, _id_text(names[each]), each in ticked) for each in order]
        return Field(path, "", "ticks", value=", ".join(ticked), choices=tuple(choices), single=single)

    def _priority(self, path: Path, value: Any, prop: Schema) -> Field:
        if prop.get("type") == "array":
            ticked = value if isinstance(value, list) else []
            choices = [Choice(p, say(code), p in ticked, f"{p}") for p, code in PRIORITIES.items()]
            return Field(path, "", "ticks", value=", ".join(map(str, ticked)), choices=tuple(choices))
        choices = [Choice(p, say(code), p == value, f"{p}") for p, code in PRIORITIES.items()]
        return Field(path, "", "choice", value=_shown(value), choices=tuple(choices))

    def _around(self, path: Path) -> Mapping[str, Any]:
        """The table of the group or page that a widget's key is in."""
        value = value_at(self.tables, path[:-3])
        return value if isinstance(value, dict) else {}

    def _width(self, path: Path, value: Any) -> Field:
        """The width in columns, and parts of the row as buttons."""
        columns = self._around(path).get("columns", TWELFTHS)
        parts = PARTS.items() if isinstance(columns, int) else ()
        choices = [
            Choice(columns // part, text or say("form_whole_width"), columns // part == value)
            for part, text in parts
            if columns % part == 0
        ]
        return Field(path, "", "number", value=_shown(value), choices=tuple(choices))

    # Tables within a table.

    def _nested(self, path: Path, inner: str, value: Any, prop: Schema) -> Field:
        key = str(path[-1])
        if _by_name(prop):
            return self._named(path, inner, value)
        is_list = prop.get("type") == "array"
        if inner in OPENED or inner == WIDGET:
            return self._opened(path, inner, value, is_list=is_list)
        if is_list:
            rows = []
            count = len(value) if isinstance(value, list) else 0
            for number in range(count):
                if isinstance(value[number], dict):
                    acts = self._row_acts(path, number, count)
                    rows.append(self.form((*path, number), acts))
            add = self._add(path, inner, count)
            if value is not None and not isinstance(value, list):
                return Field(path, "", "toml", value=value_text(value))
            return Field(path, "", "rows", value=str(count), rows=tuple(rows), acts=(add,))
        if isinstance(value, dict):
            remove = Act(say("form_remove"), "x", ({"op": "delete", "path": [*path]},))
            return Field(path, "", "table", inner=self.form(path), acts=(remove,))
        begin = {"op": "set", "path": [*path], "value": new_table(self.tables, inner, key)}
        add = Act(say("form_add_table", name=table_name(key)), "plus", (begin,), element_id(path))
        if "anyOf" in prop:  # a number, or where the robot reports it
            add = replace(add, text=say("form_from_topic"))
            return Field(path, "", "number", value="" if value is None else _shown(value), acts=(add,))
        if value is not None:
            return Field(path, "", "toml", value=value_text(value))
        return Field(path, "", "table", acts=(add,))

    def _row_acts(self, path: Path, number: int, count: int) -> tuple[Act, ...]:
        at = [*path, number]
        up: Edits = ({"op": "move", "path": at, "to": [*path, number - 1]},) if number else ()
        down: Edits = (
            ({"op": "move", "path": at, "to": [*path, number + 1]},) if number + 1 < count else ()
        )
        copied: Edits = ({"op": "duplicate", "path": at, "to": [*path, number + 1]},)
        return (
            Act(say("form_move_up"), "arrow-up", up, element_id((*path, number - 1))),
            Act(say("form_move_down"), "arrow-down", down, element_id((*path, number + 1))),
            Act(say("form_duplicate"), "copy", copied, element_id((*path, number + 1))),
            Act(say("form_remove"), "x", ({"op": "delete", "path": at},)),
        )

    def _add(self, path: Path, inner: str, count: int) -> Act:
        key = str(path[-1])
        value = {} if inner == WIDGET else new_table(self.tables, inner, key)
        if inner == WIDGET:
            value = {"id": new_id(self.tables, "widget"), "kind": "label", "label": "…"}
        edits: Edits = ({"op": "insert", "path": [*path, count], "value": value},)
        then = element_id((*path, count))
        return Act(say("form_add_table", name=table_name(key)), "plus", edits, then)

    def _opened(self, path: Path, inner: str, value: Any, *, is_list: bool) -> Field:
        """Tables with forms of their own, as links."""
        key = str(path[-1])
        if not is_list:
            if value is None:
                begin = {"op": "set", "path": [*path], "value": new_table(self.tables, inner, key)}
                add = Act(say("form_add_table", name=table_name(key)), "plus", (begin,))
                return Field(path, "", "opened", acts=(add,))
            remove = Act(say("form_remove"), "x", ({"op": "delete", "path": [*path]},))
            link = Link(path, "", say("form_keys_there", number=len(value)), (remove,))
            return Field(path, "", "opened", links=(link,))
        listed = value if isinstance(value, list) else []
        links = []
        for number, table in enumerate(listed):
            if isinstance(table, dict):
                text = title_of(table, self.language) or f"{number + 1}"
                acts = self._row_acts(path, number, len(listed))
                links.append(Link((*path, number), text, plain(table.get("kind")), acts))
        add = self._add(path, inner, len(listed))
        return Field(path, "", "opened", links=tuple(links), acts=(add,))

    def _named(self, path: Path, inner: str, value: Any) -> Field:
        """Tables by names: what the simulated robot does, texts of the robot."""
        links = []
        named = value if isinstance(value, dict) else {}
        for name in named if inner == "demo" else ():
            remove = Act(say("form_remove"), "x", ({"op": "delete", "path": [*path, name]},))
            links.append(Link((*path, name), str(name), "", (remove,)))
        suggested = ""
        if inner == "demo":
            every = (self._used(key) for key in ("topic", "service", "action", "node"))
            names = {name: kind for used in every for name, kind in used.items()}
            suggested = self._suggest("names", names)
        return Field(
            path,
            "",
            "opened",
            links=tuple(links),
            add_path=path,
            suggestions=suggested,
            rows=tuple(self._text_rows(path, named)) if inner == "texts" else (),
        )

    def _text_rows(self, path: Path, named: Mapping[str, Any]) -> Iterator[Form]:
        for name in named:
            at = (*path, name)
            field_ = replace(self._texts(at, named[name]), name=str(name), raw=named[name])
            remove = Act(say("form_remove"), "x", ({"op": "delete", "path": [*at]},))
            yield Form(at, "texts", str(name), "", (FormSection("", (field_,)),), acts=(remove,))

    def _message(
        self, path: Path, name: str, table: Mapping[str, Any], value: Any, prop: Schema
    ) -> Field:
        """The fields of a message, each with its value; a table of names and values in the same way."""
        rows = [
            Field(
                at,
                ".".join(map(str, at[len(path) :])),
                "literal",
                value=_literal(leaf),
                raw=leaf,
                suggestions=self._suggest("inputs", self._inputs()),
                acts=(Act(say("form_remove"), "x", ({"op": "delete", "path": [*at]},)),),
            )
            for at, leaf in _leaves(path, value if isinstance(value, dict) else {})
        ]
        inner = Form(path, name, "", "", (FormSection("", tuple(rows)),)) if rows else None
        choices = tuple(self._new_fields(path, name, table, value))
        if value is not None and not isinstance(value, dict):
            return Field(path, "", "toml", value=value_text(value))
        return Field(
            path,
            "",
            "fields",
            value="" if value is None else value_text(value),
            inner=inner,
            choices=choices,
            add_path=None if choices else path,
        )

    def _inputs(self) -> Mapping[str, str]:
        inputs = {}
        for _, table in widgets(self.tables):
            if table.get("kind") in ("text", "number", "slider", "select", "toggle", "place", "tour"):
                inputs[f"{{{table.get('id')}}}"] = plain(table.get("label"), self.language)
        return inputs

    def _new_fields(
        self, path: Path, name: str, table: Mapping[str, Any], value: Any
    ) -> Iterator[Choice]:
        """The fields that the message has and the file does not."""
        type_name = str(table.get("type", ""))
        parts = {"request": "_Request", "goal": "_Goal"}
        ending = next((end for part, end in parts.items() if str(path[-1]).endswith(part)), "")
        if self.interfaces is None or not type_name or path[-1] not in MESSAGES:
            return
        there = {".".join(map(str, at[len(path) :])) for at, _ in _leaves(path, value or {})}
        for each, kind in field_paths(self.interfaces, type_name + ending):
            if each not in there and "[0]" not in each:
                zero = [] if kind.endswith("]") else _ZERO.get(kind.rstrip("0123456789"), "")
                edit = {"op": "set", "path": [*path, *each.split(".")], "toml": value_text(zero)}
                yield Choice([edit], f"{each}  {kind}")

    # Faults.

    def _faults_at(self, path: Path) -> tuple[str, ...]:
        """Of the table itself, and of keys that it lacks."""
        place = place_of(path)
        return tuple(each.message for each in self.faults if each.place == place)

    def _faults_of(self, path: Path, made: Field | None) -> tuple[str, ...]:
        place = place_of(path)
        deep = made is None or made.control not in ("table", "rows", "opened")
        return tuple(
            each.message
            for each in self.faults
            if each.place == place or (deep and each.place.startswith((f"{place}.", f"{place}[")))
        )


_ZERO: Final[Mapping[str, Any]] = {
    "bool": False,
    "float": 0.0,
    "int": 0,
    "uint": 0,
    "byte": 0,
    "char": 0,
}
_ORDER: Final = (
    *("source", "topic", "service", "action", "node", "parameter", "type", "field"),
    *("unit", "format", "scale", "offset", "min", "max", "step", "target", "segments"),
)


def _order(each: Field) -> tuple[bool, bool, int]:
    """Required keys first, tables last; where a value comes from before what is made of it."""
    is_table = each.control in ("table", "rows")
    at = _ORDER.index(each.key) if each.key in _ORDER else len(_ORDER)
    return is_table and not each.required, not each.required, at + (each.key == "qos")


def _other_keys(table: Mapping[str, Any]) -> tuple[str, ...]:
    """The keys of an alarm that go with another cause than it has."""
    if any(key in table for key in LIMITS):
        return RAISED_BY
    if any(key in table for key in RAISED_BY):
        return (*ONLY_WITH_LIMITS, *RAISED_BY)
    return ()


def _kind_text(kind: str) -> TextLike:
    """The name of a kind as people say it, and as the file does."""
    return say("form_kind", name=KIND_NAMES[kind], kind=kind) if kind in KIND_NAMES else kind


def _texts_in(value: Any) -> str:
    """All languages of a text."""
    return "".join(map(str, value.values())) if isinstance(value, Mapping) else str(value or "")


def _paired(
    shown: Mapping[str, Field], fields: Mapping[str, Field], pairs: Mapping[str, str]
) -> Iterator[Field]:
    """The fields in rows: short ones stand beside another."""
    beside = {pairs[key] for key in shown if key in pairs and _pairs(shown[key], fields, pairs)}
    for key, each in shown.items():
        if key in pairs and _pairs(each, fields, pairs):
            yield replace(each, beside=fields[pairs[key]])
        elif key not in beside:
            yield each


def _pairs(each: Field, fields: Mapping[str, Field], pairs: Mapping[str, str]) -> bool:
    other = fields.get(pairs[each.key])
    if other is None or (not _is_shown(other) and each.key not in LIMITS):
        return False
    return _is_short(each) and _is_short(other)


def _is_short(each: Field) -> bool:
    """Whether half a row is wide enough."""
    if each.control == "choice":
        return not each.side_by_side and not each.by_edits
    if each.control == "texts":
        return len(each.texts) == 1 and not each.tall
    short = ("id", "kind", "number", "text")
    return each.control in short and not each.acts and not (each.choices and each.control == "number")


def _is_shown(each: Field) -> bool:
    if each.of_ids and not each.choices and not each.acts:
        return each.is_set or each.required
    if each.control == "fields" and each.key in MESSAGES and not each.choices:
        return each.is_set or each.required or bool(each.faults)
    return each.is_set or each.required or bool(each.faults) or each.key in COMMON


def _choices(path: Path, value: Any, values: Sequence[Any]) -> Field:
    choices = tuple(
        Choice(
            each, _choice_name(each), type(each) is type(value) and each == value, _swatch(path, each)
        )
        for each in values
    )
    if value is not None and not any(choice.chosen for choice in choices):
        choices = (*choices, Choice(value, _literal(value), True))
    texts = [str(choice.value) for choice in choices]
    short = len(choices) <= FEW and all(len(text) <= SHORT for text in texts)
    return Field(path, "", "choice", value=_shown(value), choices=choices, side_by_side=short)


def _is_same(value: Any, other: Any) -> bool:
    """Whether both are the same value: true is not 1."""
    return type(value) is type(other) and bool(value == other)


def _unset(name: str, key: str) -> TextLike:
    if key != "needs":
        return ""
    return say("role_operator") if is_command(name) else say("form_everybody")


def _default_choice(made: Field, default: Any) -> TextLike:
    """The name of the choice that counts without an entry."""
    if made.control != "choice" or default is None:
        return ""
    text = next((choice.text for choice in made.choices if _is_same(choice.value, default)), "")
    is_priority = str(made.key).endswith("priority")  # half a row is wide enough for its name only
    return say("form_default", value=text) if text and not is_priority else text


def _choice_name(value: Any) -> TextLike:
    if isinstance(value, bool):
        return say("form_on") if value else say("form_off")
    return str(value)


def _swatch(path: Path, value: Any) -> str:
    return f"colour-{value}" if path[-1] == "colour" else ""


def _tick_name(value: str) -> str:
    return own_name(value) if value in files() else value


def _tag_name(tag: str) -> str:
    return own_name(tag) if tag in files() else tag


def _id_text(named: Named) -> TextLike:
    return say("form_id_text", id=named.id, text=named.text) if named.text else named.id


def _strings(value: Any) -> list[str]:
    """The texts of a list, or of one text."""
    if isinstance(value, str):
        return [value]
    return [each if isinstance(each, str) else _shown(each) for each in value or ()]


def _shown(value: Any) -> str:
    """A value as a field shows it."""
    if value is None:
        return ""
    if isinstance(value, bool):
        return "true" if value else "false"
    return value if isinstance(value, str) else value_text(value)


def _literal(value: Any) -> str:
    """A value of any type; a text in quotes where it would be read as something else."""
    if value is None:
        return ""
    if isinstance(value, str) and not PLAIN.fullmatch(value):
        return value
    return value_text(value)


def _step(value: Any) -> float:
    """The step of the arrow keys: one of the last decimal."""
    text = repr(value) if isinstance(value, int | float) and not isinstance(value, bool) else ""
    decimals = len(text.partition(".")[2]) if "." in text and "e" not in text else 0
    return 1.0 if text.endswith(".0") or not decimals else float(10**-decimals)


def _limits(prop: Schema) -> tuple[str, float | None, float | None]:
    """The range of a number, in words and as numbers."""
    low = prop.get("minimum", prop.get("exclusiveMinimum"))
    high = prop.get("maximum", prop.get("exclusiveMaximum"))
    low = None if low is None or abs(low) == EXACT else low
    high = None if high is None or abs(high) == EXACT else high
    if low is None and high is None:
        return "", None, None
    if low is not None and high is not None:
        text = f"{low:g} … {high:g}"
    else:
        text = f"≥ {low:g}" if high is None else f"≤ {high:g}"
    return text, low, high


def _leaves(path: Path, value: Mapping[str, Any]) -> Iterator[tuple[Path, Any]]:
    """(path, value) of the single values and lists of nested tables."""
    for key, each in value.items():
        if isinstance(each, dict) and each:
            yield from _leaves((*path, key), each)
        else:
            yield (*path, key), each


def _names_in(value: Any, key: str) -> Iterator[tuple[str, str]]:
    if isinstance(value, dict):
        if isinstance(value.get(key), str) and value[key].startswith("/"):
            yield value[key], plain(value.get("type"))
        for each in value.values():
            yield from _names_in(each, key)
    elif isinstance(value, list):
        for each in value:
            yield from _names_in(each, key)


def _merged(used: Mapping[str, str], known: Mapping[str, str]) -> Mapping[str, str]:
    return {**used, **known}


@cache
def _parts_of(title: str) -> tuple[str, ...]:
    return {
        "message type": ("/msg/",),
        "service type": ("/srv/",),
        "action type": ("/action/",),
        "message or service type": ("/msg/", "/srv/"),
    }.get(title, ())


def types_of(interfaces: Interfaces, title: str) -> Iterator[str]:
    """The types that a key with this format can have, by its title in the schema; none for others."""
    for name in interfaces.structures:
        for part in _parts_of(title):
            if part == "/msg/" and part in name:
                yield name
            elif part == "/srv/" and part in name and name.endswith("_Request"):
                yield name.removesuffix("_Request")
            elif part == "/action/" and name.endswith("_Goal"):
                yield name.removesuffix("_Goal")
