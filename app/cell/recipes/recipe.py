"""A recipe with its history, the values of its fields, and its texts in TOML and CSV. Pure."""

import csv
import io
import json
import math
import re
import tomllib
import unicodedata
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Final, Literal, get_args

from app.panel.numbers import decimal_text
from app.panel.values import same_value
from app.panel.widgets.families import Input
from app.panel.widgets.inputs import SelectInput, ToggleInput
from app.panel.widgets.numbers import Numeric
from app.system.csv_text import BOM, Cell, csv_text, quoted_cell, text_in_cell
from app.system.errors import InputError
from app.system.printable import printable
from app.system.texts import ENGLISH, Text, TextLike, joined, number, render, say
from app.system.texts.catalogue import files
from app.system.texts.locales import clear_text, read_number
from app.system.texts.text import each_language
from app.system.toml_values import key_text
from app.system.toml_values import value_text as toml_text

# A recipe with its history, and the names that it may have. Pure.

MAX_RECIPES: Final = 200  # of a set
MAX_VERSIONS: Final = 50  # of a recipe; the oldest are dropped
LONGEST_NAME: Final = 60
ID: Final = re.compile(r"[a-z0-9][a-z0-9_]{0,63}")

Values = Mapping[str, Any]
Act = Literal["created", "saved", "renamed", "restored", "imported"]


@dataclass(frozen=True, slots=True)
class Version:
    """What a recipe was after one change: `number` counts its changes from 1 on, `at` is when (seconds
    since the epoch), `by` who made it."""

    number: int
    at: float
    by: str
    act: Act
    name: str
    values: Values


@dataclass(frozen=True, slots=True)
class Recipe:
    """A recipe; the last of its `versions` is what it is now."""

    id: str
    versions: tuple[Version, ...]

    @property
    def now(self) -> Version:
        return self.versions[-1]

    @property
    def name(self) -> str:
        return self.now.name

    @property
    def values(self) -> Values:
        return self.now.values

    def version(self, number: int) -> Version | None:
        """One of its versions; None if it is not kept."""
        return next((version for version in self.versions if version.number == number), None)

    def changed(
        self, act: Act, at: float, by: str, *, name: str = "", values: Values | None = None
    ) -> "Recipe":
        """The recipe after a change; without `name` and `values` those stay."""
        kept = dict(self.values if values is None else values)
        new = Version(self.now.number + 1, at, by, act, name or self.name, kept)
        return replace(self, versions=(*self.versions, new)[-MAX_VERSIONS:])


@dataclass(frozen=True, slots=True)
class BrokenRecipe:
    """A file that can't be read as a recipe, and why."""

    id: str
    reason: TextLike


@dataclass(frozen=True, slots=True)
class Difference:
    """The value of one field before and after; None for none."""

    field: str
    old: Any = None
    new: Any = None


def new_recipe(recipe_id: str, act: Act, at: float, by: str, name: str, values: Values) -> Recipe:
    """A recipe with its first version."""
    return Recipe(recipe_id, (Version(1, at, by, act, name, dict(values)),))


def differences(fields: Iterable[str], old: Values, new: Values) -> list[Difference]:
    """The fields whose values differ."""
    return [
        Difference(name, old.get(name), new.get(name))
        for name in fields
        if (name in old) != (name in new) or not same_value(old.get(name), new.get(name))
    ]


def clean_name(text: str) -> str:
    """A typed name as it is kept: without spaces at its ends, one between words."""
    return " ".join(unicodedata.normalize("NFC", text).split())


def name_fault(name: str, taken: Iterable[str]) -> Text | None:
    """Why a clean name can't be given; `taken` are those of the other recipes."""
    if not name:
        return say("recipe_name_empty")
    if len(name) > LONGEST_NAME:
        return say("recipe_name_too_long", most=LONGEST_NAME)
    if not name.isprintable():
        return say("recipe_name_unprintable")
    if name.casefold() in {other.casefold() for other in taken}:
        return say("recipe_name_taken", name=name)
    return None


