"""The entries of tables, their order, and what stays hidden below the rows."""

import heapq
import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from app.cell.robot.topics import Slices
from app.panel.model import Panel
from app.panel.values import same_value
from app.panel.widgets.displays import LampState
from app.panel.widgets.table import Table
from app.ros.messages import Interfaces, RowReader, Rows, Walk
from app.ros.zenoh.sample import Sample
from app.system.errors import DecodeError
from app.system.limits import BoundedQueue

# The order of a table's entries, and what stays hidden below its rows. Pure.

NORMAL: Final = frozenset({"grey", "white", "black"})  # colours of states that are not abnormal


@dataclass(frozen=True, slots=True)
class TableEntry:
    """An entry: its values in the order of `Table.own_fields`; `at` and `wall` as in `Sample`."""

    values: tuple[Any, ...]
    at: float
    wall: float = 0.0


@dataclass(frozen=True, slots=True)
class TableRows:
    """The `first` entries in the table's order; `hidden` more were read, of which `abnormal` ones have
    these states (index in the column's states → number); `unread` were not read, or not kept."""

    first: tuple[TableEntry, ...] = ()
    hidden: int = 0
    abnormal: Mapping[int, int] = field(default_factory=dict)
    unread: int = 0


NO_ROWS: Final = TableRows()


def ordered(table: Table, entries: Sequence[TableEntry], unread: int) -> TableRows:
    """What a table shows of all its entries."""
    first = tuple(_first(table, entries))
    counted = Counter(_abnormal(table, entries))
    counted.subtract(Counter(_abnormal(table, first)))
    abnormal = {state: number for state, number in sorted(counted.items()) if number > 0}
    return TableRows(first, len(entries) - len(first), abnormal, unread)


def _first(table: Table, entries: Sequence[TableEntry]) -> Sequence[TableEntry]:
    sort, most = table.sort, table.rows_shown
    if sort is None:
        return entries[:most]
    if sort.by is None:
        newest = heapq.nlargest(
            most, enumerate(entries), key=lambda numbered: (numbered[1].at, numbered[0])
        )
        return [entry for _, entry in newest]
    at = table.own_fields.index(sort.by)
    known = [entry for entry in entries if not _is_unknown(entry.values[at])]
    choose = heapq.nlargest if sort.first == "largest" else heapq.nsmallest
    first = choose(most, known, key=lambda entry: entry.values[at])
    unknown = (entry for entry in entries if _is_unknown(entry.values[at]))
    return [*first, *(entry for _, entry in zip(range(most - len(first)), unknown, strict=False))]


def _is_unknown(value: Any) -> bool:
    return value is None or (isinstance(value, float) and math.isnan(value))


def states_of(table: Table) -> tuple[int, tuple[LampState, ...]]:
    """(place in an entry's values, states) of the first column that has states."""
    for column in table.columns:
        if column.states:
            return table.own_fields.index(column.field), column.states
    return 0, ()


def _abnormal(table: Table, entries: Sequence[TableEntry]) -> Iterator[int]:
    """The index of the state of each entry that is abnormal."""
    place, states = states_of(table)
    known: dict[Hashable, int | None] = {}
    for entry in entries if states else ():
        value = entry.values[place]
        kind = type(value), value
        if kind not in known:
            known[kind] = _state(states, value)
        if (state := known[kind]) is not None:
            yield state


def _state(states: Sequence[LampState], value: Any) -> int | None:
    """The index of a value's state, None if it is normal or has none."""
    for number, state in enumerate(states):
        if same_value(state.value, value):
            return None if state.colour in NORMAL else number
    return None


# The entries of tables: those of the newest message, or with a key the latest entry for each key over
# several messages, as /diagnostics brings them.
#
# Samples are queued as they arrive, and decoded in slices of some milliseconds. All entries are read
# for their order and counts; queue and entries are bounded, and what is over a bound is counted.

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
