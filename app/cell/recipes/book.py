"""The recipes of one set as they are on the disk, and their changes. Used on the event loop only.

A change is checked at once against the version that its author saw. It counts when it is on the disk:
until then the recipe is being written, and a second change of it is refused.
"""

import fcntl
import os
import stat
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, NamedTuple

from app.cell.recipes.recipe import (
    ID,
    MAX_FILE_BYTES,
    MAX_RECIPES,
    Act,
    BadRow,
    BrokenRecipe,
    Difference,
    ReadRow,
    Recipe,
    Values,
    checked_values,
    clean_name,
    differences,
    id_for,
    name_fault,
    new_recipe,
    recipe_of,
    recipe_text,
)
from app.panel.widgets.recipe_load import RecipeLoad
from app.system.clock import format_time
from app.system.errors import OS_ERRORS, InputError
from app.system.printable import printable
from app.system.texts import Text, TextLike, say
from app.system.whole_file import give_to_owner_of, sync_folder, write_whole

# The folder of a set of recipes: a TOML file each, written whole or not at all.
#
# A file is written beside the old one, synced, and renamed over it; then the folder is synced. Whatever
# ends in between, the old file or the new one is there. The server and the command line write it, each
# while it holds the lock of all sets.

FOLDER: Final = "recipes"  # of the data folder
LOCK: Final = "recipes.lock"  # in it
DELETED: Final = "deleted"  # where a deleted recipe's file goes
MOST_DELETED: Final = 50
SUFFIX: Final = ".toml"
NO_LINK: Final = os.O_NOFOLLOW | os.O_CLOEXEC  # flags of every open
MOST_FILES: Final = 1000  # that are read


class RecipeDiskError(Exception):
    """Why the disk does not take a recipe."""

    def __init__(self, reason: Text) -> None:
        super().__init__(str(reason))
        self.reason = reason


class RecipeFolder:
    """The files of one set. Its methods wait for the disk: call them on a thread."""

    def __init__(self, path: Path) -> None:
        self.path = path

    @contextmanager
    def locked(self) -> Iterator[None]:
        """No other process changes recipes while it lasts; RecipeDiskError if it can't be locked."""
        try:
            _make(self.path.parent)
            fd = os.open(self.path.parent / LOCK, os.O_RDWR | os.O_CREAT | NO_LINK, 0o600)
        except OSError as error:
            raise disk_error(error) from error
        try:
            give_to_owner_of(self.path.parent, fd)
            fcntl.flock(fd, fcntl.LOCK_EX)
            yield
        finally:
            os.close(fd)

    def current(self, recipe_id: str) -> Recipe | BrokenRecipe | None:
        """What is on the disk under this id now; None for nothing."""
        return self._read(recipe_id) if self._file(recipe_id).exists() else None

    def every(self) -> list[Recipe | BrokenRecipe]:
        """What `read` gives."""
        return list(self.read())

    def read(self) -> Iterator[Recipe | BrokenRecipe]:
        """Every recipe, and what stands in the place of one. Leftovers of a write are not read."""
        try:
            names = sorted(entry.name for entry in os.scandir(self.path) if entry.name.endswith(SUFFIX))
        except FileNotFoundError:
            return
        for name in names[:MOST_FILES]:
            recipe_id = name.removesuffix(SUFFIX)
            if ID.fullmatch(recipe_id):
                yield self._read(recipe_id)
            else:
                yield BrokenRecipe(recipe_id[:80], say("recipe_file_name"))

    def names(self) -> Mapping[str, str]:
        """The ids of all recipes by their names, casefolded; RecipeDiskError if they can't be read."""
        try:
            entries = self.every()
        except OSError as error:
            raise disk_error(error) from error
        return {entry.name.casefold(): entry.id for entry in entries if isinstance(entry, Recipe)}

    def write(self, recipe: Recipe) -> None:
        """Puts a recipe on the disk; RecipeDiskError if it is not there then."""
        try:
            _make(self.path)
            write_file(self._file(recipe.id), recipe_text(recipe).encode())
        except OSError as error:
            raise disk_error(error) from error

    def delete(self, recipe_id: str) -> None:
        """Moves a recipe's file to the folder of deleted ones, which keeps some."""
        try:
            deleted = self.path / DELETED
            deleted.mkdir(mode=0o700, exist_ok=True)
            os.replace(self._file(recipe_id), deleted / f"{recipe_id}.{time.time_ns()}{SUFFIX}")
            sync_folder(self.path)
            for old in sorted(deleted.iterdir(), key=lambda file: file.stat().st_mtime)[:-MOST_DELETED]:
                old.unlink()
        except FileNotFoundError:
            pass
        except OSError as error:
            raise disk_error(error) from error

    def _file(self, recipe_id: str) -> Path:
        if not ID.fullmatch(recipe_id):
            raise ValueError(f'"{recipe_id}" is not the id of a recipe')
        return self.path / f"{recipe_id}{SUFFIX}"

    def _read(self, recipe_id: str) -> Recipe | BrokenRecipe:
        content = read_file(self._file(recipe_id), MAX_FILE_BYTES)
        if isinstance(content, Text):
            return BrokenRecipe(recipe_id, content)
        return recipe_of(recipe_id, content)


