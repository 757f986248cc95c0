"""What active alarms say about the values of a robot, as displays show it."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple


class AlarmedState(NamedTuple):
    """The machine's state while an alarm is active: its `value` in `[state]`, and since when (monotonic
    seconds)."""

    value: bool | int | str
    since: float


class AlarmedValues(NamedTuple):
    """`state` is that of the most urgent alarm that has one. `priorities` has the highest priority of
    the active alarms of a value, by its topic and field: 0 if none is active, nothing for a value that
    no alarm is about."""

    state: AlarmedState | None = None
    priorities: Mapping[tuple[str, str], int] = {}


class AlarmSelection(NamedTuple):
    """The alarms that a widget shows, the most urgent first: `rows` as `app/alarms/rows.py` has them,
    and how many `more` there are. `line` is the newest unacknowledged one of the highest priority.
    `standing` counts those that are not normal, `unacknowledged` is of these."""

    line: Mapping[str, Any] | None = None
    rows: tuple[Mapping[str, Any], ...] = ()
    more: int = 0
    standing: int = 0
    unacknowledged: int = 0


NO_ALARMED: Final = AlarmedValues()
NO_SELECTION: Final = AlarmSelection()
