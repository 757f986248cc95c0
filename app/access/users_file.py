"""The users' file in the data folder: readable by its user only, written whole or not at all."""

import fcntl
import os
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Final, NamedTuple

from app.access.users import Edit, UserBook, UsersError, book_of
from app.errors import os_error_text
from app.i18n import TextLike

NAME: Final = "users.json"
LOCK: Final = "users.lock"
MOST_BYTES: Final = 4 * 1024 * 1024
OTHERS_MAY_WRITE: Final = 0o022

Stamp = tuple[int, int, int]  # of a version of the file


def users_configured(folder: Path) -> bool:
    """Whether this data folder has users. A file that can't be read counts: it locks."""
    try:
        return UsersFile(folder).read().configured
    except (UsersError, OSError):
        return True


class Loaded(NamedTuple):
    """A version of the file: its book, or why it can't be used."""

    stamp: Stamp | None
    book: UserBook
    fault: TextLike = ""


class UsersFile:
    """The file of one data folder."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.path = folder / NAME

    def stamp(self) -> Stamp | None:
        """Changes with each version of the file; None without a file."""
        try:
            about = self.path.stat()
        except FileNotFoundError:
            return None
        return about.st_mtime_ns, about.st_ino, about.st_size

    def newer(self, stamp: Stamp | None) -> Loaded | None:
        """The file, if its stamp is another one; None otherwise."""
        now: Stamp | None = None
        try:
            if (now := self.stamp()) == stamp:
                return None
            return Loaded(now, self.read())
        except UsersError as error:
            return Loaded(now, UserBook(), error.text)
        except OSError as error:
            return Loaded(now, UserBook(), os_error_text(error))

    def read(self) -> UserBook:
        """What the file has, an empty book without a file. UsersError or OSError if it can't be
        used."""
        try:
            fd = os.open(self.path, os.O_RDONLY | os.O_NOFOLLOW | os.O_CLOEXEC)
        except FileNotFoundError:
            return UserBook()
        with os.fdopen(fd, "rb") as file:
            if os.fstat(fd).st_mode & OTHERS_MAY_WRITE:
                raise UsersError("other accounts may write it: chmod 600")
            content = file.read(MOST_BYTES + 1)
        if len(content) > MOST_BYTES:
            raise UsersError(f"it has more than {MOST_BYTES} bytes")
        try:
            return book_of(content.decode())
        except UnicodeDecodeError:
            raise UsersError("it is not UTF-8") from None

    def edit(self, edit: Edit) -> UserBook:
        """Reads the file, changes it and writes it, while no other process does. UsersError from `edit`
        changes nothing."""
        self.folder.parent.mkdir(parents=True, exist_ok=True)
        self.folder.mkdir(mode=0o700, exist_ok=True)
        with self._locked():
            book = edit(self.read())
            self._write(book.as_text())
        return book

    @contextmanager
    def _locked(self) -> Iterator[None]:
        flags = os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_CLOEXEC
        fd = os.open(self.folder / LOCK, flags, 0o600)
        try:
            self._give_to_owner(fd)
            fcntl.flock(fd, fcntl.LOCK_EX)
            yield
        finally:
            os.close(fd)

    def _write(self, text: str) -> None:
        draft = self.folder / f".{NAME}.{secrets.token_hex(4)}"
        fd = os.open(draft, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC, 0o600)
        try:
            with os.fdopen(fd, "w", encoding="utf-8") as file:
                self._give_to_owner(fd)
                file.write(text)
                file.flush()
                os.fsync(fd)
            draft.replace(self.path)
        except BaseException:
            draft.unlink(missing_ok=True)
            raise
        folder = os.open(self.folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)

    def _give_to_owner(self, fd: int) -> None:
        """A file that root makes belongs to the folder's owner, so that the server can read it."""
        if os.geteuid() == 0:
            owner = self.folder.stat()
            with suppress(OSError):
                os.fchown(fd, owner.st_uid, owner.st_gid)
