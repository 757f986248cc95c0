"""Figures of the history of alarms for a time, as EEMUA 191 asks for them: how often alarms are raised,
which most, and which chatter."""

import math
import sqlite3
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final, NamedTuple

from app.alarms.chatter import CHATTER_S, NO_DELAYS, Activation, Burst, activations, worst_burst
from app.alarms.delays import Delays
from app.alarms.history import HistoryRow, reading

HOUR_S: Final = 3600.0
SLOT_S: Final = 600.0
STANDING_S: Final = 86_400.0
TOP: Final = 10
MAX_CHATTERING: Final = 10
LONGEST_S: Final = 20.0  # a year of alarms on a slow machine
MAX_EVENTS: Final = 5_000  # of one alarm that chatters: the newest
# EEMUA 191: an operator copes with so many, on the average and in the worst ten minutes.
HOURLY_LIMIT: Final = 6
SLOT_LIMIT: Final = 10
OVERRIDES: Final = "('normal', 'shelved', 'suppressed', 'out_of_service')"
RAISED: Final = "event = 'raised' AND at >= :since AND at < :until"


class Frequent(NamedTuple):
    """An alarm with how often it was raised; `row` is its last transition that raised it."""

    row: HistoryRow
    raises: int


class Chattering(NamedTuple):
    """An alarm that chatters: how often it was raised in all, and its worst burst."""

    row: HistoryRow
    raises: int
    burst: Burst


class Figures(NamedTuple):
    """From `since` to `until` (seconds since the epoch), a time of `hours`. `raised` is how many alarms
    were raised, `by_priority` of each, `by_hour` in each hour (by its number since the epoch), without
    hours that have none. `worst_10_min`: the most in any ten minutes. `standing`: those that had stood
    for 24 h at the end. `acknowledge_s`: the median of the times until they were acknowledged."""

    since: float
    until: float
    raised: int
    by_priority: Mapping[int, int]
    by_hour: Mapping[int, int]
    worst_10_min: int
    standing: int
    acknowledge_s: float | None
    top: Sequence[Frequent]
    chattering: Sequence[Chattering]

    @property
    def hours(self) -> float:
        return max(0.0, self.until - self.since) / HOUR_S

    @property
    def per_hour(self) -> float:
        return self.raised / self.hours if self.hours else 0.0

    @property
    def per_10_min(self) -> float:
        return self.per_hour * SLOT_S / HOUR_S

    @property
    def worst_hour(self) -> int:
        return max(self.by_hour.values(), default=0)

    @property
    def hours_over(self) -> int:
        """How many hours had more than an operator copes with."""
        return sum(raises > HOURLY_LIMIT for raises in self.by_hour.values())


def read_figures(
    path: Path | None, since: float, until: float, now: float, delays: Mapping[str, Delays]
) -> Figures:
    """The figures of the transitions from `since` on and before `until`, both of them at most `now`
    (seconds since the epoch). `delays` are those that alarms have now, by their ids. Raises as
    `read_history`."""
    with reading(path, LONGEST_S) as db:
        if since == -math.inf:
            since = db.execute("SELECT min(at) FROM history").fetchone()[0] or now
        times = {"since": since, "until": min(until, now)}
        by_hour = dict(
            db.execute(
                f"SELECT CAST(at / {HOUR_S} AS INTEGER), count(*) FROM history WHERE {RAISED}"
                " GROUP BY 1",
                times,
            )
        )
        return Figures(
            **times,
            raised=sum(by_hour.values()),
            by_priority=dict(
                db.execute(f"SELECT priority, count(*) FROM history WHERE {RAISED} GROUP BY 1", times)
            ),
            by_hour=by_hour,
            worst_10_min=_worst(db, times),
            standing=_standing(db, times, is_now=until >= now),
            acknowledge_s=_median_acknowledge(db, times),
            top=_top(db, times),
            chattering=_chattering(db, times, delays),
        )


