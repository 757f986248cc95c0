"""The history of alarms, read from the SQLite file while a thread writes to it."""

import json
import math
import sqlite3
import time
from collections.abc import Iterator, Mapping
from contextlib import closing, contextmanager
from pathlib import Path
from typing import Any, Final, NamedTuple

from app.cell.alarms.states import AlarmStatus, Moment
from app.records.database import as_log_error
from app.system.errors import LogError, SearchTooLong
from app.system.texts import say

MAX_PAGE: Final = 500
NEWEST: Final = 2**62  # before this number there are all transitions
LONGEST_SEARCH_S: Final = 5.0
STEPS_BETWEEN_CHECKS: Final = 10_000


class HistoryRow(NamedTuple):
    """A transition: `at` in seconds since the epoch, one of `EVENT_NAMES`,
    `record` as in `app/cell/alarms/records.py`, `group` in the panel's own language. `lasted_s` is the
    time since the alarm was raised, None where it was raised. `clock_back_s`: so much earlier is `at`
    than that of the transition before, as the clock was set back; 0 if it was not. `seq` gives the
    order; 0 before it is written."""

    at: float
    id: str
    state: str
    occurrence: int
    act: str
    actor: str
    record: str
    event: str = ""
    priority: int = 0
    robot: str = ""
    group: str = ""
    lasted_s: float | None = None
    clock_back_s: float = 0.0
    seq: int = 0


class HistoryFilter(NamedTuple):
    """Transitions before a `seq`, from `since` on and before `until` (seconds since the epoch), with a
    text in the alarm's id, texts or group, or in the name of who acted. "" and 0 select all."""

    before: int = NEWEST
    since: float = -math.inf
    until: float = math.inf
    text: str = ""
    alarm: str = ""
    priority: int = 0
    robot: str = ""
    group: str = ""


class HistoryPage(NamedTuple):
    """Some transitions of a filter, the newest first: after `newer` others, of `total`. `set_back`: the
    clock was set back in this time."""

    rows: list[HistoryRow]
    newer: int
    total: int
    set_back: bool


ALL: Final = HistoryFilter()
COLUMNS: Final = ", ".join(f'h."{name}"' for name in HistoryRow._fields)
# The texts of an alarm in all languages, and no keys or codes of their JSON. A record is only searched
# as JSON if the text stands somewhere in it.
TEXT: Final = """(h.id LIKE :pattern ESCAPE '!' OR h.actor LIKE :pattern ESCAPE '!'
 OR (h.record LIKE :as_json ESCAPE '!' AND EXISTS (
   SELECT 1 FROM json_tree(h.record, '$.about') AS about WHERE about.type = 'text'
   AND about.key NOT IN ('', 'code') AND about.value LIKE :pattern ESCAPE '!')))"""
CONDITIONS: Final[Mapping[str, str]] = {
    "text": TEXT,
    "alarm": "h.id = :alarm",
    "priority": "h.priority = :priority",
    "robot": "h.robot = :robot",
    "group": 'h."group" = :group',
}


def read_history(
    path: Path | None, wanted: HistoryFilter = ALL, limit: int = MAX_PAGE
) -> list[HistoryRow]:
    """The newest transitions of a filter first; none without a file. LogError if it can't be read,
    SearchTooLong if that takes too long."""
    with reading(path) as db:
        return history_rows(db, wanted, limit)


def read_page(path: Path | None, wanted: HistoryFilter, limit: int) -> HistoryPage:
    """A page of the history; raises as `read_history`."""
    with reading(path) as db:
        condition, values = _condition(wanted)
        newer, total = db.execute(
            f"SELECT count(*) FILTER (WHERE h.seq >= :before), count(*) FROM history h"
            f" WHERE {condition}",
            values,
        ).fetchone()
        (set_back,) = db.execute(
            "SELECT EXISTS (SELECT 1 FROM history WHERE clock_back_s > 0 AND at >= ? AND at < ?)",
            (wanted.since, wanted.until),
        ).fetchone()
        return HistoryPage(history_rows(db, wanted, limit), newer, total, bool(set_back))


