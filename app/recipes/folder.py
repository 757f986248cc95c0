"""The folder of a set of recipes: a TOML file each, written whole or not at all.

A file is written beside the old one, synced, and renamed over it; then the folder is synced. Whatever
ends in between, the old file or the new one is there. The server and the command line write it, each
while it holds the lock of all sets.
"""

import fcntl
import os
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final

from app.errors import OS_ERRORS
from app.i18n import Text, say
from app.printable import printable
from app.recipes.file_text import MOST_BYTES, recipe_of, recipe_text
from app.recipes.recipe import ID, BrokenRecipe, Recipe

FOLDER: Final = "recipes"  # of the data folder
LOCK: Final = "recipes.lock"  # in it
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

    @contextmanager
    def locked(self) -> Iterator[None]:
        """No other process changes recipes while it lasts; RecipeDiskError if it can't be locked."""
        try:
            _make(self.path.parent)
            fd = os.open(
                self.path.parent / LOCK, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600
            )
        except OSError as error:
            raise _disk_error(error) from error
        try:
            _give_to_owner(fd, self.path.parent)
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

    def write(self, recipe: Recipe) -> None:
        """Puts a recipe on the disk; RecipeDiskError if it is not there then."""
        try:
            _make(self.path)
            write_file(self._file(recipe.id), recipe_text(recipe).encode())
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


def write_file(file: Path, content: bytes) -> None:
    """Writes a file whole or not at all, and syncs it; OSError if it is not there then."""
    part = file.with_suffix(PART)
    flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_NOFOLLOW | os.O_CLOEXEC
    try:
        with open(os.open(part, flags, 0o600), "wb") as written:
            _give_to_owner(written.fileno(), file.parent)
            written.write(content)
            written.flush()
            os.fsync(written.fileno())
        os.replace(part, file)
    except OSError:
        with suppress(OSError):
            part.unlink()
        raise
    _sync(file.parent)


def _make(folder: Path) -> None:
    """Makes a folder and those that it is in."""
    if folder.is_dir():
        return
    if not folder.parent.is_dir():
        _make(folder.parent)
    folder.mkdir(mode=0o700, exist_ok=True)
    _give_to_owner(folder, folder.parent)
    _sync(folder.parent)


def _give_to_owner(file: int | Path, folder: Path) -> None:
    """What root makes belongs to the owner of the folder that it is in, so that the server can use
    it."""
    if os.geteuid() == 0:
        owner = folder.stat()
        with suppress(OSError):
            os.chown(file, owner.st_uid, owner.st_gid)


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
