"""A panel file as a document that is edited: its text, its tables, and each change as one step that can
be undone. The lines that no edit speaks of stay as they are, byte for byte."""

import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from difflib import SequenceMatcher
from itertools import accumulate
from pathlib import Path as FilePath
from typing import Any, Final, Literal, NamedTuple

from app.panel.file.keys import place_of
from app.panel.file.toml_file import parse_toml
from app.panel.file.toml_lines import Path
from app.system.errors import Fault, InputError, PanelError
from app.system.texts import TextLike, say
from app.system.toml_values import key_text, value_text
from app.tools.editor import table_text
from app.tools.editor.references import (
    LOCAL,
    NAMED,
    Group,
    Owner,
    free_id,
    ids_in,
    owner_at,
    owners,
    references,
    references_to,
    renamed,
    taken_ids,
)
from app.tools.editor.sections import (
    ORDER,
    Keys,
    Section,
    Tables,
    assembled,
    has_header,
    header_text,
    is_list,
    keys_of,
    new_sections,
    paths_of,
    split,
    with_own,
    with_sections,
    without,
)
from app.tools.editor.table_text import NoPlace, aligned, is_same

BOM: Final = "\ufeff"
CONTEXT: Final = 3  # lines of a diff around each change
MISSING: Final = object()
SHOWN: Final = 60  # characters of a value in a sentence


class EditError(InputError):
    """An edit that can't be made; the document stays as it was. `path` is where."""

    def __init__(self, message: TextLike, path: Path = ()) -> None:
        super().__init__(message)
        self.path = path


@dataclass(frozen=True, slots=True)
class SetValue:
    path: Path
    value: Any


@dataclass(frozen=True, slots=True)
class Delete:
    path: Path


@dataclass(frozen=True, slots=True)
class Insert:
    path: Path
    value: Any


@dataclass(frozen=True, slots=True)
class Move:
    """`to` is the path that it has afterwards."""

    path: Path
    to: Path


@dataclass(frozen=True, slots=True)
class Duplicate:
    path: Path
    to: Path


@dataclass(frozen=True, slots=True)
class Rename:
    path: Path
    id: str


@dataclass(frozen=True, slots=True)
class ReplaceText:
    path: Path
    text: str


@dataclass(frozen=True, slots=True)
class Paste:
    """A table by its text, which is another one than that with the same ids in the file."""

    path: Path
    text: str


Edit = SetValue | Delete | Insert | Move | Duplicate | Rename | ReplaceText | Paste

OPERATIONS: Final[Mapping[str, tuple[type[Edit], tuple[str, ...]]]] = {
    "set": (SetValue, ("path", "value")),
    "delete": (Delete, ("path",)),
    "insert": (Insert, ("path", "value")),
    "move": (Move, ("path", "to")),
    "duplicate": (Duplicate, ("path", "to")),
    "rename": (Rename, ("path", "id")),
    "text": (ReplaceText, ("path", "text")),
    "paste": (Paste, ("path", "text")),
}


def edit_from(data: Any) -> Edit:
    """The edit of a JSON value; EditError for one that is malformed. `toml` in place of `value` is the
    text of a value, for what JSON does not have: a float such as 5.0, a date."""
    if isinstance(data, Mapping) and "toml" in data and "value" not in data:
        others = {key: value for key, value in data.items() if key != "toml"}
        data = {**others, "value": _value_from(data["toml"])}
    if not isinstance(data, Mapping) or data.get("op") not in OPERATIONS:
        raise EditError(say("edit_malformed", known=", ".join(OPERATIONS)))
    edit, names = OPERATIONS[data["op"]]
    if set(data) != {"op", *names}:
        raise EditError(say("edit_malformed", known=", ".join(names)))
    values = {name: data[name] for name in names}
    for name in ("path", "to"):
        if name in values:
            values[name] = path_from(values[name])
    if not isinstance(values.get("id", ""), str) or not isinstance(values.get("text", ""), str):
        raise EditError(say("edit_malformed", known=", ".join(names)))
    return edit(**values)


def _value_from(text: Any) -> Any:
    try:
        tables = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError) as error:
        raise EditError(say("edit_not_toml", reason=str(error))) from error
    if tables.keys() != {"value"}:
        raise EditError(say("edit_malformed", known="toml"))
    return tables["value"]


