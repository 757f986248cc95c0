"""The latest entry for each key of a list that several messages bring, as /diagnostics does.

Samples are queued as they arrive, and decoded in slices of some milliseconds. Queue and entries are
bounded: the oldest go first.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, Final

from app.bounded import BoundedQueue
from app.errors import DecodeError
from app.interfaces import FieldReader, Fields, Interfaces, Walk
from app.panel.model import Panel
from app.panel.widgets.table import Table
from app.robot.sample import Sample
from app.robot.slices import Slices

MAX_KEYS: Final = 200
MAX_QUEUED: Final = 64
MAX_QUEUED_BYTES: Final = 4_000_000
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
    queued: BoundedQueue[Sample] = field(
        default_factory=lambda: BoundedQueue(MAX_QUEUED, MAX_QUEUED_BYTES)
    )
    walk: tuple[Walk, Sample] | None = None
    entries: dict[str, Entry] = field(default_factory=dict)

    @property
    def is_pending(self) -> bool:
        return self.walk is not None or len(self.queued) > 0

    def decode_one(self, slices: Slices, until: float) -> None:
        """Decodes the oldest message, or as much of it as the time allows."""
        if self.walk is None:
            sample = self.queued.take()
            self.walk = self.reader.walk(bytes(sample.payload)), sample
        walk, sample = self.walk
        try:
            fields = slices.read_until(walk, until)
        except DecodeError:
            self.walk = None  # counted where the topic is read
            return
        if fields is not None:
            self.walk = None
            self._keep(fields, sample)

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
        self, panel: Panel, interfaces: Interfaces, key_of: Callable[[str], str], slices: Slices
    ) -> None:
        """`key_of` returns the key of a topic."""
        self._slices = slices
        self._scheduled = False
        self.on_decoded: Callable[[str], None] = lambda _key: None  # called with the topic's key
        tables = [w for w in panel.displays if isinstance(w, Table) and w.key is not None]
        self._tables = {
            table.id: _Keyed(table, interfaces.field_reader(table.type, table.paths))
            for table in tables
        }
        self._by_key: dict[str, list[_Keyed]] = {}
        for one in self._tables.values():
            self._by_key.setdefault(key_of(one.table.topic), []).append(one)
        self.keys = frozenset(self._by_key)

    def record_sample(self, key: str, sample: Sample) -> None:
        """A sample was received: it is decoded in the next turns."""
        for one in self._by_key[key]:
            one.queued.add(sample, len(sample.payload))
        if not self._scheduled:
            self._scheduled = True
            self._slices.schedule(self._decode)

    def entries(self, widget_id: str) -> list[Entry]:
        """The entries of a table, in the order of their first message."""
        return list(self._tables[widget_id].entries.values())

    def _decode(self, until: float) -> bool:
        """Decodes until a time (monotonic seconds); returns whether nothing is left."""
        for key, tables in self._by_key.items():
            pending = [one for one in tables if one.is_pending]
            for one in pending:
                one.decode_one(self._slices, until)
            if pending:
                self.on_decoded(key)
        self._scheduled = any(one.is_pending for one in self._tables.values())
        return not self._scheduled
