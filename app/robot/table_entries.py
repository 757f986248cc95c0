"""The entries of tables: those of the newest message, or with a key the latest entry for each key over
several messages, as /diagnostics brings them.

Samples are queued as they arrive, and decoded in slices of some milliseconds. All entries are read for
their order and counts; queue and entries are bounded, and what is over a bound is counted.
"""

import heapq
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from app.bounded import BoundedQueue
from app.errors import DecodeError
from app.interfaces import Interfaces, RowReader, Rows, Walk
from app.panel.model import Panel
from app.panel.widgets.table import Table
from app.robot.sample import Sample
from app.robot.slices import Slices
from app.robot.table_order import NO_ROWS, TableEntry, TableRows, ordered

MAX_KEYS: Final = 5_000
MAX_QUEUED: Final = 64
MAX_QUEUED_BYTES: Final = 4_000_000
LONGEST_KEY: Final = 200
LONGEST_TEXT: Final = 1_000


@dataclass(slots=True, eq=False)
class _Entries:
    """One table with what it has received."""

    table: Table
    reader: RowReader
    queued: BoundedQueue[Sample] = field(
        default_factory=lambda: BoundedQueue(MAX_QUEUED, MAX_QUEUED_BYTES)
    )
    walk: tuple[Walk[Rows], Sample] | None = None
    by_key: dict[str, TableEntry] = field(default_factory=dict)
    shown: TableRows = NO_ROWS

    @property
    def is_pending(self) -> bool:
        return self.walk is not None or len(self.queued) > 0

    def add(self, sample: Sample) -> None:
        if self.table.key is None:
            self.queued.clear()  # only the newest counts
        self.queued.add(sample, len(sample.payload))

    def decode_one(self, slices: Slices, until: float) -> None:
        """Decodes the oldest message, or as much of it as the time allows."""
        if self.walk is None:
            sample = self.queued.take()
            self.walk = self.reader.walk(bytes(sample.payload)), sample
        walk, sample = self.walk
        try:
            rows = slices.read_until(walk, until)
        except DecodeError:
            self.walk = None  # counted where the topic is read
            return
        if rows is not None:
            self.walk = None
            self._keep(rows, sample)

    def _keep(self, rows: Rows, sample: Sample) -> None:
        entries: Sequence[TableEntry] = [
            TableEntry(tuple(map(_cut, values)), sample.at, sample.wall) for values in rows.values
        ]
        unread = rows.total - len(rows.values)
        if self.table.key is not None:
            unread += self._keep_by_key(entries)
            entries = list(self.by_key.values())
        self.shown = ordered(self.table, entries, unread)

    def _keep_by_key(self, entries: Sequence[TableEntry]) -> int:
        """Keeps the newest entry of each key; returns how many keys were too many. The oldest go."""
        place = self.table.own_fields.index(self.table.key)
        for entry in entries:
            if (key := entry.values[place]) is not None:
                self.by_key[f"{key}"[:LONGEST_KEY]] = entry
        over = max(0, len(self.by_key) - MAX_KEYS)
        for key in heapq.nsmallest(over, self.by_key, key=lambda key: self.by_key[key].at):
            del self.by_key[key]
        return over


def _cut(value: Any) -> Any:
    """A value of bounded size."""
    return value[:LONGEST_TEXT] if isinstance(value, str) else value


class TableEntries:
    """The entries of one robot's tables; a `SampleListener`. Used on the event loop only."""

    def __init__(
        self,
        panel: Panel,
        interfaces: Interfaces,
        key_of: Callable[[str], str],
        slices: Slices,
        on_decoded: Callable[[str], None],
    ) -> None:
        """`key_of` returns the key of a topic; `on_decoded` is called with it after a change of its
        entries."""
        self._slices = slices
        self._scheduled = False
        self._on_decoded = on_decoded
        self._tables = {
            w.id: _Entries(w, interfaces.row_reader(w.type, w.field, w.own_fields, w.entries_read))
            for w in panel.displays
            if isinstance(w, Table)
        }
        self._by_key: dict[str, list[_Entries]] = {}
        for table_state in self._tables.values():
            self._by_key.setdefault(key_of(table_state.table.topic), []).append(table_state)
        self.keys = frozenset(self._by_key)

    def record_sample(self, key: str, sample: Sample) -> None:
        """A sample was received: it is decoded in the next turns."""
        for table_state in self._by_key[key]:
            table_state.add(sample)
        if not self._scheduled:
            self._scheduled = True
            self._slices.schedule(self._decode)

    def rows(self, widget_id: str) -> TableRows:
        """The rows of a table now."""
        return self._tables[widget_id].shown

    def _decode(self, until: float) -> bool:
        """Decodes until a time (monotonic seconds); returns whether nothing is left."""
        for key, tables in self._by_key.items():
            pending = [table_state for table_state in tables if table_state.is_pending]
            before = [table_state.shown for table_state in pending]
            for table_state in pending:
                table_state.decode_one(self._slices, until)
            if before != [table_state.shown for table_state in pending]:
                self._on_decoded(key)
        self._scheduled = any(table_state.is_pending for table_state in self._tables.values())
        return not self._scheduled