def path_from(data: Any) -> Path:
    """The path of a JSON list."""
    steps = data if isinstance(data, list | tuple) else [None]
    if not all(isinstance(step, str) or (type(step) is int and step >= 0) for step in steps):
        raise EditError(say("edit_malformed", known="path"))
    return tuple(steps)


@dataclass(frozen=True, slots=True)
class Change:
    """A step that was made. `paths` are those that its edits name; `select` is what an editor selects
    after it."""

    revision: int
    label: TextLike
    paths: tuple[Path, ...]
    select: Path


class DiffLine(NamedTuple):
    """A line of a diff. `number` is that in the new text, of a removed line that in the old one; a gap
    stands for equal lines that are left out."""

    kind: Literal["same", "added", "removed", "gap"]
    number: int
    text: str


@dataclass(frozen=True, slots=True)
class State:
    """A document at one revision. `unreadable` says why it is not TOML; it is one section then."""

    sections: tuple[Section, ...]
    paths: tuple[Path, ...]
    tables: Tables
    unreadable: Fault | None = None


class _Places:
    """Where the sections of a state are. `starts` are their first lines, then that after the last."""

    def __init__(self, state: State) -> None:
        lines = (sum(section.lines) for section in state.sections)
        self.starts = [*accumulate(lines, initial=1)]
        self._own = {path: number for number, path in enumerate(state.paths)}
        self._inside: defaultdict[Path, list[int]] = defaultdict(list)
        for number, path in enumerate(state.paths):
            for end in range(1, len(path) + 1):
                self._inside[path[:end]].append(number)

    def inside(self, path: Path) -> Sequence[int]:
        """As `_inside`, for a path that is not empty."""
        return self._inside.get(path, ())

    def located(self, path: Path) -> tuple[int, Path]:
        """As `_locate`."""
        for end in range(len(path), -1, -1):
            number = self._own.get(path[:end])
            if number is not None:
                return number, path[end:]
        return 0, path


@dataclass(frozen=True, slots=True)
class Step:
    before: State
    after: State
    change: Change


