"""Reads the operator's log without blocking the writer.

Each call is one short read on its own connection: a slow reader keeps nothing open.
"""

import json
import time
from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Final

from app.audit.database import as_log_error, open_read_only
from app.audit.entry import FIELDS, Entry
from app.errors import LogError, SearchTooLong
from app.i18n import present_code, say

LONGEST_SEARCH_S: Final = 5.0
STEPS_BETWEEN_CHECKS: Final = 10_000
MAX_SCANNED: Final = 20_000  # entries, from the newest back

# Without presses whose result is in a later entry.
CLOSED_CONDITION: Final = "(e.kind <> 'pressed' OR e.seq IN (SELECT seq FROM undone))"
# Without signatures of the log, one each hour.
UNSIGNED_CONDITION: Final = "e.kind <> 'signed'"
CONDITIONS: Final = {
    "since": "e.at >= :since",
    "until": "e.at < :until",
    "widget": "e.widget = :widget",
    "outcome": "(CASE WHEN e.outcome = '' THEN e.kind ELSE e.outcome END) = :outcome",
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
class Row:
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
) -> list[Row]:
    """The newest `count` entries that match before the entry number `before`, the newest first;
    LogError, SearchTooLong after `longest_s`."""
    query, values = _query(wanted, before, count)
    return [Row(Entry(*row[:-1]), row[-1]) for row in _fetch(folder, query, values, longest_s)]


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


def _query(wanted: Filter, before: int | None, count: int) -> tuple[str, dict[str, Any]]:
    values = {name: value for name, value in asdict(wanted).items() if value not in (None, "")}
    conditions = [CONDITIONS[name] for name in values if name in CONDITIONS]
    if not wanted.every:
        conditions.append(CLOSED_CONDITION)
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