def read_file(file: Path, most: int) -> bytes | Text:
    """The content of a regular file, up to one byte more than `most`; or why it can't be read."""
    try:
        # A pipe is opened without waiting for a writer, which may never come.
        fd = os.open(file, os.O_RDONLY | os.O_NONBLOCK | NO_LINK)
        with open(fd, "rb") as opened:
            if not stat.S_ISREG(os.fstat(fd).st_mode):
                return say("recipe_file_not_regular")
            return opened.read(most + 1)
    except OSError as error:
        return disk_error(error).reason


def write_file(file: Path, content: bytes) -> None:
    """Writes a file whole or not at all, and syncs it; OSError if it is not there then."""
    write_whole(file, content, of_folder=True)


def _make(folder: Path) -> None:
    """Makes a folder and those that it is in."""
    if folder.is_dir():
        return
    if not folder.parent.is_dir():
        _make(folder.parent)
    folder.mkdir(mode=0o700, exist_ok=True)
    give_to_owner_of(folder.parent, folder)
    sync_folder(folder.parent)


def disk_error(error: OSError) -> RecipeDiskError:
    """Why the disk did not take a file."""
    code = OS_ERRORS.get(error.errno or 0)
    why = say(code) if code else printable(error.strerror or type(error).__name__)
    return RecipeDiskError(say("recipe_disk_failed", why=why))


Entry = Recipe | BrokenRecipe
NO_VALUES: Final[Values] = {}


@dataclass(frozen=True, slots=True)
class Author:
    """Who changes a recipe, and when (seconds since the epoch)."""

    by: str
    at: float


@dataclass(frozen=True, slots=True)
class BookChange:
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
class ImportChange(BookChange):
    """The rows of a CSV that can be taken, and the `bad` ones. `same` counts those without a change."""

    bad: tuple[BadRow, ...] = ()
    created: int = 0
    changed: int = 0
    same: int = 0


class Pending(NamedTuple):
    """A change of a recipe that is being written: the name that it will have, None if it is deleted."""

    by: str
    name: str | None