class Document:
    """A panel file that is edited.

    `tables` is the text as Python's reader parses it. It is never changed in place: a table that an
    edit does not touch is the same object before and after. `revision` counts changes, also undo and
    redo.
    """

    def __init__(self, text: str) -> None:
        self._bom = text.startswith(BOM)
        self._state = _opened(text.removeprefix(BOM), {})
        self._text: str | None = None
        self._places: _Places | None = None
        self.revision = 0
        self._done: list[Step] = []
        self._undone: list[Step] = []

    @property
    def text(self) -> str:
        """Without the mark with which some editors begin a file."""
        if self._text is None:
            self._text = "".join(section.text for section in self._state.sections)
        return self._text

    @property
    def data(self) -> bytes:
        """The bytes of the file."""
        return (BOM * self._bom + self.text).encode()

    @property
    def tables(self) -> Tables:
        return self._state.tables

    @property
    def unreadable(self) -> Fault | None:
        """Why the text is not TOML; such a document takes only another text of the whole file."""
        return self._state.unreadable

    @property
    def undo_label(self) -> TextLike | None:
        """The label of the step that `undo` takes back; None for none."""
        return self._done[-1].change.label if self._done else None

    @property
    def redo_label(self) -> TextLike | None:
        return self._undone[-1].change.label if self._undone else None

    def apply(self, edits: Iterable[Edit], label: TextLike) -> Change:
        """Makes all edits as one step, or none: EditError."""
        draft = Draft(self._state)
        paths: list[Path] = []
        select: Path = ()
        for edit in edits:
            select = draft.apply(edit)
            paths.append(edit.path)
            if isinstance(edit, Move | Duplicate):
                paths.append(edit.to)
        change = Change(self.revision + 1, label, tuple(paths), select)
        self._done.append(Step(self._state, draft.state(), change))
        self._undone.clear()
        self._show(self._done[-1].after)
        return change

    def undo(self) -> Change:
        """Takes back the last step; EditError without one."""
        if not self._done:
            raise EditError(say("edit_nothing_to_undo"))
        step = self._done.pop()
        self._undone.append(step)
        self._show(step.before)
        return replace(step.change, revision=self.revision)

    def redo(self) -> Change:
        if not self._undone:
            raise EditError(say("edit_nothing_to_redo"))
        step = self._undone.pop()
        self._done.append(step)
        self._show(step.after)
        return replace(step.change, revision=self.revision)

    def _show(self, state: State) -> None:
        self._state, self._text, self._places = state, None, None
        self.revision += 1

    def get(self, path: Path) -> Any:
        """The value at a path; EditError without one."""
        value = _value(self.tables, path)
        if value is MISSING:
            raise EditError(say("edit_no_place", place=place_of(path)), path)
        return value

    def lines(self, path: Path) -> tuple[int, int]:
        """The first and the last line, from 1, of a table with its header, or of a key."""
        first, last = self._lines(path)
        return first, last

    def _lines(self, path: Path) -> tuple[int, int]:
        if self._places is None:
            self._places = _Places(self._state)
        starts = self._places.starts
        if not path:
            return 1, max(1, starts[-1] - (1 if self.text.endswith("\n") else 0))
        places = []
        for number in self._places.inside(path):
            section = self._state.sections[number]
            above, header, body, loose = section.lines
            newlines = above + header + body
            end = starts[number] + newlines - (0 if section.text.endswith("\n") or loose else -1) - 1
            places.append((starts[number] + above, max(end, starts[number] + above)))
        host, rest = self._places.located(path)
        section = self._state.sections[host]
        spans = [
            span for inner, span in section.layout.spans.items() if rest and inner[: len(rest)] == rest
        ]
        if spans:
            start = starts[host] + sum(section.lines[:2])
            first, last = min(s.start for s in spans), max(s.end for s in spans)
            places.append(
                (start + section.body.count("\n", 0, first), start + section.body.count("\n", 0, last))
            )
        if not places:
            raise EditError(say("edit_no_place", place=place_of(path)), path)
        return min(first for first, _ in places), max(last for _, last in places)

    def text_of(self, path: Path) -> str:
        """The text of a table with its header, its own tables and its comments, or of a key with its
        value; [] is the whole file."""
        if not path:
            return self.text
        sections = [self._state.sections[n] for n in _inside(self._state.paths, path)]
        if sections:
            *others, last = sections
            return "".join(section.text for section in others) + last.above + last.header + last.body
        host, rest = SectionIndex(self._state.paths).locate(path)
        section = self._state.sections[host]
        span = section.layout.spans.get(rest)
        if span is not None:
            return section.body[span.start : span.end]
        value = _value(self.tables, path)
        if value is MISSING:
            raise EditError(say("edit_no_place", place=place_of(path)), path)
        return f"{key_text(str(path[-1]))} = {value_text(value)}"  # it is written with dots

    def references(self, path: Path) -> list[Path]:
        """The places that name the id of a table: each path is that of a text."""
        owner = owner_at(self.tables, path)
        if owner is None:
            return []
        return [reference.path for reference in references_to(self.tables, owner)]

    def diff(self, against: str) -> list[DiffLine]:
        """What changes another text into this one, with some lines around each change."""
        return diff_lines(against.removeprefix(BOM), self.text)


def _opened(text: str, previous: Tables, known: Iterable[Section] = ()) -> State:
    """The state of a text. Sections that are among the known ones are the same objects."""
    by_text: dict[str, list[Section]] = {}
    for section in reversed([*known]):
        by_text.setdefault(section.text, []).append(section)
    try:
        tables = parse_toml(FilePath("panel.toml"), text.encode()).tables
        new = split(text, tables)
        sections = tuple(_known(section, by_text) for section in new)
        paths = tuple(paths_of(sections))
    except PanelError as error:
        raw = Section("", "", text, "", (), False, 0, {})
        return State((raw,), ((),), {}, error.faults[0])
    return State(sections, paths, assembled(sections, previous))


def _known(section: Section, by_text: Mapping[str, list[Section]]) -> Section:
    same = by_text.get(section.text)
    return same.pop() if same and same[-1].keys == section.keys else section


def _value(tables: Any, path: Path) -> Any:
    """The value at a path, or MISSING."""
    for step in path:
        in_table = isinstance(tables, dict) and isinstance(step, str) and step in tables
        in_list = isinstance(tables, list) and isinstance(step, int) and 0 <= step < len(tables)
        if not in_table and not in_list:
            return MISSING
        tables = tables[step]
    return tables


def _inside(paths: Sequence[Path], path: Path) -> list[int]:
    """The sections of a table and those below it."""
    return [number for number, each in enumerate(paths) if each[: len(path)] == path]


