"""The SQLite file of the operator's log: its schema, and queries that do not block the writer."""

import json
import os
import secrets
import sqlite3
import time
from collections.abc import Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final, Literal

from app.records.entry import FIELDS, Entry
from app.system.errors import LogCorrupt, LogError, LogGone, SearchTooLong, os_error_text
from app.system.texts import present_code, say

# The SQLite file of the operator's log: schema, opening, error texts.

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
# What a search by outcome finds: an entry without one by its kind. {} is the table's name and a dot.
RESULT: Final = "CASE WHEN {0}outcome = '' THEN {0}kind ELSE {0}outcome END"
# For finding a repeated press, and entries by their outcome; older files get an index when they are
# opened.
INDEXES: Final = (
    "CREATE INDEX IF NOT EXISTS entry_press ON entry (press) WHERE press <> ''",
    f"CREATE INDEX IF NOT EXISTS entry_result ON entry (({RESULT.format('')}))",
)

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
    for index in INDEXES:
        db.execute(index)


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


def entry_count(db: sqlite3.Connection) -> int:
    (first, last) = db.execute("SELECT min(seq), max(seq) FROM entry").fetchone()
    return last - first + 1 if isinstance(first, int) and isinstance(last, int) else 0


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


# Reads the operator's log without blocking the writer.
#
# Each call is one short read on its own connection: a slow reader keeps nothing open.

LONGEST_SEARCH_S: Final = 5.0
STEPS_BETWEEN_CHECKS: Final = 10_000
MAX_SCANNED: Final = 20_000  # entries, from the newest back

# Without presses whose result is in a later entry.
UNDONE_CONDITION: Final = "e.seq IN (SELECT seq FROM undone)"
CLOSED_CONDITION: Final = f"(e.kind <> 'pressed' OR {UNDONE_CONDITION})"
# Without signatures of the log, one each hour.
UNSIGNED_CONDITION: Final = "e.kind <> 'signed'"
CONDITIONS: Final = {
    "since": "e.at >= :since",
    "until": "e.at < :until",
    "widget": "e.widget = :widget",
    "outcome": f"({RESULT.format('e.')}) = :outcome",
    "who": "(e.who = :who OR e.address = :who)",
    "text": (
        "(e.reason || ' ' || e.\"values\" || ' ' || e.widget || ' ' || e.press || ' ' || e.robot"
        " || ' ' || e.action || ' ' || e.who || ' ' || e.address || ' ' || e.outcome)"
        " LIKE :pattern ESCAPE '\\'"
    ),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Filter:
    """Which entries to read. Times in ms since 1970 (UTC), `since` inclusive, `until` exclusive.

    `every`: also presses whose result is in a later entry, and signatures.
    """

    since: int | None = None
    until: int | None = None
    widget: str = ""
    outcome: str = ""
    who: str = ""
    text: str = ""
    every: bool = False


@dataclass(frozen=True, slots=True)
class LogRow:
    """An entry, with the time of the press that it is about (ms; None if that entry was removed)."""

    entry: Entry
    pressed_at: int | None


@dataclass(frozen=True, slots=True)
class OpenPress:
    """A press without a known end: its entry, the latest outcome and reason ("" without one; `text` is
    the reason with its code), and whether its goal was `accepted`."""

    press: Entry
    outcome: str
    reason: str
    text: str
    accepted: bool

    @property
    def code(self) -> str:
        """The code of the reason, "" without one."""
        return present_code(json.loads(self.text)["code"]) if self.text else ""


def rows(
    folder: Path,
    wanted: Filter,
    before: int | None,
    count: int,
    longest_s: float = LONGEST_SEARCH_S,
) -> list[LogRow]:
    """The newest `count` entries that match before the entry number `before`, the newest first;
    LogError, SearchTooLong after `longest_s`."""
    query, values = log_query(wanted, before, count)
    return [LogRow(Entry(*row[:-1]), row[-1]) for row in _fetch(folder, query, values, longest_s)]


def open_presses(folder: Path, robot: str, widgets: Collection[str], since: int) -> list[OpenPress]:
    """Presses of these widgets of a robot since `since` (ms) without a known end, the newest first.
    LogError."""
    names = {f"widget{number}": widget for number, widget in enumerate(widgets)}
    columns = ", ".join(f'p."{name}"' for name in FIELDS)
    query = f"""
        WITH recent AS (
          SELECT * FROM entry
          WHERE seq > (SELECT max(seq) FROM entry) - {MAX_SCANNED} AND action = 'press'
            AND robot = :robot AND widget IN ({", ".join(f":{name}" for name in names)})
        ), results AS (
          SELECT of, max(seq) AS last, max(outcome = 'accepted') AS accepted FROM recent GROUP BY of
        )
        SELECT {columns}, ifnull(l.outcome, '') AS latest, ifnull(l.reason, ''), ifnull(l.text, ''),
          ifnull(r.accepted, 0)
        FROM recent p LEFT JOIN results r ON r.of = p.seq LEFT JOIN entry l ON l.seq = r.last
        WHERE p.kind = 'pressed' AND p.at >= :since
          AND latest IN ('', 'accepted', 'unknown', 'timed_out')
        ORDER BY p.seq DESC
    """
    rows = _fetch(folder, query, {"robot": robot, "since": since, **names})
    return [
        OpenPress(Entry(*row[:-4]), outcome, reason, text, bool(accepted))
        for row in rows
        for outcome, reason, text, accepted in (row[-4:],)
    ]


def _fetch(
    folder: Path, query: str, values: Mapping[str, Any], longest_s: float = LONGEST_SEARCH_S
) -> list[Any]:
    db = open_read_only(folder)
    end = time.monotonic() + longest_s
    db.set_progress_handler(lambda: time.monotonic() > end, STEPS_BETWEEN_CHECKS)
    try:
        with as_log_error():
            return db.execute(query, values).fetchall()
    except LogError as error:
        if time.monotonic() > end:
            raise SearchTooLong(say("log_search_too_long")) from error
        raise
    finally:
        db.close()


def log_query(wanted: Filter, before: int | None, count: int) -> tuple[str, dict[str, Any]]:
    """The SQL of `rows`, and its values by their names."""
    values = {name: value for name, value in asdict(wanted).items() if value not in (None, "")}
    conditions = [CONDITIONS[name] for name in values if name in CONDITIONS]
    if not wanted.every:
        is_press = wanted.outcome == "pressed"  # then the few are read, not all presses
        conditions.append(UNDONE_CONDITION if is_press else CLOSED_CONDITION)
        conditions += [UNSIGNED_CONDITION] if wanted.outcome != "signed" else []
    if before is not None:
        conditions.append("e.seq < :before")
    where = f"WHERE {' AND '.join(conditions)}" if conditions else ""
    columns = ", ".join(f'e."{name}"' for name in FIELDS)
    query = (
        f"SELECT {columns}, p.at FROM entry e LEFT JOIN entry p ON p.seq = e.of {where}"
        " ORDER BY e.seq DESC LIMIT :count"
    )
    return query, values | {"pattern": _pattern(wanted.text), "before": before, "count": count}


def _pattern(text: str) -> str:
    for special in "\\%_":
        text = text.replace(special, f"\\{special}")
    return f"%{text}%"
