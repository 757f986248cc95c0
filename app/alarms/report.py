"""What a shift report says of alarms, read from their history."""

from pathlib import Path
from typing import Final, NamedTuple

from app.alarms.history import HistoryRow, reading

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
