"""The order of a table's entries, and what stays hidden below its rows. Pure."""

import heapq
import math
from collections import Counter
from collections.abc import Hashable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from app.panel.values import same_value
from app.panel.widgets.displays import LampState
from app.panel.widgets.table import Table

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
