"""Alarms that a robot publishes: the statuses of diagnostics, and the entries of a list. Pure functions
from the rows of a message to entries."""

from collections.abc import Iterator, Mapping, Sequence
from fnmatch import fnmatchcase
from itertools import islice
from typing import Any, Final, NamedTuple

from app.errors import DecodeError
from app.i18n import TextLike
from app.panel.alarm import Alarm, AlarmList
from app.panel.fault_catalogue import Catalogue, FaultTexts
from app.printable import readable

# The fields of a diagnostic_msgs/msg/DiagnosticStatus that are read, and its levels.
DIAGNOSTIC_FIELDS: Final = ("name", "level", "message", "hardware_id", "values")
OK, WARN, ERROR, STALE = range(4)
LEVELS: Final[Mapping[int, int]] = {OK: 0, WARN: 1, ERROR: 2, STALE: 1}
LONGEST_NAME: Final = 200
LONGEST_TEXT: Final = 500
MAX_PAIRS: Final = 10  # key values of a status
NO_CATALOGUE: Final[Catalogue] = {}


class AlarmEntry(NamedTuple):
    """An alarm as a robot publishes it. `level` is 0 where it is not active. `details` are the key
    values of a diagnostic status. Texts that are "" are those of the panel file."""

    name: str
    level: int
    text: TextLike
    priorities: tuple[int, ...]
    cause: TextLike = ""
    consequence: TextLike = ""
    action: TextLike = ""
    details: str = ""


def entries_of(
    alarm: Alarm, rows: Sequence[tuple[Any, ...]], catalogue: Catalogue = NO_CATALOGUE
) -> Iterator[AlarmEntry]:
    """The entries of a message: `rows` have the values of `DIAGNOSTIC_FIELDS`, or of the fields that
    `[alarm.list]` names. `catalogue` has the texts of its codes."""
    if alarm.listed is not None:
        yield from (_listed(alarm, alarm.listed, row, catalogue) for row in rows)
        return
    for name, level, message, hardware, pairs in rows:
        if any(fnmatchcase(name, pattern) for pattern in alarm.diagnostics or ()):
            text = readable((message or hardware or name)[:LONGEST_TEXT])
            level = LEVELS.get(_number(level), 2)
            details = _details(pairs) if level else ""
            yield AlarmEntry(
                readable(name[:LONGEST_NAME]), level, text, alarm.priorities, details=details
            )


def with_key_values(row: tuple[Any, ...]) -> tuple[Any, ...]:
    """The row of a status with its key values in place of the function that reads them: none where it
    is OK, or where they are no texts."""
    *others, read = row
    try:
        return (*others, read() if _number(row[1]) else ())
    except DecodeError:
        return (*others, ())


def status_key(row: tuple[Any, ...]) -> tuple[Any, ...]:
    """What decides the entry of a diagnostic status, beside its name: its key values only if it is not
    OK."""
    _, level, message, hardware, pairs = row
    return level, message, hardware, _details(pairs) if _number(level) else ""


def _details(pairs: Any) -> str:
    """The first key values of a status as text: "rpm: 1200, load: 80 %"."""
    texts = (f"{pair.key}: {pair.value}"[:LONGEST_NAME] for pair in islice(pairs or (), MAX_PAIRS))
    return readable(", ".join(texts))


def _listed(alarm: Alarm, listed: AlarmList, row: tuple[Any, ...], catalogue: Catalogue) -> AlarmEntry:
    values = dict(zip(listed.own_fields, row, strict=True))
    code = str(values[listed.code])[:LONGEST_NAME]
    known = catalogue.get(code)
    text = (known and known.text) or (values.get(listed.text) if listed.text else None)
    is_active = values.get(listed.active) is True if listed.active else True
    level = str(_number(values[listed.level])) if listed.level else ""
    priority = listed.priorities.get(level, alarm.priority)
    text = readable(text[:LONGEST_TEXT]) if isinstance(text, str) else text
    known = known or FaultTexts(None, None, None, None)
    return AlarmEntry(
        readable(code),
        int(is_active),
        text or alarm.text or code,
        (priority,),
        known.cause or "",
        known.consequence or "",
        known.action or "",
    )


def _number(level: Any) -> Any:
    """A level of the type byte as a number."""
    return level[0] if isinstance(level, bytes) and level else level