def id_for(name: str, taken: Iterable[str], word: str = "recipe") -> str:
    """An id of a-z, 0-9 and "_" for a name, which also names its file: no path is made of what was
    typed. `word` stands for a name without such letters."""
    plain = unicodedata.normalize("NFKD", name).replace("×", "x").lower()
    start = re.sub(r"[^a-z0-9]+", "_", plain.encode("ascii", "ignore").decode()).strip("_")[:50] or word
    known, number, made = set(taken), 1, start
    while made in known:
        number += 1
        made = f"{start}_{number}"
    return made


# The values of a recipe's fields: checked, and as a reader sees them. Pure.

NOTHING: Final = "—"
LONGEST: Final = 80  # characters of a text
DIGITS: Final = 9
REPORTED_DIGITS: Final = 7  # of a float32
MOST_CHANGES: Final = 8  # that a sentence names


def checked_values(fields: Iterable[Input], values: Mapping[str, Any]) -> dict[str, Any]:
    """The values of all fields, as they are kept; InputError for one that is missing or that its input
    refuses."""
    checked = {}
    for field in fields:
        if field.id not in values:
            raise InputError(say("recipe_field_missing", label=field.label))
        checked[field.id] = field.check_value(values[field.id])
    return checked


def value_text(field: Input, value: Any) -> TextLike:
    """A value of a recipe as text, with its unit."""
    if value is None:
        return NOTHING
    if isinstance(field, SelectInput):
        option = next((o for o in field.own_options if same_value(o.value, value)), None)
        if option is not None:
            return option.label
    if isinstance(field, ToggleInput) and isinstance(value, bool):
        return field.on if value else field.off
    if isinstance(field, Numeric) and isinstance(value, int | float) and not isinstance(value, bool):
        return number(number_of(value), field.unit)
    text = value if isinstance(value, str) else json.dumps(value, ensure_ascii=False, default=str)
    return printable(text[:LONGEST])


def number_of(value: float) -> str:
    """A number as plain text; a float32's noise is left out."""
    return str(value) if isinstance(value, int) else decimal_text(float(f"{value:.{DIGITS}g}"))


def entered_value(field: Input, reported: Any) -> Any:
    """What the robot has, as it would be entered: in the unit of the input."""
    if not isinstance(field, Numeric) or isinstance(reported, bool):
        return reported
    if not isinstance(reported, int | float):
        return reported
    exact = float(f"{reported:.{REPORTED_DIGITS}g}") if isinstance(reported, float) else reported
    return field.entered_value(exact)


def reported_text(field: Input, reported: Any) -> TextLike:
    """The same as text, with its unit."""
    return value_text(field, entered_value(field, reported))


def changes_text(changes: Iterable[tuple[TextLike, TextLike, TextLike]]) -> TextLike:
    """(label, old, new) of some fields as one text: "Layers 5 → 6, Arm speed 100 → 80 %"."""
    every = [
        say("recipe_first", label=label, new=new)
        if old == NOTHING
        else say("recipe_change", label=label, old=old, new=new)
        for label, old, new in changes
    ]
    shown: list[Text] = every[:MOST_CHANGES]
    if len(every) > MOST_CHANGES:
        shown.append(say("recipe_more_changes", number=len(every) - MOST_CHANGES))
    return joined(shown, "between_names")


def differences_text(fields: Iterable[Input], changes: Iterable[Difference]) -> TextLike:
    """The changes of a recipe's values as one text."""
    known = {field.id: field for field in fields}
    return changes_text(
        (
            known[change.field].label,
            value_text(known[change.field], change.old),
            value_text(known[change.field], change.new),
        )
        for change in changes
        if change.field in known
    )


# Recipes of a set as CSV: RFC 4180, a row each; read back with the reason for each row that is refused.
# Pure.
#
# Spreadsheets write numbers in the notation of their own language. The header of the last column is one
# half, which a spreadsheet writes like any number: so a file says what its decimal sign is.

