"""Rows of alarms in their order, and how many there are of each kind: a change costs no walk over all
of them."""

from bisect import bisect_left, insort
from collections import Counter
from collections.abc import Iterator

from app.alarms.rows import AlarmRow


class SortedRows:
    """The rows by their ids, and the most urgent first."""

    def __init__(self) -> None:
        self.by_id: dict[str, AlarmRow] = {}
        self.counts: Counter[str] = Counter()
        self._order: list[tuple[tuple[float, ...], str]] = []

    def update(self, alarm_id: str, row: AlarmRow | None) -> AlarmRow | None:
        """Puts a row in place of the alarm's last one, which it returns; None is no row."""
        before = self.by_id.pop(alarm_id, None)
        if before is not None:
            del self._order[bisect_left(self._order, _key(before))]
            self.counts.subtract(_counted(before))
        if row is not None:
            self.by_id[alarm_id] = row
            insort(self._order, _key(row))
            self.counts.update(_counted(row))
        return before

    def listed(self) -> Iterator[AlarmRow]:
        """All rows, the most urgent first."""
        return (self.by_id[alarm_id] for _, alarm_id in self._order)

    @property
    def line(self) -> AlarmRow | None:
        """The newest unacknowledged alarm of the highest priority that stands."""
        first = next(self.listed(), None)
        return first if first and not (first["acknowledged"] or first["order"][0]) else None


def _key(row: AlarmRow) -> tuple[tuple[float, ...], str]:
    return tuple(row["order"]), row["id"]


def _counted(row: AlarmRow) -> Iterator[str]:
    """The names under which a row is counted."""
    if row["order"][0]:
        yield row["state"]
        return
    names = ["standing", *([] if row["acknowledged"] else ["unacknowledged"])]
    for name in names:
        yield name
        yield f"{name} {row['priority']}"
    if row["state"] == "unknown":
        yield "unknown"
