"""Alarms that a robot publishes: every message of diagnostics and lists, decoded in slices.

Messages are queued as they arrive. The queue, the entries of a message and the alarms are bounded, and
no size that a message claims is trusted.
"""

import logging
import re
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fnmatch import fnmatchcase
from hashlib import sha256
from itertools import islice
from typing import Any, Final, NamedTuple

from app.cell.robot.topics import Slices
from app.panel.alarm import Alarm, AlarmList
from app.panel.fault_catalogue import Catalogue, FaultTexts, read_catalogue
from app.panel.model import Panel
from app.panel.robot_texts import NO_TEXTS, RobotTexts, robot_text
from app.ros.messages import Interfaces, RowReader, Rows, Walk
from app.ros.zenoh.sample import Sample
from app.system.errors import DecodeError
from app.system.limits import BoundedQueue
from app.system.printable import one_line, readable
from app.system.texts import TextLike, number, say

# Alarms that a robot publishes: the statuses of diagnostics, and the entries of a list. Pure functions
# from the rows of a message to entries.

# The fields of a diagnostic_msgs/msg/DiagnosticStatus that are read, and its levels.
DIAGNOSTIC_FIELDS: Final = ("name", "level", "message", "hardware_id", "values")
OK, WARN, ERROR, STALE = range(4)
LEVELS: Final[Mapping[int, int]] = {OK: 0, WARN: 1, ERROR: 2, STALE: 1}
LONGEST_PAIR: Final = 200
LONGEST_TEXT: Final = 500
LONGEST_ENTRY_NAME: Final = 160  # so that ids of alarms have 300 characters at most
DIGEST: Final = 12  # hexadecimal digits that stand for a whole name
# Names that the path of an address changes, and those that look as if they had a digest.
UNFIT_NAME: Final = re.compile(r"\A\Z|\A\s|\s\Z|/\.{0,2}(?:/|\Z)|~[0-9a-f]{12}\Z")
MAX_PAIRS: Final = 10  # key values of a status
NO_CATALOGUE: Final[Catalogue] = {}


class AlarmEntry(NamedTuple):
    """An alarm as a robot publishes it: `name` is that of `entry_name`. `level` is 0 where it is not
    active. `details` are the key values of a diagnostic status, and how many entries have the name.
    Texts that are "" are those of the panel file."""

    name: str
    level: int
    text: TextLike
    priorities: tuple[int, ...]
    cause: TextLike = ""
    consequence: TextLike = ""
    action: TextLike = ""
    details: TextLike = ""

    @property
    def urgency(self) -> tuple[int, int]:
        """Sorts entries: the most urgent is the smallest."""
        priority = self.priorities[min(max(self.level, 1), len(self.priorities)) - 1]
        return (priority, -self.level) if self.level else (max(self.priorities) + 1, 0)


def entry_name(name: str) -> str:
    """The name of an entry: unique for the whole text that the robot published, bounded, and fit for an
    address. One that is too long or unfit ends with a digest of all of it."""
    shown = one_line(name)
    if shown == name and len(name) <= LONGEST_ENTRY_NAME and not UNFIT_NAME.search(name):
        return name
    digest = sha256(name.encode("utf-8", "surrogatepass")).hexdigest()[:DIGEST]
    fit = shown.strip().replace("/", "_")[: LONGEST_ENTRY_NAME - DIGEST - 1]
    return f"{fit}~{digest}"


def most_urgent(entries: Iterable[AlarmEntry]) -> list[AlarmEntry]:
    """The entries of a whole message: of those with one name the most urgent, which says how many there
    are."""
    named: dict[str, list[AlarmEntry]] = {}
    for entry in entries:
        named.setdefault(entry.name, []).append(entry)
    return [_one_of(same) if len(same) > 1 else same[0] for same in named.values()]


def _one_of(same: Sequence[AlarmEntry]) -> AlarmEntry:
    first = min(same, key=lambda entry: entry.urgency)
    if not first.level:
        return first
    count = number(str(len(same)))
    if not first.details:
        return first._replace(details=say("alarms_of_one_name", count=count))
    details = say("alarms_of_one_name_details", count=count, details=first.details)
    return first._replace(details=details)


