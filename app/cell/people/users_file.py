"""The users' file in the data folder, and the state that is kept beside it."""

import fcntl
import hashlib
import json
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.cell.people.users import Edit, UserBook, UsersError, book_of
from app.system.errors import os_error_text
from app.system.texts import TextLike
from app.system.whole_file import give_to_owner_of, write_whole

# What is kept beside the users' file: whether the panel has users, which of their changes the
# operator's log has, and when users and tokens were last used. A users' file that is missing though the
# panel had users locks the panel.

log = logging.getLogger("kiosk.access")

STATE: Final = "users.logged"


@dataclass(frozen=True, slots=True)
class LastUses:
    """When users last signed in (ISO 8601, by their names), and when tokens were last used (in whole
    hours)."""

    users: dict[str, str] = field(default_factory=dict)
    tokens: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class UsersState:
    """`logged` is the number of the last logged change of the users' file `book`. `configured`: whether
    the panel has users."""

    logged: int = 0
    last: LastUses = field(default_factory=LastUses)
    book: str = ""
    configured: bool = False


def book_id(book: UserBook) -> str:
    """Which users' file it is: one that was made again numbers its changes from 1."""
    return hashlib.sha256(book.badge_salt.encode()).hexdigest()[:16]


def read_state(folder: Path) -> UsersState:
    """The state of a data folder. Blocks."""
    try:
        content: Any = json.loads((folder / STATE).read_text(encoding="utf-8"))
        last = LastUses(_texts(content.get("signed_in", {})), _texts(content["used"]))
        logged = int(content["logged"])
        configured = bool(content.get("configured", logged > 0))
        return UsersState(logged, last, str(content.get("book", "")), configured)
    except (OSError, ValueError, KeyError, TypeError, AttributeError):
        return UsersState()


def write_state(folder: Path, state: UsersState) -> None:
    """Replaces the file; logs why it can't. Blocks."""
    path = folder / STATE
    content = {
        "logged": state.logged,
        "book": state.book,
        "configured": state.configured,
        "used": state.last.tokens,
        "signed_in": state.last.users,
    }
    try:
        write_whole(path, json.dumps(content).encode(), durable=False)
    except OSError as error:
        log.warning("%s can not be written: %s", path, error)


def _texts(texts: dict[Any, Any]) -> dict[str, str]:
    return {str(name): str(text) for name, text in texts.items()}


# The users' file in the data folder: readable by its user only, written whole or not at all.

NAME: Final = "users.json"
LOCK: Final = "users.lock"
MOST_BYTES: Final = 4 * 1024 * 1024
OTHERS_MAY_WRITE: Final = 0o022

Stamp = tuple[int, int, int]  # of a version of the file
NEVER_READ: Final[Stamp] = (-1, -1, -1)


def users_configured(folder: Path) -> bool:
    """Whether this data folder has users. A file that can't be read counts, and one that is lost: it
    locks."""
    try:
        book = UsersFile(folder).read()
    except (UsersError, OSError):
        return True
    return book.configured or is_lost(book, read_state(folder).configured)


def is_lost(book: UserBook, had_users: bool) -> bool:
    """Whether the users of a panel are gone without a change that says so: the file is missing, or
    empty."""
    return had_users and not book.configured and not book.opened


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
            give_to_owner_of(self.folder, fd)
            fcntl.flock(fd, fcntl.LOCK_EX)
            yield
        finally:
            os.close(fd)

    def _write(self, text: str) -> None:
        write_whole(self.path, text.encode(), of_folder=True)