@contextmanager
def reading(path: Path | None, longest_s: float = LONGEST_SEARCH_S) -> Iterator[sqlite3.Connection]:
    """A connection that only reads, to an empty history without a file; errors as `read_history`."""
    end = time.monotonic() + longest_s
    name = f"{path.as_uri()}?mode=ro" if path and path.exists() else ":memory:"
    try:
        with as_log_error(), closing(sqlite3.connect(name, uri=True, timeout=5.0)) as db:
            if name == ":memory:":
                db.executescript(SCHEMA)
            db.set_progress_handler(lambda: time.monotonic() > end, STEPS_BETWEEN_CHECKS)
            yield db
    except LogError as error:
        if time.monotonic() > end:
            raise SearchTooLong(say("log_search_too_long")) from error
        raise


SCHEMA: Final = """
CREATE TABLE IF NOT EXISTS history (
    seq INTEGER PRIMARY KEY AUTOINCREMENT, at REAL NOT NULL, id TEXT NOT NULL, state TEXT NOT NULL,
    occurrence INTEGER NOT NULL, act TEXT NOT NULL, actor TEXT NOT NULL, record TEXT NOT NULL,
    event TEXT NOT NULL DEFAULT '', priority INTEGER NOT NULL DEFAULT 0, robot TEXT NOT NULL DEFAULT '',
    "group" TEXT NOT NULL DEFAULT '', lasted_s REAL, clock_back_s REAL NOT NULL DEFAULT 0
);
CREATE INDEX IF NOT EXISTS history_at ON history (at);
CREATE TABLE IF NOT EXISTS standing (id TEXT PRIMARY KEY, record TEXT NOT NULL);
"""


def history_rows(db: sqlite3.Connection, wanted: HistoryFilter, limit: int) -> list[HistoryRow]:
    """The newest transitions of a filter first, at most `MAX_PAGE`."""
    condition, values = _condition(wanted)
    rows = db.execute(
        f"SELECT {COLUMNS} FROM history h WHERE h.seq < :before AND {condition}"
        " ORDER BY h.seq DESC LIMIT :limit",
        {**values, "limit": min(limit, MAX_PAGE)},
    )
    return [HistoryRow(*row) for row in rows]


def _condition(wanted: HistoryFilter) -> tuple[str, dict[str, Any]]:
    """The condition of a filter without its `before`, and the values of all."""
    chosen = ["h.at >= :since AND h.at < :until"]
    chosen += [condition for name, condition in CONDITIONS.items() if getattr(wanted, name)]
    as_json = json.dumps(wanted.text, ensure_ascii=False)[1:-1]
    values = {**wanted._asdict(), "pattern": _pattern(wanted.text), "as_json": _pattern(as_json)}
    return " AND ".join(chosen), values


def _pattern(text: str) -> str:
    for special in "!%_":
        text = text.replace(special, f"!{special}")
    return f"%{text}%"


# What happened to an alarm at a transition, by its name.

OF_ACTS: Final[Mapping[str, str]] = {
    "acknowledge": "acknowledged",
    "reset": "reset",
    "shelve": "shelved",
    "unshelve": "unshelved",
    "out_of_service": "out_of_service",
    "in_service": "in_service",
}
EVENT_NAMES: Final = (
    "raised", "returned", *OF_ACTS.values(), "suppressed", "unsuppressed", "unknown", "known",
    "changed",
)  # fmt: skip


def event_of(before: AlarmStatus, after: AlarmStatus, act: str = "") -> str:
    """One of `EVENT_NAMES`. An alarm that is raised at the end of a shelf is raised."""
    if after.occurrence != before.occurrence:
        return "raised"
    if act:
        return OF_ACTS[act]
    if before.shelf and not after.shelf:
        return "unshelved"
    if bool(before.suppressed_since) != bool(after.suppressed_since):
        return "suppressed" if after.suppressed_since else "unsuppressed"
    if before.level and not after.level:
        return "returned"
    if bool(before.unknown_since) != bool(after.unknown_since):
        return "unknown" if after.unknown_since else "known"
    return "changed"


def lasted(before: AlarmStatus, after: AlarmStatus, at: Moment) -> float | None:
    """The seconds since it was raised; None where it is raised now, or was not."""
    if after.occurrence != before.occurrence or before.raised_at is None:
        return None
    return max(0.0, at.monotonic - before.raised_at.monotonic)
