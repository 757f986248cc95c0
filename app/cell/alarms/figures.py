"""Figures of the history of alarms for a time, as EEMUA 191 asks for them: how often alarms are raised,
which most, and which chatter."""

import math
import sqlite3
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Final, NamedTuple

from app.cell.alarms.history import HistoryRow, reading
from app.cell.alarms.states import DelayedCondition, Delays

# Alarms that chatter, and the delay that would calm them. Pure functions.
#
# An alarm chatters if it is raised three times in a minute.

CHATTER_RAISES: Final = 3
CHATTER_S: Final = 60.0
STEP_S: Final = 0.1  # of a delay below `WHOLE_FROM_S`, else 1 s
WHOLE_FROM_S: Final = 2.0
NO_DELAYS: Final = Delays()


class Activation(NamedTuple):
    """From when to when an alarm was active, in seconds; inf if it did not return before it was raised
    again, or at all."""

    raised: float
    returned: float = math.inf


class Suggestion(NamedTuple):
    """With a delay of so many seconds the burst would have been `raises`."""

    delay_s: float
    raises: int


class Burst(NamedTuple):
    """Raises of one alarm of which each is within a minute of others: from `first` on, `span_s` long.
    `on_delay` and `off_delay` are the least that leave one raise or none; None where no delay does."""

    first: float
    span_s: float
    raises: int
    on_delay: Suggestion | None
    off_delay: Suggestion | None


def activations(events: Iterable[tuple[float, str]]) -> list[Activation]:
    """From times and events of one alarm, in their order: `raised` and `returned`."""
    intervals: list[Activation] = []
    for at, event in events:
        if event == "raised":
            intervals.append(Activation(at))
        elif event == "returned" and intervals and intervals[-1].returned == math.inf:
            intervals[-1] = Activation(intervals[-1].raised, at)
    return intervals


def worst_burst(active: Sequence[Activation], delays: Delays = NO_DELAYS) -> Burst | None:
    """The burst with the most raises; None if the alarm does not chatter. `delays` are those that it
    has now."""
    bursts = list(_bursts(active))
    if not bursts:
        return None
    worst = max(bursts, key=len)
    heard = _before_delays(worst, delays)
    return Burst(
        worst[0].raised,
        worst[-1].raised - worst[0].raised,
        len(worst),
        _least(heard, delays, [end - begin for begin, end in heard], "on_s"),
        _least(heard, delays, [after - end for (_, end), (after, _) in pairwise(heard)], "off_s"),
    )


def _bursts(active: Sequence[Activation]) -> Iterable[Sequence[Activation]]:
    """The longest sequences in which each raise is one of three in a minute."""
    begin, end = 0, -1
    for last in range(CHATTER_RAISES - 1, len(active)):
        first = last - CHATTER_RAISES + 1
        if not 0 <= active[last].raised - active[first].raised <= CHATTER_S:
            continue
        if first > end:
            yield from [active[begin : end + 1]] if end >= 0 else []
            begin = first
        end = last
    yield from [active[begin : end + 1]] if end >= 0 else []


def _before_delays(active: Iterable[Activation], delays: Delays) -> list[Activation]:
    """When the condition was met, before the delays that the alarm has."""
    return [
        Activation(raised - delays.on_s, max(raised, returned - delays.off_s))
        for raised, returned in active
    ]


def _least(
    heard: Sequence[Activation], delays: Delays, lengths: Iterable[float], name: str
) -> Suggestion | None:
    """The least delay, just above one of the lengths, that leaves one raise or none. None if the alarm
    was raised again without a return, as its level rose."""
    if any(end == math.inf for _, end in heard[:-1]):
        return None
    for length in sorted({length for length in lengths if math.isfinite(length)}):
        delay_s = _above(length)
        raises = count_raises(heard, delays._replace(**{name: delay_s}))
        if raises <= 1 and delay_s > getattr(delays, name):
            return Suggestion(delay_s, raises)
    return None


def _above(length: float) -> float:
    step = STEP_S if length < WHOLE_FROM_S else 1.0
    return round((math.floor(length / step) + 1) * step, 1)


def count_raises(heard: Iterable[Activation], delays: Delays) -> int:
    """How often a condition that was met at these times is raised with some delays."""
    condition, raises = DelayedCondition(), 0
    for begin, end in heard:
        for at, met in ((begin, True), (end, False)):
            waited = condition.at(at, delays)
            changed = waited.observe(met, at, delays) if at < math.inf else waited
            raises += (waited.active > condition.active) + (changed.active > waited.active)
            condition = changed
    return raises


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