NAME: Final = "name"
# Columns that an export has and an import leaves alone.
ABOUT: Final = ("version", "changed_at", "changed_by")
HALF: Final = ("0.5", "0,5")  # the header of a column without values
# A language that writes numbers with this decimal sign.
NOTATIONS: Final[Mapping[str, str]] = {".": ENGLISH, ",": "de"}
TRUE: Final = ("true", "1", "wahr", "vrai", "verdadero", "vero", "waar")
FALSE: Final = ("false", "0", "falsch", "faux", "falso", "onwaar")
SEPARATORS: Final = ",;\t"
MAX_CSV_BYTES: Final = 4_000_000  # of a file that is imported
_SEP: Final = re.compile(r"sep=([,;\t])\r?\n", re.IGNORECASE)  # a line for a spreadsheet


@dataclass(frozen=True, slots=True)
class ReadRow:
    """A row that can be taken: its line in the file, the name, and the checked values."""

    line: int
    name: str
    values: Mapping[str, Any]


@dataclass(frozen=True, slots=True)
class BadRow:
    """A row that is refused: its line, and why."""

    line: int
    reason: TextLike


@dataclass(frozen=True, slots=True)
class UnclearRow(BadRow):
    """A number of which it is not clear what its decimal sign is: nothing of the file is taken."""

    written: str
    point: TextLike
    comma: TextLike