class SectionIndex:
    """Where the sections of a document are, by their paths."""

    def __init__(self, paths: Sequence[Path]) -> None:
        self._paths = paths
        self._last = {path: number for number, path in enumerate(paths)}
        self._around = {path[:end] for path in paths for end in range(len(path) + 1)}

    def is_of(self, paths: Sequence[Path]) -> bool:
        return self._paths is paths

    def locate(self, path: Path) -> tuple[int, Path]:
        """The section in whose body a path is, and the path in there."""
        for end in range(len(path), 0, -1):
            if (number := self._last.get(path[:end])) is not None:
                return number, path[end:]
        return self._last.get((), 0), path

    def has(self, path: Path) -> bool:
        """Whether a section is at a path, or below it."""
        return path in self._around


class Draft:
    """The sections of a document while an edit changes them."""

    def __init__(self, state: State) -> None:
        self.sections = list(state.sections)
        self.paths = list(state.paths)
        self._tables: Tables | None = state.tables
        self._last = state.tables
        self._index = SectionIndex(self.paths)
        self._unreadable = state.unreadable

    def state(self) -> State:
        return State(tuple(self.sections), tuple(self.paths), self.tables, self._unreadable)

    @property
    def tables(self) -> Tables:
        if self._tables is None:
            self._tables = self._last = assembled(self.sections, self._last)
        return self._tables

    @property
    def newline(self) -> str:
        first = next((s.text for s in self.sections if "\n" in s.text), "")
        return "\r\n" if first.partition("\n")[0].endswith("\r") else "\n"

    def apply(self, edit: Edit) -> Path:
        """Makes an edit; returns what to select after it."""
        if self._unreadable and not (isinstance(edit, ReplaceText) and not edit.path):
            raise EditError(say("edit_unreadable", reason=str(self._unreadable)), edit.path)
        if not edit.path and not isinstance(edit, ReplaceText):
            raise EditError(say("edit_whole_file"))
        try:
            match edit:
                case SetValue(path, value):
                    _check_value(value, path)
                    self.put(path, value)
                    return path
                case Delete(path):
                    self.delete(path)
                    return self._neighbour(path)
                case Insert(path, value):
                    _check_value(value, path)
                    self.insert(path, value)
                    return path
                case Move(path, to):
                    self.move(path, to)
                    return to
                case Duplicate(path, to):
                    self.duplicate(path, to)
                    return to
                case Paste(path, text):
                    self.paste(path, text)
                    return path
                case Rename(path, name):
                    self.rename(path, name)
                    return path
                case ReplaceText(path, text):
                    self.replace_text(path, text)
                    return path
        except NoPlace as error:
            raise EditError(say("edit_no_place", place=place_of(error.args[0])), edit.path) from error
        raise AssertionError(edit)

    def _neighbour(self, path: Path) -> Path:
        """What stands where a table was: the next one, else the one before, else the table around."""
        *above, last = path
        if isinstance(last, int):
            around = _value(self.tables, tuple(above))
            if isinstance(around, list) and around:
                return (*above, min(last, len(around) - 1))
            above = above[:-1]
        return tuple(above)

    def _changed(self, sections: list[Section]) -> None:
        self.sections = sections
        self.paths = paths_of(sections)
        self._tables = None

    def _get(self, path: Path) -> Any:
        return _value(self.tables, path)

    def _existing(self, path: Path) -> Any:
        value = self._get(path)
        if value is MISSING:
            raise EditError(say("edit_no_place", place=place_of(path)), path)
        return value

    def _in_sections(self, path: Path) -> bool:
        return self._indexed().has(path)

    def _indexed(self) -> SectionIndex:
        if not self._index.is_of(self.paths):
            self._index = SectionIndex(self.paths)
        return self._index

    def _edit_body(self, path: Path, edit: Callable[[str, Path], str]) -> None:
        """Changes the keys of the table that a path is in."""
        host, rest = self._indexed().locate(path)
        section = self.sections[host]
        try:
            body = edit(section.body, rest)
            changed = section.with_body(body)
        except NoPlace as error:
            around = path[: len(path) - len(rest)]
            raise NoPlace((*around, *error.args[0])) from error
        except table_text.PARSE_ERRORS as error:
            raise EditError(say("edit_not_toml", reason=str(error)), path) from error
        if not section.body and section.header and not section.header.endswith("\n"):
            changed = section.with_end(self.newline).with_body(body)
        self.sections[host] = changed
        if self._tables is not None:
            self._tables = with_own(self._tables, self.paths[host], section.own, changed.own)

    # put

    def put(self, path: Path, value: Any) -> None:
        last, parent = path[-1], path[:-1]
        old = self._get(path)
        if old is MISSING:
            self._add(path, value)
        elif is_same(old, value):
            return
        elif not self._in_sections(path):
            self._edit_body(path, lambda body, rest: table_text.set_value(body, rest, value))
        elif isinstance(old, dict) and isinstance(value, dict):
            for key in [key for key in old if key not in value]:
                self.delete((*path, key))
            if self._get(path) is MISSING:
                self._add(path, value)
                return
            for key, item in value.items():
                self.put((*path, key), item)
        elif isinstance(old, list) and _are_tables(value):
            begin, end = aligned(old, value)
            for n in range(begin, max(len(old), len(value)) - end):
                if n < min(len(old), len(value)) - end:
                    self.put((*path, n), value[n])
                elif len(value) > len(old):
                    self.insert((*path, n), value[n])
                else:
                    self.delete((*path, min(len(old), len(value)) - end))
        elif isinstance(last, int):
            raise EditError(say("edit_needs_table", place=place_of(parent), value=_shown(value)), path)
        else:
            self.delete(path)
            self._add(path, value)

    def _add(self, path: Path, value: Any) -> None:
        """A key that is not there."""
        *_, last = path
        parent = path[:-1]
        around = self._get(parent)
        if isinstance(last, int):
            if around is MISSING and last == 0:
                self._add(parent, [value])
            else:
                self.insert(path, value)
            return
        if around is MISSING:
            self._add(parent, {last: value})
            return
        if not isinstance(around, dict):
            raise EditError(say("edit_not_a_table", place=place_of(parent)), path)
        keys = keys_of(path)
        if self._takes_headers(parent) and has_header(keys, value):
            for n, table in enumerate(value if isinstance(value, list) else [value]):
                many = isinstance(value, list)
                self._insert_sections(
                    (*path, n) if many else path, new_sections(keys, table, many, self.newline), n
                )
            return
        if parent and parent not in self.paths and self._in_sections(parent):
            self._insert_header(parent)
        self._edit_body(path, lambda body, rest: table_text.set_value(body, rest, value))

    def _takes_headers(self, parent: Path) -> bool:
        """Whether the tables in a table may have headers: it is in no value."""
        return not parent or self._in_sections(parent)

    def _insert_header(self, path: Path) -> None:
        """The header of a table that has only those of tables in it."""
        keys = keys_of(path)
        at = _inside(self.paths, path)[0]
        new = new_sections(keys, {}, False, self.newline)
        new = new or [_empty_section(keys, self.newline)]
        self._changed(with_sections(self.sections, at, new, self.newline, True, self.newline))

    # insert, delete, move

    def insert(self, path: Path, value: Any) -> None:
        *_, index = path
        parent = path[:-1]
        around = self._get(parent)
        if not isinstance(index, int):
            raise EditError(say("edit_not_a_list", place=place_of(parent)), path)
        if around is MISSING:
            around = []
        if not isinstance(around, list):
            raise EditError(say("edit_not_a_list", place=place_of(parent)), path)
        if index > len(around):
            raise EditError(
                say("edit_index", place=place_of(parent), number=len(around), index=index), path
            )
        if self._in_sections(parent):
            if not isinstance(value, dict):
                raise EditError(
                    say("edit_needs_table", place=place_of(parent), value=_shown(value)), path
                )
            self._insert_sections(path, new_sections(keys_of(parent), value, True, self.newline), index)
        elif around:
            self._edit_body(path, lambda body, rest: table_text.insert_value(body, rest, value))
        else:
            if self._get(parent) is not MISSING:
                if not (self._takes_headers(parent[:-1]) and has_header(keys_of(parent), [value])):
                    self._edit_body(path, lambda body, rest: table_text.insert_value(body, rest, value))
                    return
                self.delete(parent)
            self._add(parent, [value])

    def _insert_sections(self, path: Path, new: Sequence[Section], index: int) -> None:
        """Puts the sections of a table where it has a path: of a list at `index`, else among its
        parent's tables."""
        at, before, separator = self._place(path, index)
        self._changed(with_sections(self.sections, at, new, separator, before, self.newline))

    def _place(self, path: Path, index: int) -> tuple[int, bool, str]:
        """(index of the section, whether what stands there follows, the blank lines between)."""
        parent = path[:-1]
        if isinstance(path[-1], int):
            count = len({each[len(parent)] for each in self.paths if each[: len(parent)] == parent})
            if index < count:
                at = _inside(self.paths, (*parent, index))[0]
                return at, True, self._blank_before(at)
            if count:
                siblings = _inside(self.paths, (*parent, count - 1))
                return siblings[-1] + 1, False, self._blank_before(siblings[0])
            parent = parent[:-1]
        if parent and (around := _inside(self.paths, parent)):
            return around[-1] + 1, False, self.newline
        rank = _rank(str(path[0]))
        for number, section in enumerate(self.sections[1:], 1):
            if _rank(section.keys[0]) > rank:
                return number, False, self.newline
        return len(self.sections), False, self.newline

    def _blank_before(self, at: int) -> str:
        """The blank lines at the end of the section before one."""
        loose = self.sections[at - 1].loose
        return loose[len(loose.rstrip("\r\n")) :] if "#" not in loose else self.newline

    def delete(self, path: Path) -> None:
        if self._get(path) is MISSING:
            raise EditError(say("edit_no_place", place=place_of(path)), path)
        if inside := _inside(self.paths, path):
            self._changed(without(self.sections, inside))
            if isinstance(path[-1], int) or self._get(path) is MISSING:
                return
        self._edit_body(path, table_text.delete_value)

    def move(self, path: Path, to: Path) -> None:
        value = self._existing(path)
        if to[: len(path)] == path and to != path:
            raise EditError(say("edit_into_itself", place=place_of(path)), path)
        if path == to:
            return
        if not to or not isinstance(path[-1], int) or not isinstance(to[-1], int):
            self._move_key(path, to, value)
            return
        source, target = path[:-1], to[:-1]
        if source == target:
            count = len(self._existing(source))
            if to[-1] >= count:
                raise EditError(
                    say("edit_index", place=place_of(source), number=count, index=to[-1]), to
                )
        if source == target and not self._in_sections(path):
            index = to[-1]
            self._edit_body(path, lambda body, rest: table_text.move_value(body, rest, index))
            return
        pieces = [self.sections[n] for n in _inside(self.paths, path)]
        self.delete(path)
        if pieces and isinstance(value, dict) and self._takes_sections(target):
            self._put_pieces(pieces, keys_of(path), to)
        else:
            self.insert(to, value)

    def _takes_sections(self, target: Path) -> bool:
        """Whether a list has tables with headers, or will have."""
        around = self._get(target)
        if around is not MISSING and not isinstance(around, list):
            return False
        if self._in_sections(target):
            return True
        return around is MISSING and self._takes_headers(target[:-1]) and is_list(keys_of(target))

    def _put_pieces(self, pieces: Sequence[Section], keys: Keys, to: Path) -> None:
        """Sections of a table with `keys` as those of an element of another list."""
        around = self._get(to[:-1])
        count = len(around) if isinstance(around, list) else 0
        index = to[-1]
        assert isinstance(index, int)
        if index > count:
            raise EditError(say("edit_index", place=place_of(to[:-1]), number=count, index=index), to)
        if (parent := to[:-2]) and self._get(parent) is MISSING and len(parent) > 1:
            raise EditError(say("edit_no_place", place=place_of(parent)), to)
        own = keys_of(to)
        new = [
            piece if own == keys else piece.with_keys((*own, *piece.keys[len(keys) :]))
            for piece in pieces
        ]
        self._insert_sections(to, new, index)

    def _move_key(self, path: Path, to: Path, value: Any) -> None:
        """A key gets another name, or another table."""
        if not to or not isinstance(path[-1], str) or not isinstance(to[-1], str):
            raise EditError(say("edit_move", place=place_of(path), to=place_of(to)), path)
        if self._get(to) is not MISSING:
            raise EditError(say("edit_key_taken", place=place_of(to)), to)
        if path[:-1] == to[:-1]:
            if inside := _inside(self.paths, path):
                old, new = keys_of(path), keys_of(to)
                sections = list(self.sections)
                for n in inside:
                    sections[n] = sections[n].with_keys((*new, *sections[n].keys[len(old) :]))
                self._changed(sections)
                return
            if (text := self._renamed_key(path, str(to[-1]))) is not None:
                self._edit_body(path, lambda body, rest: table_text.replace_value(body, rest, text))
                return
        self.delete(path)
        self.put(to, value)

    def _renamed_key(self, path: Path, name: str) -> str | None:
        """The text of a key and its value with another name; None if it is written with a dot."""
        host, rest = self._indexed().locate(path)
        section = self.sections[host]
        span = section.layout.spans.get(rest)
        text = section.body[span.start : span.end] if span else ""
        for old in (key_text(str(path[-1])), f'"{path[-1]}"', f"'{path[-1]}'"):
            after = text.removeprefix(old)
            if after != text and after.lstrip(" \t").startswith("="):
                return key_text(name) + after
        return None

    # duplicate, rename

    def duplicate(self, path: Path, to: Path) -> None:
        value = self._existing(path)
        if not to or not isinstance(path[-1], int) or not isinstance(to[-1], int):
            raise EditError(say("edit_move", place=place_of(path), to=place_of(to)), path)
        pieces = [self.sections[n] for n in _inside(self.paths, path)]
        taken = taken_ids(self.tables)
        if pieces and isinstance(value, dict) and self._takes_sections(to[:-1]):
            self._put_pieces(pieces, keys_of(path), to)
        else:
            self.insert(to, value)
        self.with_new_ids(to, taken)

    def paste(self, path: Path, text: str) -> None:
        taken = taken_ids(self.tables)
        self.insert(path, {})
        self.replace_text(path, text)
        self.with_new_ids(path, taken)

    def with_new_ids(self, path: Path, taken: Mapping[Group, set[str]]) -> None:
        """Gives what has an id in a copied table another one where `taken` has it, and renames the
        references in that table."""
        known = {group: set(ids) for group, ids in taken.items()}
        names: dict[Owner, str] = {}
        for owner in owners(self.tables, path):
            if owner.group not in LOCAL and owner.id in taken[owner.group]:
                names[owner] = free_id(owner.id, known[owner.group])
                known[owner.group].add(names[owner])
        self._rename_references(names, path)
        for owner, name in names.items():
            self.put(owner.place, name)

    def _rename_references(self, names: Mapping[Owner, str], inside: Path = ()) -> None:
        """Puts the new ids of tables where the old ones are named, at or below a path."""
        by_id = {(owner.group, owner.id): (owner, name) for owner, name in names.items()}
        for reference, groups in list(references(self.tables, inside)):
            renames = [
                by_id[group, name]
                for group in groups
                for name in ids_in(reference, group)
                if (group, name) in by_id
            ]
            if reference.form == "keys" and renames:
                self.move(reference.path, (*reference.path[:-1], renames[0][1]))
            elif renames:
                self.put(reference.path, renamed(reference, renames))

    def rename(self, path: Path, new: str) -> None:
        owner = owner_at(self.tables, path)
        if owner is None:
            raise EditError(say("edit_no_id", place=place_of(path)), path)
        if not NAMED.fullmatch(new):
            raise EditError(say("edit_id_form", id=new), path)
        if new == owner.id:
            return
        for other in owners(self.tables):
            beside = owner.group not in LOCAL or other.path[:-1] == owner.path[:-1]
            if (other.group, other.id) == (owner.group, new) and beside:
                raise EditError(say("edit_id_taken", id=new, place=place_of(other.path)), path)
        self._rename_references({owner: new})
        self.put(owner.place, new)

    # text

    def replace_text(self, path: Path, text: str) -> None:
        if not path:
            self._replace_file(text)
        elif inside := _inside(self.paths, path):
            self._replace_sections(path, inside, text)
        else:
            self._existing(path)
            before = self._existing(path[:-1])
            self._edit_body(path, lambda body, rest: table_text.replace_value(body, rest, text))
            after = self._get(path[:-1])
            if _others(before, path[-1]) != _others(after, path[-1]) or type(before) is not type(after):
                raise EditError(say("edit_other_key", place=place_of(path)), path)

    def _replace_file(self, text: str) -> None:
        opened = _opened(text.removeprefix(BOM), self._last, self.sections)
        if opened.unreadable and not self._unreadable:
            raise EditError(say("edit_not_toml", reason=str(opened.unreadable)))
        self.sections, self.paths = list(opened.sections), list(opened.paths)
        self._tables = self._last = opened.tables
        self._unreadable = opened.unreadable

    def _replace_sections(self, path: Path, inside: Sequence[int], text: str) -> None:
        opened = _opened(text, {})
        if opened.unreadable:
            raise EditError(say("edit_not_toml", reason=str(opened.unreadable)), path)
        root, *new = opened.sections
        kind = type(self._get(path))
        keys = keys_of(path)
        first = header_text(keys, isinstance(path[-1], int))
        if new and not root.own:
            new[0] = _with_above(new[0], root.text)
        alone = sum(section.keys == keys for section in new) == 1
        own = all(section.keys[: len(keys)] == keys for section in new)
        if not new or root.own or not own or (isinstance(path[-1], int) and not alone):
            raise EditError(say("edit_other_table", header=first), path)
        if isinstance(path[-1], int) and (new[0].keys != keys or not new[0].many):
            raise EditError(say("edit_other_table", header=first), path)
        *others, last = new
        last = last.with_end(self.newline)
        end = self.sections[inside[-1]].loose
        at = inside[0]
        left = [s for n, s in enumerate(self.sections) if n not in set(inside)]
        self._changed([*left[:at], *others, last.with_loose(end), *left[at:]])
        if type(self._get(path)) is not kind:
            raise EditError(say("edit_other_table", header=first), path)


