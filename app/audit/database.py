"""The SQLite file of the operator's log: schema, opening, error texts."""

import os
import secrets
import sqlite3
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Final, Literal

from app.errors import LogCorrupt, LogError, LogGone, os_error_text
from app.i18n import say

NAME: Final = "operators-log.sqlite3"
SUFFIXES: Final = ("", "-wal", "-shm")
APPLICATION: Final = 0x4F504C47  # "OPLG"
VERSION: Final = 2
BUSY_TIMEOUT_S: Final = 1.0  # waiting for another program's lock on the file

# `undone` has the presses without a known end; it can be rebuilt from `entry`.
SCHEMA: Final = """
CREATE TABLE entry (
  seq INTEGER PRIMARY KEY, at INTEGER NOT NULL, boot TEXT NOT NULL, monotonic INTEGER NOT NULL,
  kind TEXT NOT NULL, of INTEGER, address TEXT NOT NULL, browser TEXT NOT NULL, who TEXT NOT NULL,
  robot TEXT NOT NULL, press TEXT NOT NULL, widget TEXT NOT NULL, action TEXT NOT NULL,
  "values" TEXT NOT NULL, seen TEXT NOT NULL, verdict TEXT NOT NULL, board TEXT NOT NULL,
  outcome TEXT NOT NULL, reason TEXT NOT NULL, prev TEXT NOT NULL, hash TEXT NOT NULL,
  text TEXT NOT NULL DEFAULT ''
) STRICT;
CREATE TABLE undone (seq INTEGER PRIMARY KEY, outcome TEXT NOT NULL) STRICT;
CREATE TABLE about (key TEXT PRIMARY KEY, value ANY NOT NULL) STRICT, WITHOUT ROWID;
"""
# For finding a repeated press; older files get the index when they are opened.
INDEX: Final = "CREATE INDEX IF NOT EXISTS entry_press ON entry (press) WHERE press <> ''"

# The code of the sentence for each error of SQLite that an operator may read.
ERRORS: Final = {
    "SQLITE_FULL": "disk_full",
    "SQLITE_READONLY": "disk_file_read_only",
    "SQLITE_CANTOPEN": "disk_file_not_opened",
    "SQLITE_BUSY": "disk_file_locked",
    "SQLITE_PERM": "disk_file_not_permitted",
    "SQLITE_IOERR": "disk_failed",
}


@dataclass(frozen=True, slots=True)
class Head:
    """The newest entry and the number of entries; without entries `hash` is the genesis."""

    seq: int
    hash: str
    count: int


DAMAGED: Final = frozenset({"SQLITE_CORRUPT", "SQLITE_NOTADB"})


@contextmanager
def as_log_error() -> Iterator[None]:
    """Converts errors of SQLite and the system to LogError, or LogCorrupt if the file is damaged."""
    try:
        yield
    except sqlite3.Error as error:
        name = getattr(error, "sqlite_errorname", "")
        short = "_".join(name.split("_")[:2])
        if short in DAMAGED:
            raise LogCorrupt(f"the file is damaged: {error}") from error
        raise LogError(say(ERRORS[short]) if short in ERRORS else str(error)) from error
    except OSError as error:
        raise LogError(os_error_text(error)) from error


def open_database(folder: Path, after: Head | None = None) -> sqlite3.Connection:
    """Opens the file for writing, and creates it if needed: then its first entry follows the entry
    `after` of an earlier file, if given.

    LogCorrupt if it is not an operator's log, LogError if it can't be opened.
    """
    path = folder / NAME
    with as_log_error():
        os.close(os.open(path, os.O_RDWR | os.O_CREAT, 0o600))
        db = sqlite3.connect(path, timeout=BUSY_TIMEOUT_S, isolation_level=None)
        try:
            _check_or_create(db, after)
        except BaseException:
            db.close()
            raise
    return db


def _check_or_create(db: sqlite3.Connection, after: Head | None) -> None:
    db.execute("PRAGMA auto_vacuum = INCREMENTAL")  # effective in a new file only
    db.execute("PRAGMA journal_mode = WAL")
    db.execute("PRAGMA synchronous = NORMAL")
    db.execute("PRAGMA wal_autocheckpoint = 0")
    application, version, tables = (
        db.execute(question).fetchone()[0]
        for question in (
            "PRAGMA application_id",
            "PRAGMA user_version",
            "SELECT count(*) FROM sqlite_schema WHERE name IN ('entry', 'undone', 'about')",
        )
    )
    if not application and not version and not tables:
        _create_tables(db, after)
    elif application != APPLICATION or tables != 3:
        raise LogCorrupt("the file is not an operator's log")
    elif version == 1:
        _add_text(db)
    elif version != VERSION:
        raise LogError(say("log_other_version", version=version, own=VERSION))
    db.execute(INDEX)


