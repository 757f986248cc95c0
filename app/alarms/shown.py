"""The alarms that pages show: the rows in their order, and how many there are of each kind."""

import math
from collections import Counter, deque
from collections.abc import Iterator, Mapping
from itertools import islice
from typing import Final, NamedTuple, TypedDict

from app.alarms.instance import AlarmInstance
from app.alarms.marks import AlarmMarks
from app.alarms.rows import AlarmRow
from app.alarms.selections import AlarmSelections
from app.alarms.sorted_rows import SortedRows
from app.i18n import TextLike, number, say

MAX_ROWS: Final = 500  # that are listed; the others are counted
PRIORITIES: Final = (1, 2, 3, 4)
# EEMUA 191: more than so many raises in so many seconds is a flood.
FLOOD_RAISES: Final = 10
FLOOD_S: Final = 600.0


class PriorityCount(TypedDict):
    standing: int
    unacknowledged: int
    raised: int


class AlarmsView(TypedDict):
    """The section `alarms` of a view. `line` is the newest unacknowledged alarm of the highest
    priority. `standing` counts the alarms that are not normal; `unacknowledged` and `unknown` are of
    these. `raised` counts the raises since the server's start that are to be acknowledged. The shelved,
    suppressed and those out of service are counted apart. `rows` has the first `MAX_ROWS` by their ids,
    and `more` is how many follow, `more_text` the same as a sentence, "" for none. `fault`: why they
    are not kept on the disk, "" if they are."""

    line: AlarmRow | None
    standing: int
    unacknowledged: int
    unknown: int
    priorities: Mapping[str, PriorityCount]
    shelved: int
    suppressed: int
    out_of_service: int
    flood: bool
    fault: TextLike
    more: int
    more_text: TextLike
    rows: Mapping[str, AlarmRow]


NO_ALARMS: Final = AlarmsView(
    line=None,
    standing=0,
    unacknowledged=0,
    unknown=0,
    priorities={
        str(priority): PriorityCount(standing=0, unacknowledged=0, raised=0) for priority in PRIORITIES
    },
    shelved=0,
    suppressed=0,
    out_of_service=0,
    flood=False,
    fault="",
    more=0,
    more_text="",
    rows={},
)


class PendingRow(NamedTuple):
    """A change that is not on the disk yet: `since` in monotonic seconds."""

    seq: int
    id: str
    row: AlarmRow | None
    since: float


class ShownAlarms:
    """The rows of all alarms, and what else follows them."""

    def __init__(self, marks: AlarmMarks) -> None:
        self.marks = marks
        self.selections = AlarmSelections()
        self._sorted = SortedRows()
        self._raised_to_acknowledge: Counter[int] = Counter()  # by priority
        self._raised: deque[float] = deque(maxlen=FLOOD_RAISES + 1)

    def update(self, alarm_id: str, row: AlarmRow | None) -> None:
        """Shows a row in place of the alarm's last one; None for an alarm that is not listed."""
        before = self._sorted.update(alarm_id, row)
        self.selections.update(before, row)
        self.marks.update(before, row)

    def count_raise(self, alarm: AlarmInstance, now: float) -> None:
        """An alarm was raised at `now` (monotonic seconds)."""
        self._raised.append(now)
        if not (alarm.status.is_acknowledged or alarm.status.override):
            self._raised_to_acknowledge[alarm.priority] += 1

    def flood_ends_at(self) -> float:
        """Until when there are more raises than an operator can follow; -inf if there are not."""
        return self._raised[0] + FLOOD_S if len(self._raised) > FLOOD_RAISES else -math.inf

    def listed(self) -> Iterator[AlarmRow]:
        """All rows, the most urgent first."""
        return self._sorted.listed()

    @property
    def rows(self) -> Mapping[str, AlarmRow]:
        """The rows by their ids."""
        return self._sorted.by_id

    def view(self, now: float, fault: TextLike = "") -> AlarmsView:
        """The section at `now` (monotonic seconds)."""
        rows = {row["id"]: row for row in islice(self.listed(), MAX_ROWS)}
        counts, more = self._sorted.counts, len(self.rows) - len(rows)
        return AlarmsView(
            line=self._sorted.line,
            standing=counts["standing"],
            unacknowledged=counts["unacknowledged"],
            unknown=counts["unknown"],
            priorities={
                str(priority): PriorityCount(
                    standing=counts[f"standing {priority}"],
                    unacknowledged=counts[f"unacknowledged {priority}"],
                    raised=self._raised_to_acknowledge[priority],
                )
                for priority in PRIORITIES
            },
            shelved=counts["shelved"],
            suppressed=counts["suppressed"],
            out_of_service=counts["out_of_service"],
            flood=now < self.flood_ends_at(),
            fault=fault,
            more=more,
            more_text=more_text(more),
            rows=rows,
        )


def more_text(more: int) -> TextLike:
    """How many alarms are counted and not listed; "" for none."""
    return say("alarms_more", count=number(str(more))) if more else ""


def outdated(alarms: Mapping[str, AlarmInstance], rows: Mapping[str, AlarmRow], most: int) -> list[str]:
    """The ids of rows of which the robot says something else now, without a change of state: such as
    the values of a diagnostic status. At most so many."""
    changed = (
        alarm_id
        for alarm_id, row in rows.items()
        if (alarm := alarms.get(alarm_id)) is not None
        and alarm.entry is not None
        and alarm.entry.level
        and (alarm.entry.details, alarm.text) != (row["details"], row["text"])
    )
    return list(islice(changed, most))
