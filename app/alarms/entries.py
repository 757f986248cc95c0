"""Alarms that a robot publishes: the statuses of diagnostics, and the entries of a list. Pure functions
from the rows of a message to entries."""

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import Any, Final, NamedTuple

from app.i18n import TextLike
from app.panel.alarm import Alarm, AlarmList
from app.panel.fault_catalogue import Catalogue

# The fields of a diagnostic_msgs/msg/DiagnosticStatus that are read, and its levels.
DIAGNOSTIC_FIELDS: Final = ("name", "level", "message", "hardware_id")
OK, WARN, ERROR, STALE = range(4)
LEVELS: Final[Mapping[int, int]] = {OK: 0, WARN: 1, ERROR: 2, STALE: 1}
LONGEST_NAME: Final = 200
NO_CATALOGUE: Final[Catalogue] = {}


class AlarmEntry(NamedTuple):
    """An alarm as a robot publishes it. `level` is 0 where it is not active."""

    name: str
    level: int
    text: TextLike
    priorities: tuple[int, ...]


def entries_of(
    alarm: Alarm, rows: Sequence[tuple[Any, ...]], catalogue: Catalogue = NO_CATALOGUE
) -> Iterator[AlarmEntry]:
    """The entries of a message: `rows` have the values of `DIAGNOSTIC_FIELDS`, or of the fields that
    `[alarm.list]` names. `catalogue` has the texts of its codes."""
    if alarm.listed is not None:
        yield from (_listed(alarm, alarm.listed, row, catalogue) for row in rows)
        return
    for name, level, message, hardware in rows:
        if any(fnmatchcase(name, pattern) for pattern in alarm.diagnostics or ()):
            text = message or hardware or name
            yield AlarmEntry(name[:LONGEST_NAME], LEVELS.get(_number(level), 2), text, alarm.priorities)


def _listed(alarm: Alarm, listed: AlarmList, row: tuple[Any, ...], catalogue: Catalogue) -> AlarmEntry:
    values = dict(zip(listed.own_fields, row, strict=True))
    code = str(values[listed.code])[:LONGEST_NAME]
    known = catalogue.get(code)
    text = (known and known.text) or (values.get(listed.text) if listed.text else None)
    is_active = values.get(listed.active) is True if listed.active else True
    level = str(_number(values[listed.level])) if listed.level else ""
    priority = listed.priorities.get(level, alarm.priority)
    return AlarmEntry(code, int(is_active), text or alarm.text or code, (priority,))


def _number(level: Any) -> Any:
    """A level of the type byte as a number."""
    return level[0] if isinstance(level, bytes) and level else level