def _with_above(section: Section, text: str) -> Section:
    return replace(section, above=text + section.above)


def _empty_section(keys: Keys, newline: str) -> Section:
    header = header_text(keys, False)
    return Section("", header + newline, "", newline, keys, False, len(header), {})


def _rank(key: str) -> int:
    return ORDER.index(key) if key in ORDER else len(ORDER)


def _are_tables(value: Any) -> bool:
    return isinstance(value, list) and bool(value) and all(isinstance(item, dict) for item in value)


def _others(around: Any, step: str | int) -> Any:
    """A table or list without one of its parts."""
    if isinstance(around, dict):
        return {key: value for key, value in around.items() if key != step}
    return [item for n, item in enumerate(around) if n != step] if isinstance(around, list) else None


def _shown(value: Any) -> str:
    text = value_text(value)
    return text if len(text) <= SHOWN else f"{text[:SHOWN]}…"


def _check_value(value: Any, path: Path) -> None:
    """EditError for what TOML does not have, such as null."""
    if isinstance(value, dict):
        for key, item in value.items():
            if not isinstance(key, str):
                raise EditError(say("edit_value", value=str(key)), path)
            _check_value(item, (*path, key))
    elif isinstance(value, list):
        for n, item in enumerate(value):
            _check_value(item, (*path, n))
    elif not isinstance(value, bool | int | float | str):
        raise EditError(say("edit_value", value="null" if value is None else str(value)), path)


