"""The shift report: alarms of a shift, when shifts begin and end, and the states of the machine."""

import sqlite3
from collections.abc import Iterable, Sequence
from contextlib import closing
from dataclasses import astuple, dataclass
from datetime import datetime, timedelta
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from app.cell.alarms.history import HistoryRow, reading
from app.records.database import as_log_error

# What a shift report says of alarms, read from their history.

FREQUENT: Final = 7  # on the page
HIGH: Final = 5
COLUMNS: Final = ", ".join(f'"{name}"' for name in HistoryRow._fields)


class AlarmTimes(NamedTuple):
    """An alarm with how often it was raised, how long it was active in all, and the longest time, in
    seconds; of returns in the time."""

    row: HistoryRow
    raises: int
    active_s: float
    longest_s: float


class HighAlarm(NamedTuple):
    """A raise of an alarm of high priority, with its acknowledgement and its return; None for none."""

    row: HistoryRow
    acknowledged: HistoryRow | None
    returned: HistoryRow | None


class AlarmReport(NamedTuple):
    """The most frequent alarms of a time, and the first raises of high priority of `high_count`."""

    frequent: list[AlarmTimes]
    high: list[HighAlarm]
    high_count: int


def read_report(path: Path | None, since: float, until: float) -> AlarmReport:
    """From `since` on and before `until` (seconds since the epoch); raises as `read_history`."""
    times = {"since": since, "until": until}
    span = "at >= :since AND at < :until"
    with reading(path) as db:

        def rows(condition: str, **values: object) -> list[HistoryRow]:
            query = f"SELECT {COLUMNS} FROM history WHERE {condition}"
            return [HistoryRow(*row) for row in db.execute(query, {**times, **values})]

        def first(event: str, row: HistoryRow) -> HistoryRow | None:
            """The first such event of the same occurrence."""
            condition = (
                "id = :id AND occurrence = :occurrence AND event = :event AND seq > :seq"
                " ORDER BY seq LIMIT 1"
            )
            same = {"id": row.id, "occurrence": row.occurrence, "seq": row.seq, "event": event}
            return next(iter(rows(condition, **same)), None)

        frequent = db.execute(
            "SELECT max(seq) FILTER (WHERE event = 'raised'), sum(event = 'raised') AS raises,"
            " total(lasted_s) FILTER (WHERE event = 'returned'),"
            " ifnull(max(lasted_s) FILTER (WHERE event = 'returned'), 0)"
            f" FROM history WHERE {span} GROUP BY id HAVING raises > 0 ORDER BY raises DESC, id"
            f" LIMIT {FREQUENT}",
            times,
        ).fetchall()
        high = f"{span} AND event = 'raised' AND priority = 1"
        (high_count,) = db.execute(f"SELECT count(*) FROM history WHERE {high}", times).fetchone()
        return AlarmReport(
            [AlarmTimes(rows("seq = :seq", seq=seq)[0], *sums) for seq, *sums in frequent],
            [
                HighAlarm(row, first("acknowledged", row), first("returned", row))
                for row in rows(f"{high} ORDER BY seq LIMIT {HIGH}")
            ],
            high_count,
        )


# When shifts begin and end, by the server's clock. Pure functions.


class Shift(NamedTuple):
    """From when to when it is, in seconds since the epoch."""

    since: float
    until: float


def shift_at(now: float, starts: Sequence[str], back: int = 0) -> Shift:
    """The shift at a time (seconds since the epoch), or that so many before it. `starts` are times of
    day, "06:00", at which shifts begin."""
    today = datetime.fromtimestamp(now).date()
    days = range(-2 - back, 3)
    begins = sorted(
        datetime.fromisoformat(f"{today + timedelta(days=day)}T{start}").timestamp()
        for day in days
        for start in starts
    )
    current = max(n for n, begin in enumerate(begins) if begin <= now)
    return Shift(begins[current - back], begins[current - back + 1])


# When the machine was in which state, in a SQLite database of its own: for the shift report.

NAME: Final = "states.sqlite3"
MAX_ROWS: Final = 200_000  # some 20 MB; the oldest go
NOT_RECORDED: Final = ""
SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS states (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, at REAL NOT NULL, robot TEXT NOT NULL, state TEXT NOT NULL
);
CREATE TABLE IF NOT EXISTS counts (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, at REAL NOT NULL, robot TEXT NOT NULL,
    good REAL, bad REAL, count REAL
);
CREATE INDEX IF NOT EXISTS counts_at ON counts (robot, at);
CREATE TABLE IF NOT EXISTS alive (robot TEXT PRIMARY KEY, at REAL NOT NULL);
"""


class StateRow(NamedTuple):
    """From `at` on (seconds since the epoch) a robot was in a state: JSON of its text, shape and
    colour, or `NOT_RECORDED`."""

    at: float
    robot: str
    state: str


@dataclass(frozen=True, slots=True)
class CountRow:
    """What the counters of a robot showed at `at` (seconds since the epoch); None for not known."""

    at: float
    robot: str
    good: float | None = None
    bad: float | None = None
    count: float | None = None


COUNT_COLUMNS: Final = "at, robot, good, bad, count"


class StatePeriod(NamedTuple):
    """From when to when a robot was in a state."""

    since: float
    until: float
    state: str


def write_states(
    path: Path,
    rows: Sequence[StateRow],
    alive: Iterable[tuple[str, float]],
    counts: Sequence[CountRow] = (),
) -> None:
    """Adds rows, and when each robot was last looked at. LogError if the disk refuses."""
    with as_log_error():
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with closing(sqlite3.connect(path, timeout=5.0)) as db, db:
            db.execute("PRAGMA journal_mode = WAL")
            db.executescript(SCHEMA)
            db.executemany("INSERT INTO states (at, robot, state) VALUES (?, ?, ?)", rows)
            db.executemany("INSERT OR REPLACE INTO alive VALUES (?, ?)", alive)
            db.executemany(
                f"INSERT INTO counts ({COUNT_COLUMNS}) VALUES (?, ?, ?, ?, ?)", map(astuple, counts)
            )
            for table in ("states", "counts"):
                query = f"DELETE FROM {table} WHERE seq <= (SELECT max(seq) FROM {table}) - ?"
                db.execute(query, (MAX_ROWS,))


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


def read_counts(path: Path, robot: str, since: float, until: float) -> list[CountRow]:
    """What the counters of a robot showed in a time, and last before it, in the order of writing; none
    without a file. LogError."""
    if not path.exists() or since >= until:
        return []
    with as_log_error(), closing(sqlite3.connect(f"{path.as_uri()}?mode=ro", uri=True)) as db:
        if not db.execute("SELECT 1 FROM sqlite_schema WHERE name = 'counts'").fetchone():
            return []
        rows = db.execute(
            f"SELECT {COUNT_COLUMNS} FROM counts WHERE robot = ? AND at < ? AND at >="
            " ifnull((SELECT max(at) FROM counts WHERE robot = ? AND at <= ?), 0) ORDER BY seq",
            (robot, until, robot, since),
        ).fetchall()
    return [CountRow(*row) for row in rows]
