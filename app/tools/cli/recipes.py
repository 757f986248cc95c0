"""`operator-panel recipes list|export|import`: the recipes in the data folder, without a browser.

A running server takes an import within a second. Exit status: 0 done, 1 a row or a recipe is refused,
2 the panel file, the set or the data folder can't be used.
"""

import os
import sys
import time
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final

from app.cell.recipes.book import (
    FOLDER,
    Author,
    ImportChange,
    RecipeBook,
    RecipeDiskError,
    RecipeFolder,
)
from app.cell.recipes.command_line import LineChanges, account
from app.cell.recipes.recipe import (
    MAX_CSV_BYTES,
    NOTATIONS,
    decoded,
    differences,
    read_rows,
    recipes_csv,
    value_text,
)
from app.panel import load_panel
from app.system.errors import InputError, KioskError
from app.system.settings import Settings
from app.system.texts import render
from app.tools.cli.arguments import add_settings, environment
from app.tools.cli.output import OutputError, add_force, check_absent, draft_of
from app.tools.cli.parser import Parser

PROG: Final = "python -m app.cli recipes"
BY: Final = "{account}, operator-panel recipes"


class NoSuchSet(KioskError):
    """The panel has no such set."""


def main(arguments: Sequence[str], prog: str = PROG) -> int:
    options = make_parser(prog).parse_args(arguments)
    try:
        data, books = _books(options)
        status: int = options.run(options, data, books)
    except OutputError as error:
        print(error, file=sys.stderr)
        return 1
    except (KioskError, OSError) as error:
        print(error, file=sys.stderr)
        return 2
    return status


def _books(options: Any) -> tuple[Path, dict[str, RecipeBook]]:
    """The data folder, and the recipes of each set."""
    settings = Settings.from_environment({**os.environ, **environment(options)})
    panel = load_panel(settings.panel)
    data = settings.data_folder(settings.mode or panel.mode)
    books = {}
    for load in panel.recipe_loads:
        books[load.id] = RecipeBook(load, RecipeFolder(data / FOLDER / load.id))
        books[load.id].fill(books[load.id].folder.read())
    return data, books


def _book(options: Any, books: dict[str, RecipeBook]) -> RecipeBook:
    if options.set not in books:
        there = ", ".join(books) or "no [[recipe]]"
        raise NoSuchSet(f'this panel has no set of recipes "{options.set}"; there is {there}')
    return books[options.set]


def _list(_: Any, data: Path, books: dict[str, RecipeBook]) -> int:
    for name, book in books.items():
        print(f"{name}: {len(book.recipes)} in {data / FOLDER / name}")
        for recipe in book.recipes:
            print(f"  {recipe.id}  {recipe.name}  version {recipe.now.number}, {_at(recipe.now.at)}")
        for broken in book.broken:
            print(f"  {broken.id}  can't be read: {render(broken.reason)}")
    return 1 if any(book.broken for book in books.values()) else 0


def _export(options: Any, _: Path, books: dict[str, RecipeBook]) -> int:
    book = _book(options, books)
    text = recipes_csv(book.load.fields, book.recipes, {r.id: _at(r.now.at) for r in book.recipes})
    if options.output is None:
        print(text.removeprefix("\ufeff"), end="")
        return 0
    check_absent(options.output, options.force)
    with draft_of(options.output, options.force) as draft:
        draft.write_text(text, encoding="utf-8", newline="")
    print(f"{options.output}: {len(book.recipes)} recipes")
    return 0


def _import(options: Any, _: Path, books: dict[str, RecipeBook]) -> int:
    book = _book(options, books)
    content = options.file.read_bytes()[: MAX_CSV_BYTES + 1]
    try:
        text = decoded(content)
    except InputError as error:
        raise KioskError(f"{options.file}: {error}") from None
    if len(content) > MAX_CSV_BYTES:
        raise KioskError(f"{options.file} has more than {MAX_CSV_BYTES} bytes")
    by = account()
    try:
        with book.folder.locked():
            book.fill(book.folder.read())
            author = Author(BY.format(account=by), time.time())
            change = book.take_rows(author, read_rows(text, book.load.fields, options.decimal))
            for row in change.bad:
                print(f"{options.file}:{row.line}: {render(row.reason)}", file=sys.stderr)
            known = {recipe.id: recipe for recipe in book.recipes}
            for line in _changes(book, change):
                print(line)
            if change.puts and not (options.yes or _confirmed()):
                print("nothing is taken: give --yes to take this", file=sys.stderr)
                return 1
            LineChanges(book.folder.path.parent).add(book.load, known, change.puts, by)
            for recipe in change.puts:
                book.folder.write(recipe)
    except RecipeDiskError as error:
        print(render(error.reason), file=sys.stderr)
        return 2
    counts = f"{change.created} new, {change.changed} changed, {change.same} the same"
    print(f"{counts}, {len(change.bad)} refused")
    return 1 if change.bad else 0


def _changes(book: RecipeBook, change: ImportChange) -> Iterator[str]:
    """Each value that an import would change, a line each."""
    fields = {field.id: field for field in book.load.fields}
    for recipe in change.puts:
        known = book.recipe(recipe.id)
        for each in differences(fields, known.values if known else {}, recipe.values):
            label, *values = (
                render(text)
                for text in (
                    fields[each.field].label,
                    value_text(fields[each.field], each.old),
                    value_text(fields[each.field], each.new),
                )
            )
            yield f"  {recipe.name}: {label} {' → '.join(values)}"


def _confirmed() -> bool:
    """Whether a person at the terminal takes it."""
    return sys.stdin.isatty() and input("Take these? [y/N] ").strip().lower() in ("y", "yes")


def _at(wall: float) -> str:
    return datetime.fromtimestamp(wall, UTC).isoformat("T", "seconds")


def make_parser(prog: str) -> Parser:
    parser = Parser(prog=prog, description="The recipes that a panel keeps.")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    listed = commands.add_parser("list", help="list the recipes of each set")
    exported = commands.add_parser("export", help="write a set as CSV")
    imported = commands.add_parser("import", help="take recipes from a CSV file")
    for command in (exported, imported):
        command.add_argument("set", metavar="SET", help="the id of a [[recipe]]")
    imported.add_argument("file", type=Path, metavar="FILE", help="a CSV file, as export writes it")
    imported.add_argument(
        "--decimal", choices=tuple(NOTATIONS), default="", help="the decimal sign of its numbers"
    )
    imported.add_argument("--yes", action="store_true", help="take what is listed without a question")
    exported.add_argument("-o", "--output", type=Path, metavar="FILE", help="default: print it")
    add_force(exported)
    for command, run in ((listed, _list), (exported, _export), (imported, _import)):
        add_settings(command)
        command.set_defaults(run=run)
    return parser
