"""The folder of a set of recipes: a TOML file each, written whole or not at all.

A file is written beside the old one, synced, and renamed over it; then the folder is synced. Whatever
ends in between, the old file or the new one is there.
"""

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

from app.errors import OS_ERRORS
from app.i18n import Text, say
from app.printable import printable
from app.recipes.file_text import MOST_BYTES, recipe_of, recipe_text
from app.recipes.recipe import ID, BrokenRecipe, Recipe

FOLDER: Final = "recipes"  # of the data folder
DELETED: Final = "deleted"  # where a deleted recipe's file goes
MOST_DELETED: Final = 50
SUFFIX: Final = ".toml"
PART: Final = ".part"  # of a file that is being written
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

    def write(self, recipe: Recipe) -> None:
        """Puts a recipe on the disk; RecipeDiskError if it is not there then."""
        try:
            self._make()
            self._write(self._file(recipe.id), recipe_text(recipe).encode())
        except OSError as error:
            raise _disk_error(error) from error

    def delete(self, recipe_id: str) -> None:
        """Moves a recipe's file to the folder of deleted ones, which keeps some."""
        try:
            deleted = self.path / DELETED
            deleted.mkdir(mode=0o700, exist_ok=True)
            os.replace(self._file(recipe_id), deleted / f"{recipe_id}.{time.time_ns()}{SUFFIX}")
            _sync(self.path)
            for old in sorted(deleted.iterdir(), key=lambda file: file.stat().st_mtime)[:-MOST_DELETED]:
                old.unlink()
        except FileNotFoundError:
            pass
        except OSError as error:
            raise _disk_error(error) from error

    def _make(self) -> None:
        if not self.path.is_dir():
            self.path.mkdir(mode=0o700, parents=True, exist_ok=True)
            _sync(self.path.parent)

    def _file(self, recipe_id: str) -> Path:
        if not ID.fullmatch(recipe_id):
            raise ValueError(f'"{recipe_id}" is not the id of a recipe')
        return self.path / f"{recipe_id}{SUFFIX}"

    def _read(self, recipe_id: str) -> Recipe | BrokenRecipe:
        try:
            fd = os.open(self._file(recipe_id), os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
            with open(fd, "rb") as file:
                content = file.read(MOST_BYTES + 1)
        except OSError as error:
            return BrokenRecipe(recipe_id, _disk_error(error).reason)
        return recipe_of(recipe_id, content)

    def _write(self, file: Path, content: bytes) -> None:
        part = file.with_suffix(PART)
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
        try:
            with open(os.open(part, flags, 0o600), "wb") as written:
                written.write(content)
                written.flush()
                os.fsync(written.fileno())
            os.replace(part, file)
        except OSError:
            with suppress(OSError):
                part.unlink()
            raise
        _sync(self.path)


def _sync(folder: Path) -> None:
    fd = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(fd)
    finally:
        os.close(fd)


def _disk_error(error: OSError) -> RecipeDiskError:
    code = OS_ERRORS.get(error.errno or 0)
    why = say(code) if code else printable(error.strerror or type(error).__name__)
    return RecipeDiskError(say("recipe_disk_failed", why=why))
