"""What an import of recipes would change, as its page shows it before anything is taken."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from hashlib import sha256

from app.cell.recipes.book import Author, RecipeBook
from app.cell.recipes.recipe import BadRow, ReadRow, Recipe, UnclearRow, differences, value_text
from app.system.texts import TextLike, number, say
from app.web.pages.recipes_page import word
from app.web.pages.words import AskedChange


@dataclass(frozen=True, slots=True)
class ComparedRecipe:
    """A recipe that an import would make or change, with each value that differs."""

    name: str
    is_new: bool
    changes: Sequence[AskedChange]


@dataclass(frozen=True, slots=True)
class Comparison:
    """`text` and `decimal` are what is imported, `seen` is what an import sends back. `unclear` is a
    number of which the decimal sign is not known: then nothing is compared."""

    text: str
    decimal: str
    seen: str
    summary: TextLike
    recipes: Sequence[ComparedRecipe]
    refused: Sequence[TextLike]
    unclear: UnclearRow | None


def seen_of(book: RecipeBook, text: str | None, decimal: str | None) -> str:
    """What a comparison is of: the text, its decimal sign and the recipes that are there."""
    plain = (text or "").replace("\r\n", "\n")  # a form changes the ends of lines
    whole = f"{book.revision} {decimal or ''} {plain}"
    return sha256(whole.encode("utf-8", "surrogatepass")).hexdigest()


def comparison(
    book: RecipeBook, rows: Iterable[ReadRow | BadRow], text: str, decimal: str, seen: str
) -> Comparison:
    """What an import of these rows of a text would change now."""
    change = book.take_rows(Author("", 0.0), rows)
    unclear = next((row for row in change.bad if isinstance(row, UnclearRow)), None)
    counts = {"created": change.created, "changed": change.changed, "same": change.same}
    shown = {key: number(str(count)) for key, count in counts.items()}
    return Comparison(
        text,
        decimal,
        seen,
        word("import_ready", **shown) if unclear is None else "",
        [_compared(book, recipe) for recipe in change.puts],
        [say("recipe_bad_row", line=row.line, why=row.reason) for row in change.bad],
        unclear,
    )


def _compared(book: RecipeBook, recipe: Recipe) -> ComparedRecipe:
    known = book.recipe(recipe.id)
    old = known.values if known is not None else {}
    fields = {field.id: field for field in book.load.fields}
    changes = [
        AskedChange(
            fields[each.field].label,
            value_text(fields[each.field], each.old),
            value_text(fields[each.field], each.new),
        )
        for each in differences(fields, old, recipe.values)
    ]
    return ComparedRecipe(recipe.name, known is None, changes)