def _create_tables(db: sqlite3.Connection, after: Head | None) -> None:
    genesis, first = (after.hash, after.seq + 1) if after else (secrets.token_hex(32), 1)
    db.executescript(
        f"BEGIN; {SCHEMA} PRAGMA application_id = {APPLICATION}; PRAGMA user_version = {VERSION};"
    )
    db.executemany("INSERT INTO about VALUES (?, ?)", [("genesis", genesis), ("first", first)])
    db.execute("COMMIT")


def _add_text(db: sqlite3.Connection) -> None:
    """Upgrades a file of version 1, which has no codes of reasons; its entries stay unchanged."""
    column = "text TEXT NOT NULL DEFAULT ''"
    db.executescript(f"BEGIN IMMEDIATE; ALTER TABLE entry ADD COLUMN {column}; "
                     f"PRAGMA user_version = {VERSION}; COMMIT")  # fmt: skip


def open_read_only(folder: Path) -> sqlite3.Connection:
    """A read-only connection, which does not block the writer."""
    with as_log_error():
        path = folder / NAME
        path.stat()
        db = sqlite3.connect(
            f"{path.absolute().as_uri()}?mode=ro",
            uri=True,
            timeout=BUSY_TIMEOUT_S,
            isolation_level=None,
        )
        if db.execute("PRAGMA user_version").fetchone()[0] == 1:  # not upgraded by a server yet
            db.execute("CREATE TEMP VIEW entry AS SELECT *, '' AS text FROM main.entry")
    db.text_factory = lambda data: data.decode("utf-8", "replace")
    return db


class Files:
    """The files of an open database, to notice if one is replaced after it was opened.

    Identified by inode instead of an open descriptor: closing any descriptor of a file releases all of
    SQLite's locks on it.
    """

    def __init__(self, folder: Path, name: str = NAME) -> None:
        self._main = name
        self._known = {str(path): _inode(str(path)) for path in _paths(folder, name)}

    def check(self) -> None:
        """LogGone if a file was removed, renamed or replaced; LogCorrupt if it was emptied."""
        for path, known in self._known.items():
            try:
                inode = _inode(path)
            except OSError:
                inode = None
            if inode != known:
                name = os.path.basename(path)
                raise LogGone(say("log_file_removed", name=name), itself=name == self._main)
        if not os.stat(next(iter(self._known))).st_size:
            raise LogCorrupt(say("log_file_emptied"))


def _paths(folder: Path, name: str = NAME) -> list[Path]:
    return [folder / (name + suffix) for suffix in SUFFIXES]


def _inode(path: str) -> tuple[int, int]:
    status = os.stat(path)
    return status.st_dev, status.st_ino


def make_room(folder: Path) -> str:
    """Makes room for a new log after the old one was removed. A file that another program put there is
    renamed; returns its new name, "" without one."""
    main, wal, shm = _paths(folder)
    if main.exists() or (wal.exists() and wal.stat().st_size):
        return set_aside(folder, "found")
    wal.unlink(missing_ok=True)
    shm.unlink(missing_ok=True)  # an index of the other two
    return ""


def set_aside(folder: Path, word: Literal["damaged", "found"] = "damaged", database: str = NAME) -> str:
    """Renames a database that can't be used; returns the new name, with the time. Nothing is deleted.
    LogError if that fails."""
    stamp = time.strftime("%Y%m%dT%H%M%SZ", time.gmtime())
    stem = database.removesuffix(".sqlite3")
    number, name = 0, f"{stem}.{word}-{stamp}.sqlite3"
    while any((folder / (name + suffix)).exists() for suffix in SUFFIXES):
        number += 1
        name = f"{stem}.{word}-{stamp}.{number}.sqlite3"
    with as_log_error():
        for suffix in reversed(SUFFIXES):
            old = folder / (database + suffix)
            if old.exists():
                old.rename(folder / (name + suffix))
    return name


def make_way(folder: Path, database: str, error: LogError) -> str:
    """Makes way for a new database, after `check` of the old one has failed: a damaged one is kept, and
    of one that is gone the journal is removed, with which a new one must not be opened. Returns the
    name of the one that is kept, "" without one; LogError if that fails."""
    if isinstance(error, LogCorrupt):
        return set_aside(folder, database=database)
    if isinstance(error, LogGone) and error.is_main_file:
        with as_log_error():
            for suffix in SUFFIXES[1:]:
                (folder / (database + suffix)).unlink(missing_ok=True)
    return ""