def entries_of(
    alarm: Alarm,
    rows: Sequence[tuple[Any, ...]],
    catalogue: Catalogue = NO_CATALOGUE,
    texts: RobotTexts = NO_TEXTS,
) -> Iterator[AlarmEntry]:
    """The entries of a message: `rows` have the values of `DIAGNOSTIC_FIELDS`, or of the fields that
    `[alarm.list]` names. `catalogue` has the texts of its codes, and `texts` those of the panel
    file."""
    if alarm.listed is not None:
        yield from (_listed(alarm, alarm.listed, row, catalogue, texts) for row in rows)
        return
    for name, level, message, hardware, pairs in rows:
        if any(fnmatchcase(name, pattern) for pattern in alarm.diagnostics or ()):
            said = message or hardware or name
            text = robot_text(texts, said, readable(said[:LONGEST_TEXT]))
            level = LEVELS.get(_number(level), 2)
            details = _details(pairs) if level else ""
            yield AlarmEntry(entry_name(name), level, text, alarm.priorities, details=details)


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
    texts = (f"{pair.key}: {pair.value}"[:LONGEST_PAIR] for pair in islice(pairs or (), MAX_PAIRS))
    return readable(", ".join(texts))


def _listed(
    alarm: Alarm, listed: AlarmList, row: tuple[Any, ...], catalogue: Catalogue, texts: RobotTexts
) -> AlarmEntry:
    values = dict(zip(listed.own_fields, row, strict=True))
    code = str(values[listed.code])
    known = catalogue.get(code)
    said = values.get(listed.text) if listed.text else None
    plain = readable(said[:LONGEST_TEXT]) if isinstance(said, str) else said or ""
    text = (known and known.text) or robot_text(texts, code, robot_text(texts, said, plain))
    is_active = values.get(listed.active) is True if listed.active else True
    level = str(_number(values[listed.level])) if listed.level else ""
    priority = listed.priorities.get(level, alarm.priority)
    known = known or FaultTexts(None, None, None, None)
    return AlarmEntry(
        entry_name(code),
        int(is_active),
        text or alarm.text or readable(code[:LONGEST_TEXT]),
        (priority,),
        known.cause or "",
        known.consequence or "",
        known.action or "",
    )


def _number(level: Any) -> Any:
    """A level of the type byte as a number."""
    return level[0] if isinstance(level, bytes) and level else level


log = logging.getLogger("kiosk.alarms")

MAX_QUEUED: Final = 256  # messages of one alarm's topic; the oldest go
MAX_QUEUED_BYTES: Final = 8_000_000
MAX_STATUSES: Final = 2_000  # of one message of diagnostics
STATUS: Final = "status"  # the field of a DiagnosticArray

CHUNK: Final = 50  # entries that are passed on at a time: 2 ms if all of them are new

# (the alarm's id, its entries, when they were received in monotonic seconds, whether they are the last
# ones of their message, the names of those before them, and how many of the message were not read)
OnEntries = Callable[[str, Sequence[AlarmEntry], float, bool, Collection[str], int], None]


SameName = Sequence[tuple[Any, ...]]  # the rows of a message that have one name


@dataclass(slots=True, eq=False)
class _Batch:
    """The rows of a message by their names, of which the first `done` were passed on. `names` are those
    of a list, `unread` how many entries the message has beside these rows."""

    named: Sequence[SameName]
    at: float
    unread: int
    done: int = 0
    names: set[str] = field(default_factory=set)

    def take(self) -> Sequence[SameName]:
        """The rows of the next names."""
        part = self.named[self.done : self.done + CHUNK]
        self.done += len(part)
        return part

    @property
    def is_done(self) -> bool:
        return self.done >= len(self.named)


@dataclass(slots=True, eq=False)
class _Source:
    """One alarm of the panel file with what it has received."""

    alarm: Alarm
    reader: RowReader
    catalogue: Catalogue
    texts: RobotTexts
    queued: BoundedQueue[Sample] = field(
        default_factory=lambda: BoundedQueue(MAX_QUEUED, MAX_QUEUED_BYTES)
    )
    walk: tuple[Walk[Rows], Sample] | None = None
    batch: _Batch | None = None
    statuses: dict[str, tuple[Any, AlarmEntry | None]] = field(default_factory=dict)  # as last heard

    @property
    def is_pending(self) -> bool:
        return self.batch is not None or self.walk is not None or len(self.queued) > 0

    def by_name(self, rows: Sequence[tuple[Any, ...]]) -> list[SameName]:
        """The rows of a message by their names."""
        listed = self.alarm.listed
        place = 0 if listed is None else listed.own_fields.index(listed.code)
        named: dict[Any, list[tuple[Any, ...]]] = {}
        for row in rows:
            named.setdefault(row[place], []).append(row)
        return list(named.values())

    def entries(self, named: Sequence[SameName]) -> Iterator[AlarmEntry]:
        """The entries of rows, one for each name. A status that has not changed is the same entry
        again: most of them are the same in each message."""
        for rows in named:
            if self.alarm.listed is None and len(rows) == 1:
                if (entry := self._status(rows[0])) is not None:
                    yield entry
                continue
            if self.alarm.listed is None:
                rows = [with_key_values(row) for row in rows]
            yield from most_urgent(entries_of(self.alarm, rows, self.catalogue, self.texts))

    def _status(self, row: tuple[Any, ...]) -> AlarmEntry | None:
        row = with_key_values(row)
        name, heard = row[0], status_key(row)
        known = self.statuses.get(name)
        if known is None or known[0] != heard:
            if len(self.statuses) >= MAX_STATUSES:
                self.statuses.clear()
            entries = entries_of(self.alarm, (row,), texts=self.texts)
            known = self.statuses[name] = heard, next(entries, None)
        return known[1]

    def decode_one(self, slices: Slices, until: float) -> tuple[Rows, Sample] | None:
        """Decodes the oldest message, or as much of it as the time allows: its rows when it is done."""
        if self.walk is None:
            sample = self.queued.take()
            self.walk = self.reader.walk(bytes(sample.payload)), sample
        walk, sample = self.walk
        try:
            rows = slices.read_until(walk, until)
        except DecodeError:
            self.walk = None  # counted where the topic is read
            return None
        if rows is None:
            return None
        self.walk = None
        return rows, sample


