"""When the machine was in which state, in a SQLite database of its own: for the shift report."""

import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import closing
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from app.audit.database import as_log_error

NAME: Final = "states.sqlite3"
MAX_ROWS: Final = 200_000  # some 20 MB; the oldest go
NOT_RECORDED: Final = ""
SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS states (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, at REAL NOT NULL, robot TEXT NOT NULL, state TEXT NOT NULL
);
CREATE TABLE IF NOT EXISTS alive (robot TEXT PRIMARY KEY, at REAL NOT NULL);
"""


class StateRow(NamedTuple):
    """From `at` on (seconds since the epoch) a robot was in a state: JSON of its text, shape and
    colour, or `NOT_RECORDED`."""

    at: float
    robot: str
    state: str


class StatePeriod(NamedTuple):
    """From when to when a robot was in a state."""

    since: float
    until: float
    state: str


def write_states(path: Path, rows: Sequence[StateRow], alive: Iterable[tuple[str, float]]) -> None:
    """Adds rows, and when each robot was last looked at. LogError if the disk refuses."""
    with as_log_error():
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with closing(sqlite3.connect(path, timeout=5.0)) as db, db:
            db.execute("PRAGMA journal_mode = WAL")
            db.executescript(SCHEMA)
            db.executemany("INSERT INTO states (at, robot, state) VALUES (?, ?, ?)", rows)
            db.executemany("INSERT OR REPLACE INTO alive VALUES (?, ?)", alive)
            db.execute("DELETE FROM states WHERE seq <= (SELECT max(seq) FROM states) - ?", (MAX_ROWS,))


def close_states(path: Path) -> None:
    """Ends the states of a server that was killed where it was last alive. LogError."""
    with as_log_error():
        if not path.exists():
            return
        with closing(sqlite3.connect(path, timeout=5.0)) as db:
            alive = db.execute("SELECT at, robot FROM alive").fetchall()
    write_states(path, [StateRow(at, robot, NOT_RECORDED) for at, robot in alive], [])


def read_states(path: Path, robot: str, since: float, until: float) -> list[StatePeriod]:
    """The periods of a robot in a time, the first first; times without a record have none. Times that
    the clock went through twice, as it was set back, count once. LogError."""
    if not path.exists() or since >= until:
        return []
    with as_log_error(), closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as db:
        rows = db.execute(
            "SELECT at, state FROM states WHERE robot = ? AND at < ? AND seq >= ifnull((SELECT max(seq)"
            " FROM states WHERE robot = ? AND at <= ?), 0) ORDER BY seq",
            (robot, until, robot, since),
        ).fetchall()
    periods: list[StatePeriod] = []
    begun = since
    for (at, state), (following, _) in pairwise([*rows, (until, NOT_RECORDED)]):
        begin, end = max(begun, at), min(following, until)
        if state != NOT_RECORDED and begin < end:
            periods.append(StatePeriod(begin, end, state))
            begun = end
    return periods
