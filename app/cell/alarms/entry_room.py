"""How many alarms of robots are kept: what is normal makes room for others, and at the limit the less
urgent for the more urgent. What is left out is counted."""

from collections.abc import Collection, Iterable
from heapq import nlargest
from typing import Final

from app.cell.alarms.published import AlarmEntry
from app.cell.alarms.states import AlarmInstance, Moment

MAX_ENTRIES: Final = 10_000  # alarms that the robots publish themselves
MAX_NAMED: Final = 10_000  # that are left out, by their ids
FOUND_AT_ONCE: Final = 200  # a walk over all takes 10 ms
WALK_EVERY_S: Final = 1.0  # if the last one gave none
LEAST_URGENT: Final = 4


class EntryRoom:
    """The room of the engine's entries."""

    def __init__(self) -> None:
        self._kept: set[str] = set()
        self._leaving: list[AlarmInstance] = []  # candidates; the next to leave is the last
        self._walk_at: dict[int, float] = {}  # by priority
        self._left_out: dict[str, None] = {}
        self._unread: dict[str, int] = {}  # by the source's id

    @property
    def is_free(self) -> bool:
        return len(self._kept) < MAX_ENTRIES

    @property
    def left_out(self) -> int:
        """How many active alarms are not kept, or were not read."""
        return len(self._left_out) + sum(self._unread.values())

    def take(self, entry_id: str) -> None:
        """An entry has room."""
        self._kept.add(entry_id)
        self._left_out.pop(entry_id, None)

    def free(self, entry_id: str) -> None:
        self._kept.discard(entry_id)

    def leave_out(self, entry_id: str) -> None:
        """An active entry has no room."""
        if len(self._left_out) < MAX_NAMED:
            self._left_out[entry_id] = None

    def ended(self, entry_id: str) -> None:
        """An entry is not active."""
        self._left_out.pop(entry_id, None)

    def set_unread(self, source_id: str, count: int) -> None:
        """How many entries of a source's last message were not read."""
        if count:
            self._unread[source_id] = count
        else:
            self._unread.pop(source_id, None)

    def keep_only(self, source_id: str, ids: Collection[str]) -> None:
        """A whole list has these entries: no others of its source are active."""
        begin = f"{source_id}:"
        for entry_id in [name for name in self._left_out if name.startswith(begin) and name not in ids]:
            del self._left_out[entry_id]

    def find_less_urgent(
        self, entry: AlarmEntry, kept: Iterable[AlarmInstance], waiting: Collection[str], now: Moment
    ) -> AlarmInstance | None:
        """The alarm that leaves for a new entry, one that is normal first; None if all are as
        urgent."""
        priority = entry.urgency[0]
        for _ in range(2):
            while self._leaving:
                alarm = self._leaving.pop()
                if alarm.definition.id in self._kept and _expendable(alarm, waiting) > priority:
                    return alarm
            if now.monotonic < self._walk_at.get(priority, 0.0):
                return None
            candidates = [alarm for alarm in kept if _expendable(alarm, waiting) > priority]
            self._leaving = nlargest(
                FOUND_AT_ONCE, candidates, key=lambda alarm: _order(alarm, waiting)
            )
            self._leaving.reverse()
            if not candidates:
                self._walk_at[priority] = now.monotonic + WALK_EVERY_S
                return None
        return None


def _expendable(alarm: AlarmInstance, waiting: Collection[str]) -> int:
    """Above the priority of each entry that it may leave for: its own, and more if it is normal. 0 for
    one that a person has taken out."""
    status, entry = alarm.status, alarm.entry
    if status.override is not None:
        return 0
    is_active = entry is not None and entry.level > 0
    if status.is_normal and not is_active and alarm.definition.id not in waiting:
        return LEAST_URGENT + 1
    return min(alarm.priority, entry.urgency[0]) if entry is not None and is_active else alarm.priority


def _order(alarm: AlarmInstance, waiting: Collection[str]) -> tuple[int, bool, float]:
    """The first to leave is the largest: the least urgent, the acknowledged, the oldest."""
    is_acknowledged, _, since = alarm.order
    return _expendable(alarm, waiting), is_acknowledged, since