def diff_lines(old: str, new: str) -> list[DiffLine]:
    before, after = old.splitlines(), new.splitlines()
    most = min(len(before), len(after))
    head = next((n for n in range(most) if before[n] != after[n]), most)
    rest = most - head
    tail = next((n for n in range(rest) if before[-1 - n] != after[-1 - n]), rest)
    matcher = SequenceMatcher(
        None, before[head : len(before) - tail], after[head : len(after) - tail], autojunk=False
    )
    changes = [
        (head + i, head + i_end, head + j, head + j_end)
        for kind, i, i_end, j, j_end in matcher.get_opcodes()
        if kind != "equal"
    ]
    lines: list[DiffLine] = []
    shown = 0  # lines of the new text so far
    for number, (old_start, old_end, start, end) in enumerate(changes):
        first = max(start - CONTEXT, shown)
        if first > shown:
            lines.append(DiffLine("gap", shown + 1, ""))
        lines += [DiffLine("same", n + 1, after[n]) for n in range(first, start)]
        lines += [DiffLine("removed", n + 1, before[n]) for n in range(old_start, old_end)]
        lines += [DiffLine("added", n + 1, after[n]) for n in range(start, end)]
        following = changes[number + 1][2] if number + 1 < len(changes) else len(after)
        shown = min(end + CONTEXT, following)
        lines += [DiffLine("same", n + 1, after[n]) for n in range(end, shown)]
    if lines and shown < len(after):
        lines.append(DiffLine("gap", shown + 1, ""))
    return lines