class RecipeBook:
    """`revision` counts the changes since the start: what pages show of the set depends on it."""

    def __init__(self, load: RecipeLoad, folder: RecipeFolder) -> None:
        self.load = load
        self.folder = folder
        self.revision = 0
        self._entries: dict[str, Entry] = {}
        self._writing: dict[str, Pending] = {}

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

    def create(
        self, author: Author, name: str, values: Values, act: Act = "created"
    ) -> BookChange | Text:
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
        return BookChange(name, (made,), (), differences(self.field_ids, NO_VALUES, checked))

    def copy(self, author: Author, recipe_id: str, version: int, name: str) -> BookChange | Text:
        known = self._as_seen(recipe_id, version)
        return known if isinstance(known, Text) else self.create(author, name, known.values)

    def save(self, author: Author, recipe_id: str, version: int, values: Values) -> BookChange | Text:
        known = self._as_seen(recipe_id, version)
        if isinstance(known, Text):
            return known
        try:
            checked = checked_values(self.load.fields, values)
        except InputError as error:
            return _text(error)
        return self._changed(author, known, "saved", checked)

    def restore(self, author: Author, recipe_id: str, version: int, to: int) -> BookChange | Text:
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

    def rename(self, author: Author, recipe_id: str, version: int, name: str) -> BookChange | Text:
        known = self._as_seen(recipe_id, version)
        if isinstance(known, Text):
            return known
        name = clean_name(name)
        if fault := name_fault(name, self._names(known.id)):
            return fault
        new = known.changed("renamed", author.at, author.by, name=name)
        return BookChange(known.name, (new,), (), [Difference("name", known.name, name)])

    def delete(self, author: Author, recipe_id: str, version: int) -> BookChange | Text:
        known = self._as_seen(recipe_id, version)
        if isinstance(known, Text):
            return known
        return BookChange(
            known.name, (), (known.id,), differences(self.field_ids, known.values, NO_VALUES)
        )

    def take_rows(self, author: Author, rows: Iterable[ReadRow | BadRow]) -> ImportChange:
        """The rows of a CSV: one with the name of a recipe changes that, another makes one. Recipes
        without a row stay."""
        by_name: dict[str, list[Recipe]] = {}
        for recipe in self.recipes:
            by_name.setdefault(recipe.name.casefold(), []).append(recipe)
        pending = {p.name.casefold(): name for name, p in self._writing.items() if p.name is not None}
        taken, puts, bad = [*self._entries], [], []
        created = changed = same = 0
        for row in rows:
            if isinstance(row, BadRow):
                bad.append(row)
                continue
            same_name = by_name.get(row.name.casefold(), [])
            known = same_name[0] if same_name else None
            if len(same_name) > 1:
                bad.append(BadRow(row.line, say("recipe_csv_name_twice", name=row.name)))
            elif known is None and row.name.casefold() in pending:
                bad.append(BadRow(row.line, self._being_written(pending[row.name.casefold()])))
            elif known is None and len(taken) >= MAX_RECIPES:
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

    def begin(self, author: Author, change: BookChange) -> "Writing":
        """Marks the recipes of a change as being written."""
        names = {recipe.id: recipe.name for recipe in change.puts}
        self._writing |= {name: Pending(author.by, names.get(name)) for name in change.ids}
        numbers = {recipe_id: number_of(self._entries.get(recipe_id)) for recipe_id in change.ids}
        known = {recipe.id: recipe.name for recipe in self.recipes}
        renamed = [recipe for recipe in change.puts if known.get(recipe.id) != recipe.name]
        return Writing(self.folder, change, numbers, renamed)

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

    def _changed(self, author: Author, known: Recipe, act: Act, values: Values) -> BookChange:
        changed = differences(self.field_ids, known.values, values)
        new = known.changed(act, author.at, author.by, values=values)
        return BookChange(known.name, (new,) if changed else (), (), changed)

    def _names(self, but: str = "") -> list[str]:
        """The names that are taken, also by what is being written."""
        known = [recipe.name for recipe in self.recipes if recipe.id != but]
        return [*known, *(p.name for p in self._writing.values() if p.name is not None)]


class Writing:
    """A change on its way to the disk; `done` has the ids of the recipes that are there. `numbers` are
    the versions that it was made from, 0 for none; `renamed` are the recipes that get a name."""

    def __init__(
        self,
        folder: RecipeFolder,
        change: BookChange,
        numbers: Mapping[str, int],
        renamed: Sequence[Recipe] = (),
    ) -> None:
        self.change = change
        self.done: set[str] = set()
        self._folder = folder
        self._numbers = numbers
        self._renamed = renamed

    def run(self) -> None:
        """Writes it, on a thread; RecipeDiskError where the disk refuses one, or another process has
        changed it."""
        with self._folder.locked():
            self._check_names()
            for recipe in self.change.puts:
                self._check(recipe.id)
                self._folder.write(recipe)
                self.done.add(recipe.id)
            for recipe_id in self.change.drops:
                self._check(recipe_id)
                self._folder.delete(recipe_id)
                self.done.add(recipe_id)

    def _check_names(self) -> None:
        """A name may have been given by another process since."""
        names = self._folder.names() if self._renamed else {}
        for recipe in self._renamed:
            if names.get(recipe.name.casefold(), recipe.id) != recipe.id:
                raise RecipeDiskError(say("recipe_name_taken", name=recipe.name))

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
