"""Alarms that a robot publishes: every message of diagnostics and lists, decoded in slices.

Messages are queued as they arrive. The queue, the entries of a message and the alarms are bounded, and
no size that a message claims is trusted.
"""

import logging
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from app.alarms.entries import (
    DIAGNOSTIC_FIELDS,
    AlarmEntry,
    entries_of,
    status_key,
    with_key_values,
)
from app.bounded import BoundedQueue
from app.errors import DecodeError
from app.interfaces import Interfaces, RowReader, Rows, Walk
from app.panel.alarm import Alarm
from app.panel.fault_catalogue import Catalogue, read_catalogue
from app.panel.model import Panel
from app.robot.sample import Sample
from app.robot.slices import Slices

log = logging.getLogger("kiosk.alarms")

MAX_QUEUED: Final = 256  # messages of one alarm's topic; the oldest go
MAX_QUEUED_BYTES: Final = 8_000_000
MAX_STATUSES: Final = 2_000  # of one message of diagnostics
STATUS: Final = "status"  # the field of a DiagnosticArray

CHUNK: Final = 50  # entries that are passed on at a time: 2 ms if all of them are new

# (the alarm's id, its entries, when they were received in monotonic seconds, whether they are the last
# ones of a list that was read as a whole, and the names of those before them)
OnEntries = Callable[[str, Sequence[AlarmEntry], float, bool, Collection[str]], None]


@dataclass(slots=True, eq=False)
class _Batch:
    """The rows of a message, of which the first `done` were passed on. `names` are those of a list."""

    rows: Sequence[tuple[Any, ...]]
    at: float
    is_whole: bool
    done: int = 0
    names: set[str] = field(default_factory=set)

    def take(self) -> Sequence[tuple[Any, ...]]:
        """The next rows."""
        part = self.rows[self.done : self.done + CHUNK]
        self.done += len(part)
        return part

    @property
    def is_done(self) -> bool:
        return self.done >= len(self.rows)


@dataclass(slots=True, eq=False)
class _Source:
    """One alarm of the panel file with what it has received."""

    alarm: Alarm
    reader: RowReader
    catalogue: Catalogue
    queued: BoundedQueue[Sample] = field(
        default_factory=lambda: BoundedQueue(MAX_QUEUED, MAX_QUEUED_BYTES)
    )
    walk: tuple[Walk[Rows], Sample] | None = None
    batch: _Batch | None = None
    statuses: dict[str, tuple[Any, AlarmEntry | None]] = field(default_factory=dict)  # as last heard

    @property
    def is_pending(self) -> bool:
        return self.batch is not None or self.walk is not None or len(self.queued) > 0

    def entries(self, rows: Sequence[tuple[Any, ...]]) -> list[AlarmEntry]:
        """The entries of rows. A status that has not changed is the same entry again: most of them are
        the same in each message."""
        if self.alarm.listed is not None:
            return list(entries_of(self.alarm, rows, self.catalogue))
        return [entry for row in rows if (entry := self._status(row)) is not None]

    def _status(self, row: tuple[Any, ...]) -> AlarmEntry | None:
        row = with_key_values(row)
        name, heard = row[0], status_key(row)
        known = self.statuses.get(name)
        if known is None or known[0] != heard:
            if len(self.statuses) >= MAX_STATUSES:
                self.statuses.clear()
            known = self.statuses[name] = heard, next(entries_of(self.alarm, (row,)), None)
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
        yield _Source(alarm, reader, catalogue)


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
    ) -> None:
        """`robot` is its id, "" for the only one. `possible_keys` returns the keys of a topic."""
        self._slices = slices
        self._on_entries = on_entries
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
        if not self._scheduled:
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
            source.batch = _Batch(rows.values, sample.at, rows.total <= len(rows.values))
        while source.batch is not None:
            self._pass_on(source, source.batch)
            if time.monotonic() >= until:
                break

    def _pass_on(self, source: _Source, batch: _Batch) -> None:
        """Passes on some of the entries of a message."""
        entries = source.entries(batch.take())
        is_last = batch.is_done
        self._on_entries(source.alarm.id, entries, batch.at, batch.is_whole and is_last, batch.names)
        if is_last:
            source.batch = None
        elif source.alarm.listed is not None:
            batch.names.update(entry.name for entry in entries)