def _worst(db: sqlite3.Connection, times: Mapping[str, float]) -> int:
    query = (
        "SELECT max(raises) FROM (SELECT count(*) OVER"
        f" (ORDER BY at RANGE BETWEEN {SLOT_S - 0.001} PRECEDING AND CURRENT ROW) AS raises"
        f" FROM history WHERE {RAISED})"
    )
    return int(db.execute(query, times).fetchone()[0] or 0)


def _standing(db: sqlite3.Connection, times: Mapping[str, float], *, is_now: bool) -> int:
    """How many had stood for 24 h. An alarm that the panel no longer has does not stand now."""
    still = "AND h.id IN (SELECT id FROM standing)" if is_now else ""
    query = (
        "SELECT count(*) FROM history h"
        " JOIN (SELECT max(seq) AS last FROM history WHERE at < :until GROUP BY id) ON last = h.seq"
        f" WHERE h.state NOT IN {OVERRIDES} AND json_extract(h.record, '$.raised_at') <= :limit {still}"
    )
    values = {"until": times["until"], "limit": times["until"] - STANDING_S}
    return int(db.execute(query, values).fetchone()[0])


def _median_acknowledge(db: sqlite3.Connection, times: Mapping[str, float]) -> float | None:
    condition = "event = 'acknowledged' AND lasted_s IS NOT NULL AND at >= :since AND at < :until"
    (number,) = db.execute(f"SELECT count(*) FROM history WHERE {condition}", times).fetchone()
    middle = db.execute(
        f"SELECT lasted_s FROM history WHERE {condition} ORDER BY lasted_s LIMIT 1 OFFSET :middle",
        {**times, "middle": number // 2},
    ).fetchone()
    return float(middle[0]) if middle else None


def _top(db: sqlite3.Connection, times: Mapping[str, float]) -> list[Frequent]:
    query = (
        f"SELECT id, count(*), max(seq) FROM history WHERE {RAISED}"
        f" GROUP BY id ORDER BY 2 DESC, id LIMIT {TOP}"
    )
    matching = db.execute(query, times).fetchall()
    rows = _rows(db, [seq for _, _, seq in matching])
    return [Frequent(rows[seq], raises) for _, raises, seq in matching]


def _chattering(
    db: sqlite3.Connection, times: Mapping[str, float], delays: Mapping[str, Delays]
) -> list[Chattering]:
    query = (
        "SELECT id, count(*) AS raises, max(seq), sum(at - third BETWEEN 0 AND :minute) FROM"
        " (SELECT id, seq, at, lag(at, 2) OVER (PARTITION BY id ORDER BY seq) AS third"
        f" FROM history WHERE {RAISED}) GROUP BY id HAVING sum(at - third BETWEEN 0 AND :minute) > 0"
        f" ORDER BY 4 DESC, id LIMIT {MAX_CHATTERING}"
    )
    matching = db.execute(query, {**times, "minute": CHATTER_S}).fetchall()
    rows = _rows(db, [seq for _, _, seq, _ in matching])
    chattering = []
    for alarm, raises, seq, _ in matching:
        burst = worst_burst(_activations(db, times, alarm), delays.get(alarm, NO_DELAYS))
        if burst is not None:
            chattering.append(Chattering(rows[seq], raises, burst))
    return chattering


def _activations(db: sqlite3.Connection, times: Mapping[str, float], alarm: str) -> list[Activation]:
    events = db.execute(
        "SELECT at, event FROM history WHERE id = :id AND event IN ('raised', 'returned')"
        f" AND at >= :since AND at < :until ORDER BY seq DESC LIMIT {MAX_EVENTS}",
        {**times, "id": alarm},
    ).fetchall()
    return activations(reversed(events))


def _rows(db: sqlite3.Connection, numbers: Sequence[int]) -> dict[int, HistoryRow]:
    columns = ", ".join(f'"{name}"' for name in HistoryRow._fields)
    places = ", ".join("?" * len(numbers))
    matching = db.execute(f"SELECT {columns} FROM history WHERE seq IN ({places})", tuple(numbers))
    rows = [HistoryRow(*row) for row in matching]
    return {row.seq: row for row in rows}
