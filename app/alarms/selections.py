"""The alarms that widgets of the pages show: those of a group, of priorities, of a robot."""

from collections.abc import Mapping
from itertools import islice
from typing import NamedTuple

from app.alarms.rows import AlarmRow
from app.alarms.sorted_rows import SortedRows
from app.panel.model import Panel
from app.panel.widgets.alarm_views import MOST_LINES, AlarmView
from app.robot.alarmed import AlarmSelection


class _Filter(NamedTuple):
    """`robot` None and the others empty are all."""

    robot: str | None
    groups: frozenset[str]
    priorities: frozenset[int]

    def takes(self, row: AlarmRow) -> bool:
        return (
            self.robot in (None, row["robot"])
            and (not self.groups or str(row["group"]) in self.groups)
            and (not self.priorities or row["priority"] in self.priorities)
        )


class AlarmSelections:
    """The selections of all robots' pages. A panel without such widgets pays nothing. Widgets with the
    same filter share one."""

    def __init__(self) -> None:
        self._rows: dict[_Filter, SortedRows] = {}
        self._filters: dict[str, dict[str, _Filter]] = {}  # by robot and widget id
        self._made: dict[_Filter, AlarmSelection] = {}

    def add_robot(self, robot: str, panel: Panel) -> None:
        """Before the first row."""
        shown = (widget for widget in panel.displays if isinstance(widget, AlarmView))
        filters = {widget.id: _filter(widget, robot) for widget in shown}
        self._filters[robot] = filters
        for wanted in filters.values():
            self._rows.setdefault(wanted, SortedRows())

    def update(self, before: AlarmRow | None, after: AlarmRow | None) -> None:
        """A row is shown in place of another; None for an alarm that is not listed."""
        row = after or before
        if row is None:
            return
        for wanted, rows in self._rows.items():
            shown = after if after is not None and wanted.takes(after) else None
            if shown is not None or row["id"] in rows.by_id:
                rows.update(row["id"], shown)
                self._made.pop(wanted, None)

    def of_robot(self, robot: str) -> Mapping[str, AlarmSelection]:
        """What the widgets of a robot's pages show now, by their ids."""
        return {name: self._selection(wanted) for name, wanted in self._filters[robot].items()}

    def _selection(self, wanted: _Filter) -> AlarmSelection:
        made = self._made.get(wanted)
        if made is None:
            rows = self._rows[wanted]
            shown = tuple(islice(rows.listed(), MOST_LINES))
            made = self._made[wanted] = AlarmSelection(
                rows.line,
                shown,
                len(rows.by_id) - len(shown),
                rows.counts["standing"],
                rows.counts["unacknowledged"],
            )
        return made


def _filter(widget: AlarmView, robot: str) -> _Filter:
    return _Filter(
        robot if widget.robots == "this" else None,
        frozenset(widget.group),
        frozenset(widget.priorities),
    )
