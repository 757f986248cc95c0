"""The recipes of one set as they are on the disk, and their changes. Used on the event loop only.

A change is checked at once against the version that its author saw. It counts when it is on the disk:
until then the recipe is being written, and a second change of it is refused.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Final

from app.clock import format_time
from app.errors import InputError
from app.i18n import Text, TextLike, say
from app.panel.widgets.recipe_load import RecipeLoad
from app.recipes.csv_text import BadRow, ReadRow
from app.recipes.field_text import checked_values
from app.recipes.folder import RecipeDiskError, RecipeFolder
from app.recipes.recipe import (
    MAX_RECIPES,
    Act,
    BrokenRecipe,
    Difference,
    Recipe,
    Values,
    clean_name,
    differences,
    id_for,
    name_fault,
    new_recipe,
)

Entry = Recipe | BrokenRecipe
NO_VALUES: Final[Values] = {}


@dataclass(frozen=True, slots=True)
class Author:
    """Who changes a recipe, and when (seconds since the epoch)."""

    by: str
    at: float


@dataclass(frozen=True, slots=True)
class Change:
    """A checked change that is not yet on the disk. `puts` are the recipes to write, in order, `drops`
    the ids of those to delete."""

    name: str
    puts: tuple[Recipe, ...] = ()
    drops: tuple[str, ...] = ()
    differences: Sequence[Difference] = ()

    @property
    def ids(self) -> tuple[str, ...]:
        return (*(recipe.id for recipe in self.puts), *self.drops)


@dataclass(frozen=True, slots=True)
class ImportChange(Change):
    """The rows of a CSV that can be taken, and the `bad` ones. `same` counts those without a change."""

    bad: tuple[BadRow, ...] = ()
    created: int = 0
    changed: int = 0
    same: int = 0


class RecipeBook:
    """`revision` counts the changes since the start: what pages show of the set depends on it."""

    def __init__(self, load: RecipeLoad, folder: RecipeFolder) -> None:
        self.load = load
        self.folder = folder
        self.revision = 0
        self._entries: dict[str, Entry] = {}
        self._writing: dict[str, Author] = {}

    def fill(self, entries: Iterable[Entry]) -> None:
        """Sets what is on the disk at the start."""
        self._entries = {entry.id: entry for entry in entries}
        self.revision += 1

    @property
    def field_ids(self) -> tuple[str, ...]:
        return tuple(field.id for field in self.load.fields)

    @property
    def recipes(self) -> list[Recipe]:
        """In the order of their names."""
        known = (entry for entry in self._entries.values() if isinstance(entry, Recipe))
        return sorted(known, key=lambda recipe: (recipe.name.casefold(), recipe.id))

    @property
    def broken(self) -> list[BrokenRecipe]:
        return [entry for entry in self._entries.values() if isinstance(entry, BrokenRecipe)]

    def recipe(self, recipe_id: str) -> Recipe | None:
        entry = self._entries.get(recipe_id)
        return entry if isinstance(entry, Recipe) else None

    # Changes: each returns the checked change, or why it can't be made.

    def create(self, author: Author, name: str, values: Values, act: Act = "created") -> Change | Text:
        name = clean_name(name)
        if fault := name_fault(name, self._names()):
            return fault
        if len(self._entries) + len(self._writing) >= MAX_RECIPES:
            return say("recipe_too_many", most=MAX_RECIPES)
        try:
            checked = checked_values(self.load.fields, values)
        except InputError as error:
            return _text(error)
        recipe_id = id_for(name, [*self._entries, *self._writing])
        made = new_recipe(recipe_id, act, author.at, author.by, name, checked)
        return Change(name, (made,), (), differences(self.field_ids, NO_VALUES, checked))

    def copy(self, author: Author, recipe_id: str, version: int, name: str) -> Change | Text:
        known = self._as_seen(recipe_id, version)
        return known if isinstance(known, Text) else self.create(author, name, known.values)

    def save(self, author: Author, recipe_id: str, version: int, values: Values) -> Change | Text:
        known = self._as_seen(recipe_id, version)
        if isinstance(known, Text):
            return known
        try:
            checked = checked_values(self.load.fields, values)
        except InputError as error:
            return _text(error)
        return self._changed(author, known, "saved", checked)

    def restore(self, author: Author, recipe_id: str, version: int, to: int) -> Change | Text:
        known = self._as_seen(recipe_id, version)
        if isinstance(known, Text):
            return known
        old = known.version(to)
        if old is None:
            return say("recipe_version_gone", number=to)
        try:
            checked = checked_values(self.load.fields, old.values)
        except InputError as error:
            return _text(error)
        return self._changed(author, known, "restored", checked)

    def rename(self, author: Author, recipe_id: str, version: int, name: str) -> Change | Text:
        known = self._as_seen(recipe_id, version)
        if isinstance(known, Text):
            return known
        name = clean_name(name)
        if fault := name_fault(name, self._names(known.id)):
            return fault
        new = known.changed("renamed", author.at, author.by, name=name)
        return Change(known.name, (new,), (), [Difference("name", known.name, name)])

    def delete(self, author: Author, recipe_id: str, version: int) -> Change | Text:
        known = self._as_seen(recipe_id, version)
        if isinstance(known, Text):
            return known
        return Change(known.name, (), (known.id,), differences(self.field_ids, known.values, NO_VALUES))

    def take_rows(self, author: Author, rows: Iterable[ReadRow | BadRow]) -> ImportChange:
        """The rows of a CSV: one with the name of a recipe changes that, another makes one. Recipes
        without a row stay."""
        by_name = {recipe.name.casefold(): recipe for recipe in self.recipes}
        taken, puts, bad = [*self._entries], [], []
        created = changed = same = 0
        for row in rows:
            if isinstance(row, BadRow):
                bad.append(row)
                continue
            known = by_name.get(row.name.casefold())
            if known is None and len(taken) >= MAX_RECIPES:
                bad.append(BadRow(row.line, say("recipe_too_many", most=MAX_RECIPES)))
            elif known is None:
                made = id_for(row.name, taken)
                taken.append(made)
                created += 1
                puts.append(new_recipe(made, "imported", author.at, author.by, row.name, row.values))
            elif known.id in self._writing:
                bad.append(BadRow(row.line, self._being_written(known.id)))
            elif not differences(self.field_ids, known.values, row.values):
                same += 1
            else:
                changed += 1
                puts.append(known.changed("imported", author.at, author.by, values=row.values))
        return ImportChange(
            "", tuple(puts), bad=tuple(bad), created=created, changed=changed, same=same
        )

    # Writing: on a thread in between.

    def begin(self, author: Author, change: Change) -> "Writing":
        """Marks the recipes of a change as being written."""
        self._writing |= dict.fromkeys(change.ids, author)
        numbers = {recipe_id: number_of(self._entries.get(recipe_id)) for recipe_id in change.ids}
        return Writing(self.folder, change, numbers)

    def end(self, writing: "Writing") -> None:
        """What is on the disk counts from now on."""
        for recipe_id in writing.change.ids:
            self._writing.pop(recipe_id, None)
        for recipe in writing.change.puts:
            if recipe.id in writing.done:
                self._entries[recipe.id] = recipe
        for recipe_id in writing.change.drops:
            if recipe_id in writing.done:
                self._entries.pop(recipe_id, None)
        self.revision += 1

    def _as_seen(self, recipe_id: str, version: int) -> Recipe | Text:
        """The recipe if it still is what its author saw; else why not."""
        if recipe_id in self._writing:
            return self._being_written(recipe_id)
        known = self.recipe(recipe_id)
        if known is None:
            return say("recipe_gone")
        if known.now.number != version:
            since = known.version(version + 1) or known.now
            return say("recipe_changed_since", name=known.name, by=since.by, time=format_time(since.at))
        return known

    def _being_written(self, recipe_id: str) -> Text:
        return say("recipe_being_written", by=self._writing[recipe_id].by)

    def _changed(self, author: Author, known: Recipe, act: Act, values: Values) -> Change:
        changed = differences(self.field_ids, known.values, values)
        new = known.changed(act, author.at, author.by, values=values)
        return Change(known.name, (new,) if changed else (), (), changed)

    def _names(self, but: str = "") -> list[str]:
        return [recipe.name for recipe in self.recipes if recipe.id != but]


class Writing:
    """A change on its way to the disk; `done` has the ids of the recipes that are there. `numbers` are
    the versions that it was made from, 0 for none."""

    def __init__(self, folder: RecipeFolder, change: Change, numbers: Mapping[str, int]) -> None:
        self.change = change
        self.done: set[str] = set()
        self._folder = folder
        self._numbers = numbers

    def run(self) -> None:
        """Writes it, on a thread; RecipeDiskError where the disk refuses one, or another process has
        changed it."""
        with self._folder.locked():
            for recipe in self.change.puts:
                self._check(recipe.id)
                self._folder.write(recipe)
                self.done.add(recipe.id)
            for recipe_id in self.change.drops:
                self._check(recipe_id)
                self._folder.delete(recipe_id)
                self.done.add(recipe_id)

    def _check(self, recipe_id: str) -> None:
        current = self._folder.current(recipe_id)
        if number_of(current) == self._numbers[recipe_id] or not isinstance(current, Recipe):
            return
        now = current.now
        reason = say("recipe_changed_since", name=current.name, by=now.by, time=format_time(now.at))
        raise RecipeDiskError(reason)


def number_of(entry: Entry | None) -> int:
    """The number of a recipe's version; 0 for none."""
    return entry.now.number if isinstance(entry, Recipe) else 0


def _text(error: InputError) -> Text:
    text: TextLike = error.text
    return text if isinstance(text, Text) else say("with_stop", said=str(text))
