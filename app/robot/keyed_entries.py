"""The latest entry for each key of a list that several messages bring, as /diagnostics does.

Samples are queued as they arrive, and decoded when the entries are asked for, some milliseconds at a
time. Queue and entries are bounded: the oldest go first.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

from app.errors import DecodeError
from app.interfaces import FieldReader, Fields, Interfaces, Walk
from app.panel.model import Panel
from app.panel.widgets.table import Table
from app.robot.sample import Sample

MAX_KEYS: Final = 200
MAX_QUEUED: Final = 64
MAX_QUEUED_BYTES: Final = 4_000_000
SHARE_S: Final = 0.004  # of decoding for each time that entries are asked for
LONGEST_KEY: Final = 200


@dataclass(frozen=True, slots=True)
class Entry:
    """An entry: its values in the order of `Table.own_fields`; `at` in monotonic seconds."""

    values: tuple[Any, ...]
    at: float


@dataclass(slots=True, eq=False)
class _Keyed:
    """One table with what it has received."""

    table: Table
    reader: FieldReader
    queued: deque[Sample] = field(default_factory=deque)
    size: int = 0  # of the queued payloads
    walk: tuple[Walk, Sample] | None = None
    entries: dict[str, Entry] = field(default_factory=dict)

    def add(self, sample: Sample) -> None:
        self.queued.append(sample)
        self.size += len(sample.payload)
        while len(self.queued) > MAX_QUEUED or (self.size > MAX_QUEUED_BYTES and len(self.queued) > 1):
            self.size -= len(self.queued.popleft().payload)

    def decode(self, until: float, now: Callable[[], float]) -> bool:
        """Decodes what is queued; returns whether that was all."""
        while self.walk or self.queued:
            if self.walk is None:
                sample = self.queued.popleft()
                self.size -= len(sample.payload)
                self.walk = self.reader.walk(bytes(sample.payload)), sample
            walk, sample = self.walk
            try:
                fields = walk.advance()
            except DecodeError:
                self.walk = None  # counted where the topic is read
                continue
            if fields is not None:
                self.walk = None
                self._keep(fields, sample)
            if now() >= until:
                return not (self.walk or self.queued)
        return True

    def _keep(self, fields: Fields, sample: Sample) -> None:
        table = self.table
        for number in range(table.entries_read):
            key = fields.get(table.path(number, table.key))
            if key is None:
                break
            values = tuple(fields.get(table.path(number, of)) for of in table.own_fields)
            self.entries[f"{key}"[:LONGEST_KEY]] = Entry(values, sample.at)
        while len(self.entries) > MAX_KEYS:
            del self.entries[min(self.entries, key=lambda one: self.entries[one].at)]


class KeyedEntries:
    """The entries of one robot's tables with keys; a `SampleListener`. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        key_of: Callable[[str], str],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """`key_of` returns the key expression of a topic."""
        tables = [w for w in panel.displays if isinstance(w, Table) and w.key is not None]
        self._tables = {
            table.id: _Keyed(table, interfaces.field_reader(table.type, table.paths))
            for table in tables
        }
        self._by_key: dict[str, list[_Keyed]] = {}
        for one in self._tables.values():
            self._by_key.setdefault(key_of(one.table.topic), []).append(one)
        self._now = now

    @property
    def keys(self) -> frozenset[str]:
        return frozenset(self._by_key)

    def record_sample(self, key: str, sample: Sample) -> None:
        for one in self._by_key[key]:
            one.add(sample)

    def entries(self, widget_id: str) -> tuple[list[Entry], bool]:
        """The entries of a table in the order of their first message, and whether all samples that have
        arrived are in them."""
        keyed = self._tables[widget_id]
        is_whole = keyed.decode(self._now() + SHARE_S, self._now)
        return list(keyed.entries.values()), is_whole
