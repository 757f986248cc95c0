"""A table of the entries of a list: diagnostics, a queue."""

from collections.abc import Collection, Iterator
from typing import Annotated, Final, Literal, NamedTuple, Self

from pydantic import AfterValidator, Field

from app.panel.base import Description, Label, MessageField, Span, non_empty
from app.panel.checks.types import entry_faults, field_faults
from app.panel.shared_keys import AgeKey, NumberKeys, NumberOrTimeFormat, number_key_faults
from app.panel.times import DEFAULT_FORMATS
from app.panel.widgets.displays import (
    ConstantPrefix,
    LampState,
    States,
    constant_faults,
    resolved_states,
    state_faults,
)
from app.panel.widgets.families import CheckContext, DisplayWidget, TopicSource, TopicWidget
from app.ros.messages import Interfaces
from app.system.errors import Fault
from app.system.texts import PanelText

MAX_COLUMNS: Final = 8
MAX_ROWS: Final = 20
MAX_ENTRIES: Final = 10_000
READ_BY_DEFAULT: Final = 2_000
EntriesRead = Annotated[int, Field(ge=1, le=MAX_ENTRIES)]

ListPath = Annotated[str, Field(pattern=r"^[a-z][a-z0-9_]*(\.[a-z][a-z0-9_]*)*$", max_length=200)]


class Column(NumberKeys):
    """One column: a field of each entry, or the entry itself where that is a single value."""

    label: Label
    field: MessageField | None = None
    format: NumberOrTimeFormat | None = None
    constants: ConstantPrefix | None = None
    states: States = ()
    width: Annotated[int, Field(ge=1, le=12)] = 1


class Sort(Description):
    """Which entries come first: by a field of theirs, or those that were received last."""

    first: Literal["largest", "smallest", "newest"]
    by: MessageField | None = None


class ColumnField(NamedTuple):
    """A column's field of one entry, as a readout or a lamp has its field."""

    type: str
    field: str
    format: str | None
    unit: str | PanelText
    constants: str | None
    states: tuple[LampState, ...]
    scale: float
    offset: float


class Table(AgeKey, TopicWidget, DisplayWidget):
    """Shows the first `rows_shown` of all entries of a list. With a `key`, the latest entry for each of
    its values is kept, as several messages bring them."""

    kind: Literal["table"]
    field: ListPath
    columns: Annotated[
        tuple[Column, ...],
        Field(strict=False, alias="column", max_length=MAX_COLUMNS),
        AfterValidator(non_empty),
    ]
    rows_shown: Annotated[int, Field(ge=1, le=MAX_ROWS)] = 5
    entries_read: EntriesRead = READ_BY_DEFAULT
    sort: Sort | None = None
    key: MessageField | None = None
    span: Span = 12

    def path(self, entry: int, field: str | None) -> str:
        """The path of a field of one entry."""
        return f"{self.field}[{entry}].{field}" if field else f"{self.field}[{entry}]"

    @property
    def own_fields(self) -> tuple[str | None, ...]:
        """The fields of an entry that are read: those of the columns, then those of sort and key."""
        by = None if self.sort is None else self.sort.by
        others = [field for field in (by, self.key) if field is not None]
        return tuple(dict.fromkeys([*(column.field for column in self.columns), *others]))

    @property
    def widths(self) -> list[float]:
        """The widths of the columns, in percent."""
        whole = sum(column.width for column in self.columns)
        return [round(100 * column.width / whole, 2) for column in self.columns]

    def column_field(self, column: Column) -> ColumnField:
        """A column's field, of the first entry."""
        path = self.path(0, column.field)
        keys = (column.format, column.unit, column.constants, column.states)
        return ColumnField(self.type, path, *keys, column.scale, column.offset)

    def sources(self) -> Iterator[TopicSource]:
        yield TopicSource(self.topic, self.type, self.qos, ())  # its list is read by itself

    def with_constants(self, interfaces: Interfaces) -> Self:
        columns = tuple(self._resolved(column, interfaces) for column in self.columns)
        return self.model_copy(update={"columns": columns})

    def _resolved(self, column: Column, interfaces: Interfaces) -> Column:
        if not column.states:
            return column
        states = resolved_states(self.column_field(column), interfaces)
        return column.model_copy(update={"states": states})

    def faults(self, place: str, checking: CheckContext) -> Iterator[Fault]:
        interfaces = checking.interfaces
        faults = list(field_faults(place, self.type, self.field, interfaces))
        yield from faults
        if faults:
            return
        kind = interfaces.type_at(self.type, self.field)
        if kind.container != "sequence":
            message = f'"{self.field}" is {kind}: a table is for a list of any length'
            yield Fault(f"{place}.field", message)
            return
        if kind.size and self.entries_read > kind.size and "entries_read" in self.model_fields_set:
            message = f'"{self.field}" has {kind.size} entries at most: read no more'
            yield Fault(f"{place}.entries_read", message)
            return
        for c, column in enumerate(self.columns):
            yield from self._column_faults(f"{place}.column[{c}]", column, interfaces)
        yield from self._order_faults(place, interfaces)

    def _column_faults(self, place: str, column: Column, interfaces: Interfaces) -> Iterator[Fault]:
        field = self.column_field(column)
        whole = () if column.states else DEFAULT_FORMATS.keys()
        faults = list(self._entry_faults(f"{place}.field", column.field, interfaces, whole))
        yield from faults
        if faults:
            return
        kind = interfaces.field_type(field.type, field.field)
        if column.states:
            yield from state_faults(place, field, kind, interfaces, "a column with states")
            for key in ("format", "unit", "scale", "offset", "constants"):
                if key in column.model_fields_set:
                    yield Fault(f"{place}.{key}", "is not for a column with states: they are its texts")
            return
        yield from number_key_faults(place, column, column.field or self.field, kind)
        yield from constant_faults(place, field, interfaces)

    def _entry_faults(
        self, place: str, field: str | None, interfaces: Interfaces, whole: Collection[str] = ()
    ) -> Iterator[Fault]:
        """Faults of a field of each entry, which must be a single value, or of a type in `whole`."""
        yield from entry_faults(place, self.type, self.field, field, "a cell", interfaces, whole)

    def _order_faults(self, place: str, interfaces: Interfaces) -> Iterator[Fault]:
        if self.key is not None:
            yield from self._entry_faults(f"{place}.key", self.key, interfaces)
        sort = self.sort
        if sort is None:
            return
        if (sort.first == "newest") != (sort.by is None):
            message = (
                "is for the largest or smallest" if sort.by else "is missing: the field to sort by"
            )
            yield Fault(f"{place}.sort.by", message)
        elif sort.by is not None:
            yield from self._entry_faults(f"{place}.sort.by", sort.by, interfaces)