def _sources(panel: Panel, robot: str, interfaces: Interfaces) -> Iterator[_Source]:
    for alarm in panel.alarms:
        type_name, listed = alarm.topic_type, alarm.listed
        if not alarm.is_for(robot or None) or type_name is None:
            continue
        if listed is not None:
            path, fields, most = listed.field, listed.own_fields, listed.entries_read
        elif alarm.diagnostics:
            path, fields, most = STATUS, DIAGNOSTIC_FIELDS, MAX_STATUSES
        else:
            continue
        reader = interfaces.row_reader(type_name, path, fields, most, last_later=listed is None)
        catalogue: Catalogue = {}
        if listed is not None and listed.catalogue is not None:
            catalogue = read_catalogue(listed.catalogue, panel.language)
        yield _Source(alarm, reader, catalogue, panel.robot_texts)


class PublishedAlarms:
    """The alarms that one robot publishes; a `SampleListener`. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        robot: str,
        interfaces: Interfaces,
        possible_keys: Callable[[str], Sequence[str]],
        slices: Slices,
        on_entries: OnEntries,
        may_decode: Callable[[], bool] = lambda: True,
    ) -> None:
        """`robot` is its id, "" for the only one. `possible_keys` returns the keys of a topic. Messages
        wait in their queue while `may_decode` returns False, until `resume` is called."""
        self._slices = slices
        self._on_entries = on_entries
        self._may_decode = may_decode
        self._scheduled = False
        self._sources = list(_sources(panel, robot, interfaces))
        by_key: dict[str, list[_Source]] = {}
        for source in self._sources:
            for key in possible_keys(source.alarm.topic_name or ""):
                by_key.setdefault(key, []).append(source)
        self._by_key: Mapping[str, Sequence[_Source]] = by_key
        self.keys = frozenset(by_key)

    def record_sample(self, key: str, sample: Sample) -> None:
        """A sample was received: it is decoded in the next turns."""
        for source in self._by_key[key]:
            source.queued.add(sample, len(sample.payload))
        self.resume()

    def resume(self) -> None:
        """Decodes what is queued in the next turns."""
        is_pending = any(source.is_pending for source in self._sources)
        if is_pending and not self._scheduled and self._may_decode():
            self._scheduled = True
            self._slices.schedule_calmly(self._decode, self._is_behind)

    def _is_behind(self) -> bool:
        """Whether messages arrive faster than they are decoded."""
        return any(len(source.queued) > 1 for source in self._sources)

    def _decode(self, until: float) -> bool:
        """Decodes until a time (monotonic seconds); returns whether nothing is left."""
        for source in self._sources:
            try:
                self._decode_some(source, until)
            except Exception:  # the next message has another try; until then the alarms get old
                log.exception("%s: a message could not be read as alarms", source.alarm.id)
                source.walk = source.batch = None
        self._scheduled = any(source.is_pending for source in self._sources)
        return not self._scheduled

    def _decode_some(self, source: _Source, until: float) -> None:
        if source.batch is None and (
            decoded := source.is_pending and source.decode_one(self._slices, until)
        ):
            rows, sample = decoded
            unread = max(0, rows.total - len(rows.values))
            source.batch = _Batch(source.by_name(rows.values), sample.at, unread)
        while source.batch is not None:
            self._pass_on(source, source.batch)
            if time.monotonic() >= until:
                break

    def _pass_on(self, source: _Source, batch: _Batch) -> None:
        """Passes on some of the entries of a message."""
        entries = list(source.entries(batch.take()))
        is_last = batch.is_done
        self._on_entries(source.alarm.id, entries, batch.at, is_last, batch.names, batch.unread)
        if is_last:
            source.batch = None
        elif source.alarm.listed is not None:
            batch.names.update(entry.name for entry in entries)
