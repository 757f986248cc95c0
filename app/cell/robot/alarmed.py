"""What active alarms say about the values of a robot, as displays show it."""

from collections.abc import Mapping
from typing import Any, Final, NamedTuple

from app.system.texts import TextLike


class ValueAlarm(NamedTuple):
    """The machine's state while an alarm is active: its `value` in `[state]`, and since when (monotonic
    seconds)."""

    value: bool | int | str
    since: float


class AlarmedValues(NamedTuple):
    """`state` is that of the most urgent alarm that has one. `priorities` has the highest priority of
    the active alarms of a value, by its topic and field: 0 if none is active, nothing for a value that
    no alarm is about."""

    state: ValueAlarm | None = None
    priorities: Mapping[tuple[str, str], int] = {}


class AlarmSelection(NamedTuple):
    """The alarms that a widget shows, the most urgent first: `rows` as `app/cell/alarms/shown.py` has
    them, and how many `more` there are. `line` is the newest unacknowledged one of the highest
    priority. `standing` counts those that are not normal, `active` and `unacknowledged` are of
    these."""

    line: Mapping[str, Any] | None = None
    rows: tuple[Mapping[str, Any], ...] = ()
    more: int = 0
    standing: int = 0
    active: int = 0
    unacknowledged: int = 0


NO_ALARMED: Final = AlarmedValues()
NO_SELECTION: Final = AlarmSelection()


# What an operator does about an alarm that stands.


class AlarmAction(NamedTuple):
    """`alarm` is the id in the panel file, `action` what to do, "" where nothing is said, `picture` a
    file of the panel's pictures, "" without one."""

    alarm: str
    action: TextLike
    picture: str
