"""Acts on recipes: the rows of create, copy, save, rename, restore, delete and import.

`ActRequest.object` is "<set>/<recipe>", of acts on the whole set "<set>/". `values` has the `version`
that the screen showed, and what the act needs; `read` has the `rows` of an import. Who may do them is
their permission: control, as for other acts. Loading a recipe is a press.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol

from app.cell.commands.acts import Act, ActRequest, Applied, Finish, server_and_control_permit
from app.cell.permission.roles import ConfirmLocks, unconfirmed
from app.cell.permission.verdict import Verdict
from app.cell.recipes.book import Author, BookChange, ImportChange, RecipeBook
from app.cell.recipes.recipe import UnclearRow, differences_text
from app.panel.roles import MAINTENANCE
from app.system.errors import InputError
from app.system.texts import Text, TextLike, joined, number, say

MOST_BAD: Final = 5  # rows that a sentence names


class RecipeBooks(Protocol):
    """The recipes of all sets."""

    def book(self, set_id: str) -> RecipeBook | None: ...

    def wall(self) -> float:
        """Seconds since the epoch."""

    def write(self, book: RecipeBook, author: Author, change: BookChange) -> Finish:
        """Begins to write a change; the function returned waits for its end."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RecipeChange(Applied):
    """What an act changed: the set's label, the recipe's name, and the old and new values as text."""

    set: TextLike = ""
    name: TextLike = ""
    changes: TextLike = ""


def lock_of_recipe(
    books: RecipeBooks, confirm_locks: ConfirmLocks, request: ActRequest
) -> Verdict | None:
    """Why an act is refused because no person has confirmed it, or none can; None if it is not."""
    book = books.book(request.object.partition("/")[0])
    confirmation = book.load.set.confirm_edit if book else None
    if book is None or confirmation is None:
        return None
    lock = confirm_locks.lock_of(edit_key(book.load.id))
    return lock or unconfirmed(confirmation, request.who, request.confirmed)


def edit_key(set_id: str) -> str:
    """Under which `ConfirmLocks` has the changes of a set of recipes."""
    return f"recipe {set_id}"


Plan = Callable[[RecipeBook, Author, str, Mapping[str, Any]], BookChange | Text]


def _changes(plan: Plan) -> Callable[[RecipeBooks, ActRequest], RecipeChange]:
    """`Act.apply` from what plans a change of one set."""

    def apply(books: RecipeBooks, request: ActRequest) -> RecipeChange:
        set_id, _, recipe_id = request.object.partition("/")
        book = books.book(set_id)
        if book is None:
            return RecipeChange(say("recipe_gone"))
        author = Author(str(request.who), books.wall())
        change = plan(book, author, recipe_id, {**request.values, **request.read})
        if isinstance(change, Text):
            return RecipeChange(change)
        note = _import_text(change) if isinstance(change, ImportChange) else None
        if (
            isinstance(note, Text)
            and isinstance(change, ImportChange)
            and change.bad
            and not change.puts
        ):
            return RecipeChange(note)
        return RecipeChange(
            finish=books.write(book, author, change) if change.ids else None,
            note=note or "",
            set=book.load.label,
            name=change.name,
            changes=note or _changed_text(book, change),
        )

    return apply


def _changed_text(book: RecipeBook, change: BookChange) -> TextLike:
    renamed = [d for d in change.differences if d.field == "name"]
    if renamed:
        return say("recipe_change", label=say("recipe_name"), old=renamed[0].old, new=renamed[0].new)
    return differences_text(book.load.fields, change.differences) or say("recipe_no_change")


def _import_text(change: ImportChange) -> TextLike:
    created, changed, same = (number(str(n)) for n in (change.created, change.changed, change.same))
    said = say("recipe_imported", created=created, changed=changed, same=same)
    if not change.bad:
        return said
    rows = [say("recipe_bad_row", line=row.line, why=row.reason) for row in change.bad[:MOST_BAD]]
    if len(change.bad) > MOST_BAD:
        rows.append(say("recipe_more_bad_rows", number=len(change.bad) - MOST_BAD))
    refused = say("recipe_rows_refused", number=len(change.bad), rows=joined(rows, "between_sentences"))
    return joined((said, refused))


def _version(values: Mapping[str, Any], name: str = "version") -> int:
    version = values.get(name)
    if not isinstance(version, int) or isinstance(version, bool):
        raise InputError(f"{name} must be the number of a version, as the screen showed it")
    return version


def _name(values: Mapping[str, Any]) -> str:
    name = values.get("name")
    if not isinstance(name, str):
        raise InputError("name must be the name of a recipe")
    return name


def _values(values: Mapping[str, Any]) -> Mapping[str, Any]:
    fields = values.get("values")
    if not isinstance(fields, Mapping):
        raise InputError("values must have the value of each field")
    return fields


def _import(book: RecipeBook, author: Author, _: str, values: Mapping[str, Any]) -> BookChange | Text:
    rows = values.get("rows")
    if rows is None:
        raise InputError("csv must be the text of a file")
    change = book.take_rows(author, rows)
    unclear = (row.reason for row in change.bad if isinstance(row, UnclearRow))
    return next((reason for reason in unclear if isinstance(reason, Text)), change)


def _entry(code: str) -> Callable[[RecipeChange], Text]:
    return lambda change: say(code, set=change.set, name=change.name, changes=change.changes)


def _row(word: str, plan: Plan, code: str) -> Act[RecipeBooks, RecipeChange]:
    return Act(word, server_and_control_permit, _changes(plan), _entry(code), MAINTENANCE)


RECIPE_ACTS: Final[Mapping[str, Act[RecipeBooks, RecipeChange]]] = {
    "create": _row(
        "log_page_recipe_create",
        lambda book, author, _, values: book.create(author, _name(values), _values(values)),
        "log_done_recipe_create",
    ),
    "copy": _row(
        "log_page_recipe_copy",
        lambda book, author, recipe, values: book.copy(author, recipe, _version(values), _name(values)),
        "log_done_recipe_create",
    ),
    "save": _row(
        "log_page_recipe_save",
        lambda book, author, recipe, values: book.save(
            author, recipe, _version(values), _values(values)
        ),
        "log_done_recipe_save",
    ),
    "rename": _row(
        "log_page_recipe_rename",
        lambda book, author, recipe, values: book.rename(
            author, recipe, _version(values), _name(values)
        ),
        "log_done_recipe_rename",
    ),
    "restore": _row(
        "log_page_recipe_restore",
        lambda book, author, recipe, values: book.restore(
            author, recipe, _version(values), _version(values, "to")
        ),
        "log_done_recipe_restore",
    ),
    "delete": _row(
        "log_page_recipe_delete",
        lambda book, author, recipe, values: book.delete(author, recipe, _version(values)),
        "log_done_recipe_delete",
    ),
    "import": _row("log_page_recipe_import", _import, "log_done_recipe_import"),
}
