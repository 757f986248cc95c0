"""Recipes of a set as CSV: RFC 4180, a row each; read back with the reason for each row that is
refused. Pure."""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from app.errors import InputError
from app.i18n import ENGLISH, TextLike, say
from app.panel.widgets.families import Input
from app.panel.widgets.inputs import SelectInput
from app.recipes.field_text import checked_values, number_of
from app.recipes.recipe import MAX_RECIPES, Recipe, clean_name, name_fault

NAME: Final = "name"
# Columns that an export has and an import leaves alone.
ABOUT: Final = ("version", "changed_at", "changed_by")
SEPARATORS: Final = ",;\t"
MOST_BYTES: Final = 1_000_000
# What a spreadsheet would take as a formula; a "'" before it, and before another one, keeps it a text.
FORMULA: Final = ("=", "+", "-", "@", "\t", "\r", "'")


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


def csv_text(fields: Iterable[Input], recipes: Iterable[Recipe], at: Mapping[str, str]) -> str:
    """The recipes as CSV with a byte order mark; `at` has when each was changed, by its id."""
    every = list(fields)
    made = io.StringIO(newline="")
    writer = csv.writer(made)
    writer.writerow([NAME, *(field.id for field in every), *ABOUT])
    for recipe in recipes:
        cells = (_cell(field, recipe.values.get(field.id)) for field in every)
        about = (recipe.now.number, at.get(recipe.id, ""), _text(recipe.now.by))
        writer.writerow([_text(recipe.name), *cells, *about])
    return "\ufeff" + made.getvalue()


def _cell(field: Input, value: Any) -> str:
    if value is None:
        return ""
    if isinstance(field, SelectInput):
        return _text(value if isinstance(value, str) else json.dumps(value))
    if isinstance(value, bool):
        return "true" if value else "false"
    return number_of(value) if isinstance(value, int | float) else _text(str(value))


def _text(text: str) -> str:
    return f"'{text}" if text.startswith(FORMULA) else text


def _untext(cell: str) -> str:
    return cell[1:] if cell.startswith("'") and cell[1:].startswith(FORMULA) else cell


def read_rows(text: str, fields: Iterable[Input]) -> Iterator[ReadRow | BadRow]:
    """The rows of a CSV, in their order; a file that has none is one bad row."""
    every = list(fields)
    plain = text.removeprefix("\ufeff")
    head = plain.partition("\n")[0]
    separator = max(SEPARATORS, key=head.count)
    try:
        reader = csv.reader(io.StringIO(plain, newline=""), delimiter=separator, strict=True)
        columns = [cell.strip() for cell in next(reader, [])]
        if reason := _head_fault(columns, every):
            yield BadRow(1, reason)
            return
        names: set[str] = set()
        for count, cells in enumerate(row for row in reader if any(cell.strip() for cell in row)):
            line = reader.line_num
            if count == MAX_RECIPES:
                yield BadRow(line, say("recipe_too_many", most=MAX_RECIPES))
                return
            yield _row(line, columns, cells, every, names)
    except csv.Error as error:
        yield BadRow(reader.line_num, say("recipe_csv_unreadable", why=str(error)))


def _head_fault(columns: list[str], fields: list[Input]) -> TextLike:
    wanted = [NAME, *(field.id for field in fields)]
    for column in wanted:
        if column not in columns:
            return say("recipe_csv_column_missing", column=column, columns=tuple(wanted))
    for column in columns:
        if column not in (*wanted, *ABOUT):
            return say("recipe_csv_column_unknown", column=column[:60], columns=tuple(wanted))
        if columns.count(column) > 1:
            return say("recipe_csv_column_twice", column=column[:60])
    return ""


def _row(
    line: int, columns: list[str], cells: list[str], fields: list[Input], names: set[str]
) -> ReadRow | BadRow:
    if len(cells) != len(columns):
        return BadRow(line, say("recipe_csv_cells", count=len(cells), wanted=len(columns)))
    row = dict(zip(columns, cells, strict=True))
    name = clean_name(_untext(row[NAME]))
    if fault := name_fault(name, names):
        return BadRow(line, fault)
    names.add(name)
    try:
        values = {field.id: _value(field, row[field.id]) for field in fields}
        return ReadRow(line, name, checked_values(fields, values))
    except InputError as error:
        return BadRow(line, error.text)


def _value(field: Input, cell: str) -> Any:
    if isinstance(field, SelectInput):
        return _untext(cell)
    return field.parse_text(_untext(cell) if cell.startswith("'") else cell, ENGLISH)