def decoded(content: bytes) -> str:
    """The text of a file as spreadsheets write it: UTF-8, UTF-16 with a byte order mark, or
    Windows-1252."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", "replace")
    if b"\0" in content:
        raise InputError("the file has zero bytes: save it as CSV in UTF-8")
    for encoding in ("utf-8-sig", "cp1252"):
        try:
            return content.decode(encoding)
        except UnicodeDecodeError:
            continue
    raise InputError("the file is neither UTF-8, UTF-16 nor Windows-1252: save it as CSV in UTF-8")


def recipes_csv(fields: Iterable[Input], recipes: Iterable[Recipe], at: Mapping[str, str]) -> str:
    """The recipes as CSV; `at` has when each was changed, by its id."""
    every = list(fields)

    def row(recipe: Recipe) -> Iterator[Cell]:
        yield quoted_cell(recipe.name)
        yield from (_cell(field, recipe.values.get(field.id)) for field in every)
        yield from (recipe.now.number, at.get(recipe.id, ""), quoted_cell(recipe.now.by), "")

    return csv_text([NAME, *(field.id for field in every), *ABOUT, HALF[0]], map(row, recipes))


def _cell(field: Input, value: Any) -> str:
    if value is None:
        return ""
    if isinstance(field, SelectInput):
        return quoted_cell(value if isinstance(value, str) else json.dumps(value))
    if isinstance(value, bool):
        return "true" if value else "false"
    return number_of(value) if isinstance(value, int | float) else quoted_cell(str(value))


def read_rows(text: str, fields: Iterable[Input], decimal: str = "") -> Iterator[ReadRow | BadRow]:
    """The rows of a CSV, in their order; a file that has none is one bad row. `decimal` is its decimal
    sign, "" if only the file says it."""
    every = list(fields)
    plain = text.removeprefix(BOM)
    lines = 0
    if named := _SEP.match(plain):
        plain, lines = plain[named.end() :], 1
    head = plain.partition("\n")[0]
    separator = named[1] if named else max(SEPARATORS, key=head.count)
    reader = csv.reader(io.StringIO(plain, newline=""), delimiter=separator, strict=True)
    parsed: list[ReadRow | BadRow] = []
    rows: list[tuple[int, list[str]]] = []
    columns: list[str] = []
    try:
        columns = _without_empty_end([cell.strip() for cell in next(reader, [])], 0)
        if reason := _head_fault(columns, every):
            yield BadRow(lines + 1, reason)
            return
        for cells in reader:
            if any(cell.strip() for cell in cells):
                rows.append((lines + reader.line_num, cells))
    except csv.Error as error:
        parsed.append(BadRow(lines + reader.line_num, say("recipe_csv_unreadable", why=str(error))))
    named_rows = [(line, dict(zip(columns, cells, strict=False))) for line, cells in rows]
    unclear = None
    if not decimal:
        decimal, unclear = _decimal_sign(columns, named_rows, every)
    if unclear is not None:
        yield unclear
        return
    names: set[str] = set()
    too_many = say("recipe_too_many", most=MAX_RECIPES)
    for count, (line, cells) in enumerate(rows):
        if count >= MAX_RECIPES:
            yield BadRow(line, too_many)
            continue
        yield _row(line, columns, cells, every, names, NOTATIONS[decimal])
    yield from parsed


def _without_empty_end(cells: list[str], least: int) -> list[str]:
    """The cells without empty ones at the end, which spreadsheets add; `least` cells stay."""
    while len(cells) > least and not cells[-1].strip():
        cells = cells[:-1]
    return cells


def _decimal_sign(
    columns: Sequence[str], rows: Iterable[tuple[int, Mapping[str, str]]], fields: Iterable[Input]
) -> tuple[str, UnclearRow | None]:
    """The decimal sign that the file itself says: by the header of its last column, else by numbers
    that are numbers with one sign only. Else the first number that is not clear."""
    if HALF[0] in columns or HALF[1] in columns:
        return ("." if HALF[0] in columns else ","), None
    numeric = [field for field in fields if isinstance(field, Numeric)]
    proven: set[str] = set()
    unclear: UnclearRow | None = None
    for line, row in rows:
        for cell in (row.get(field.id, "").strip() for field in numeric):
            read = {sign: read_number(cell, language) for sign, language in NOTATIONS.items()}
            known = [sign for sign, value in read.items() if value is not None]
            if len(known) == 1:
                proven.update(known)
            elif known and read["."] != read[","]:
                unclear = unclear or _unclear(line, cell, read)
    if unclear is None or len(proven) == 1:
        return (proven.pop() if len(proven) == 1 else "."), None
    return "", unclear


def _unclear(line: int, cell: str, read: Mapping[str, float | None]) -> UnclearRow:
    point, comma = (number(clear_text(number_of(read[sign] or 0))) for sign in NOTATIONS)
    reason = say("recipe_csv_decimal", given=cell, point=point, comma=comma, half=HALF[0])
    return UnclearRow(line, reason, cell, point, comma)


def _head_fault(columns: list[str], fields: list[Input]) -> TextLike:
    wanted = [NAME, *(field.id for field in fields)]
    for column in wanted:
        if column not in columns:
            return say("recipe_csv_column_missing", column=column, columns=tuple(wanted))
    for column in columns:
        if column not in (*wanted, *ABOUT, *HALF):
            return say("recipe_csv_column_unknown", column=column[:60], columns=tuple(wanted))
        if columns.count(column) > 1:
            return say("recipe_csv_column_twice", column=column[:60])
    return ""


def _row(
    line: int,
    columns: list[str],
    cells: list[str],
    fields: list[Input],
    names: set[str],
    language: str,
) -> ReadRow | BadRow:
    cells = _without_empty_end(cells, len(columns))
    lacking = columns[len(cells) :]
    if len(cells) > len(columns) or not {*lacking} <= {*ABOUT, *HALF}:
        return BadRow(line, say("recipe_csv_cells", count=len(cells), wanted=len(columns)))
    row = dict(zip(columns, cells, strict=False))
    name = clean_name(text_in_cell(row[NAME]))
    if fault := name_fault(name, names):
        return BadRow(line, fault)
    names.add(name)
    try:
        values = {field.id: _value(field, row[field.id], language) for field in fields}
        return ReadRow(line, name, checked_values(fields, values))
    except InputError as error:
        return BadRow(line, error.text)


def _value(field: Input, cell: str, language: str) -> Any:
    if isinstance(field, SelectInput):
        return text_in_cell(cell)
    text = text_in_cell(cell) if cell.startswith("'") else cell
    if isinstance(field, Numeric):
        value = read_number(text, language, whole=field.is_whole)
        return text.strip() if value is None else value
    if isinstance(field, ToggleInput):
        return _bool(field, text.strip())
    return field.parse_text(text, language)


def _bool(field: ToggleInput, text: str) -> bool | str:
    """True and false as spreadsheets of some languages write them, or as the toggle is labelled."""
    said = text.casefold()
    for value, words, label in ((True, TRUE, field.on), (False, FALSE, field.off)):
        texts = (*each_language(label).values(), *(render(label, tag) for tag in files()))
        if said in words or said in (text.casefold() for text in texts):
            return value
    return text


# The text of a recipe's file, in TOML, and a recipe from it. Pure.

MAX_FILE_BYTES: Final = 1_000_000  # of a file
MAX_DEPTH: Final = 4  # of lists and tables in a value
HEAD: Final = (
    "# A recipe of the operator panel. It is changed by the panel: stop that before you edit it.\n"
)
ACTS: Final = get_args(Act)


class RecipeFileError(ValueError):
    """Why a text is no recipe."""

    def __init__(self, reason: Text) -> None:
        super().__init__(str(reason))
        self.reason = reason


def recipe_text(recipe: Recipe) -> str:
    """The file of a recipe: its versions, the newest first. The oldest are left out if it would be too
    long."""
    versions = list(recipe.versions)
    while True:
        text = HEAD + "".join(
            line for version in reversed(versions) for line in _version_lines(version)
        )
        if len(text.encode()) <= MAX_FILE_BYTES or len(versions) == 1:
            return text
        versions = versions[len(versions) // 2 :]


def recipe_of(recipe_id: str, content: bytes) -> Recipe | BrokenRecipe:
    """The recipe in a file, or why it is none."""
    try:
        return Recipe(recipe_id, _versions(content))
    except RecipeFileError as error:
        return BrokenRecipe(recipe_id, error.reason)


def _versions(content: bytes) -> tuple[Version, ...]:
    if len(content) > MAX_FILE_BYTES:
        raise RecipeFileError(say("recipe_file_too_long"))
    try:
        tables = tomllib.loads(content.decode())
    except (ValueError, RecursionError) as error:
        raise RecipeFileError(say("recipe_file_no_toml", why=str(error)[:200])) from None
    rows = tables.get("version")
    if not isinstance(rows, list) or not rows or len(rows) > MAX_VERSIONS:
        raise RecipeFileError(say("recipe_file_incomplete", key="version"))
    versions = sorted((_version(row) for row in rows), key=lambda version: version.number)
    if len({version.number for version in versions}) < len(versions):
        raise RecipeFileError(say("recipe_file_incomplete", key="number"))
    return tuple(versions)


def _version(row: Any) -> Version:
    kinds: Mapping[str, type[Any]] = {
        "number": int, "at": datetime, "by": str, "act": str, "name": str, "values": dict,
    }  # fmt: skip
    if not isinstance(row, dict):
        raise RecipeFileError(say("recipe_file_incomplete", key="version"))
    for key, kind in kinds.items():
        if not isinstance(row.get(key), kind) or isinstance(row[key], bool):
            raise RecipeFileError(say("recipe_file_incomplete", key=key))
    at, act, name = row["at"], row["act"], row["name"]
    if row["number"] < 1 or act not in ACTS or not 0 < len(name) <= LONGEST_NAME or at.tzinfo is None:
        raise RecipeFileError(say("recipe_file_incomplete", key="version"))
    for key, value in row["values"].items():
        if not is_plain(value):
            raise RecipeFileError(say("recipe_file_incomplete", key=key))
    return Version(row["number"], at.timestamp(), row["by"], act, name, row["values"])


def is_plain(value: Any, depth: int = 0) -> bool:
    """Whether a value can be kept: what TOML and JSON both have."""
    if isinstance(value, float):
        return math.isfinite(value)
    if isinstance(value, bool | int | str):
        return True
    inner = value.values() if isinstance(value, Mapping) else value
    if not isinstance(value, Mapping | list | tuple) or depth == MAX_DEPTH:
        return False
    return all(is_plain(item, depth + 1) for item in inner)


def _version_lines(version: Version) -> Iterator[str]:
    at = datetime.fromtimestamp(version.at, UTC).isoformat(timespec="milliseconds")
    yield "\n[[version]]\n"
    yield f"number = {version.number}\nat = {at}\nby = {toml_text(version.by)}\n"
    yield f"act = {toml_text(version.act)}\nname = {toml_text(version.name)}\n[version.values]\n"
    yield from (f"{key_text(name)} = {toml_text(value)}\n" for name, value in version.values.items())
