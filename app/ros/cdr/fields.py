"""Reads fields of a message by their paths, without decoding the rest."""

import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from functools import partial
from typing import Any, Final, NamedTuple, Protocol, TypeVar

from app.ros.cdr.reader import (
    ByteOrder,
    Read,
    StructureFactory,
    TruncatedReader,
    check_end,
    is_number,
    split_header,
    value_reader,
)
from app.ros.cdr.scan import PHASES, Mark, Op, Scan
from app.ros.messages.definitions import Type
from app.ros.messages.field_path import Absence, FieldCall, NoValue, computed
from app.system.errors import DecodeError


class Fields:
    """The values of a message at some paths. Texts, lists and structures are decoded as far as they are
    ever shown."""

    __slots__ = ("_ambiguous", "_values")

    def __init__(self, values: Mapping[str, Any], several: Collection[str] = ()) -> None:
        self._values = values
        self._ambiguous = several

    def get(self, path: str) -> Any:
        """The value; None if no element matches the path, several have its key, or a function has
        none."""
        value = self._values.get(path)
        return None if isinstance(value, NoValue) else value

    def absence(self, path: str) -> Absence | None:
        """Why a function has no value; None if it has one, or a field of it is missing."""
        value = self._values.get(path)
        return value.absence if isinstance(value, NoValue) else None

    def is_ambiguous(self, path: str) -> bool:
        """Whether several elements have the path's key."""
        return path in self._ambiguous


LONGEST_KNOWN: Final = 1_000  # bytes of the values that are kept
Result = TypeVar("Result", covariant=True)


class Walk(Protocol[Result]):
    """One message that is being decoded, in slices."""

    def advance(self) -> Result | None:
        """Decodes one slice, which takes some milliseconds at most; None if the message is not complete
        yet. DecodeError if the bytes are no such message."""


class _MessageWalk:
    """A walk through a message to a value of `Result`."""

    __slots__ = ("_body", "_data", "_order", "_reader", "_scan")

    def __init__(self, reader: "_Program", data: bytes) -> None:
        self._reader = reader
        self._data = data
        self._scan: Scan | None = None

    def scanned(self) -> Scan | None:
        """Scans one slice; returns the scan when it is complete."""
        if self._scan is None:
            self._body, self._order = split_header(self._data)
            self._scan = Scan(
                self._reader.ops, self._body, self._order, self._reader.readers[self._order]
            )
        if not self._scan.advance():
            return None
        check_end(self._body, self._scan.at)
        return self._scan

    def value_at(self, mark: Mark, at: int) -> Any:
        """The value of a field that begins at an offset."""
        reader = self._reader.readers[self._order]
        if mark.type.container == "one" and is_number(mark.type):
            return reader(mark.type)(self._body, at)[0]
        return TruncatedReader(reader, self._reader.make, self._body).read(mark.type, at)

    def count_at(self, mark: Mark, at: int) -> int:
        """How many elements the list has that begins at an offset."""
        if mark.type.container == "array":
            return mark.type.size
        count: int = self._reader.readers[self._order](Type("uint32"))(self._body, at)[0]
        return count

    def failed(self, error: Exception) -> DecodeError:
        size = len(self._data)
        return DecodeError(f"{size} bytes are not a {self._reader.type_name}: {error}")


class _FieldWalk(_MessageWalk):
    __slots__ = ("_calls", "_fields", "_received", "_values")

    def __init__(self, reader: "FieldReader", data: bytes, received: float) -> None:
        super().__init__(reader, data)
        self._calls = reader.calls
        self._received = received
        self._values: dict[str, Any] = {}
        self._fields: Iterator[Fields | None] | None = None

    def advance(self) -> Fields | None:
        try:
            if self._fields is None:
                scan = self.scanned()
                if scan is None:
                    return None
                self._read(scan)
                if not self._calls:
                    return Fields(self._values, scan.ambiguous)
                self._fields = self._compute(scan.ambiguous)
            return next(self._fields)
        except Exception as error:  # no received bytes may stop the panel
            raise self.failed(error) from error

    def _read(self, scan: Scan) -> None:
        """The value at each mark; of a list whose length is wanted, its length."""
        for mark, at in scan.marks.items():
            counted = [path for path in mark.paths if path in self._calls]
            if counted:
                self._values |= dict.fromkeys(counted, self.count_at(mark, at))
            if len(counted) < len(mark.paths):
                value = self.value_at(mark, at)
                for path in mark.paths:
                    self._values.setdefault(path, value)

    def _compute(self, ambiguous: Collection[str]) -> Iterator[Fields | None]:
        """The fields with what the functions are, after as many slices as they need."""
        several = {*ambiguous}
        for call in self._calls.values():
            if not several.isdisjoint(call.paths):
                several.add(call.text)
            names = [call.text] if call.text in self._values else call.paths
            arguments = [self._values.get(name) for name in names]
            result: Any = None
            for result in computed(call.name, arguments, self._received):
                if result is None:
                    yield None
            self._values[call.text] = result
        yield Fields(self._values, several)


class _Program:
    """What reads the same fields of each message of a type."""

    def __init__(self, type_name: str, ops: Sequence[Op], make: StructureFactory) -> None:
        self.type_name = type_name
        self.ops = ops
        self.make = make
        self.readers: Mapping[ByteOrder, Callable[[Type], Read]] = {
            "<": _Readers("<").reader_for,
            ">": _Readers(">").reader_for,
        }


class FieldReader(_Program):
    """Reads the same paths of each message of a type. `calls` are the functions among them, by their
    text."""

    def __init__(
        self,
        type_name: str,
        ops: Sequence[Op],
        make: StructureFactory,
        calls: Mapping[str, FieldCall] | None = None,
    ) -> None:
        super().__init__(type_name, ops, make)
        self.calls = calls or {}

    def walk(self, data: bytes, received: float = math.nan) -> Walk[Fields]:
        """Starts to decode a message that arrived at a time, in seconds, see `computed`."""
        return _FieldWalk(self, data, received)

    def read(self, data: bytes, received: float = math.nan) -> Fields:
        """Decodes a whole message; DecodeError if the bytes are no such message."""
        walk = self.walk(data, received)
        while (fields := walk.advance()) is None:
            pass
        return fields


class Rows(NamedTuple):
    """The values of the fields of a list's elements, in the fields' order, and a function in place of
    the last if that is read later; `total` is the number of all elements, also of those beyond the most
    that are read."""

    values: list[tuple[Any, ...]]
    total: int


class _RowWalk(_MessageWalk):
    __slots__ = ("_count", "_rows")

    def __init__(self, reader: "RowReader", data: bytes) -> None:
        super().__init__(reader, data)
        self._rows: list[tuple[Any, ...]] = []
        self._count = 0

    def advance(self) -> Rows | None:
        try:
            scan = self.scanned()
            self._take(scan or self._scan)
        except Exception as error:  # no received bytes may stop the panel
            raise self.failed(error) from error
        return None if scan is None else Rows(self._rows, self._count)

    def _take(self, scan: Scan | None) -> None:
        """Reads the values of the elements of this slice."""
        assert scan is not None
        assert isinstance(self._reader, RowReader)
        fields, most = self._reader.fields, self._reader.most
        for marks in scan.rows:
            self._count += 1
            if self._count <= most:
                if self._reader.last_later:
                    self._rows.append(self._known(marks))
                    continue
                values = self._read(marks)
                self._rows.append(tuple(values.get(name or "") for name in fields))
        scan.rows.clear()

    def _read(self, marks: Mapping[Mark, int]) -> dict[str, Any]:
        return {path: self.value_at(mark, at) for mark, at in marks.items() for path in mark.paths}

    def _known(self, marks: dict[Mark, int]) -> tuple[Any, ...]:
        """The row with a function that reads its last value: the values before it are the same as of
        the same bytes before."""
        assert isinstance(self._reader, RowReader)
        fields, known, offsets = self._reader.fields, self._reader.known, tuple(marks.values())
        start, end, last = offsets[0], offsets[-1], next(reversed(marks))
        if fields[-1] not in last.paths:  # it is not behind the others
            read = self._read(marks)
            return (*(read.get(name or "") for name in fields[:-1]), partial(read.get, fields[-1]))
        later = partial(self._read_later, last, end)
        key = self._order, start % PHASES, bytes(self._body[start : min(end, start + LONGEST_KNOWN)])
        values = known.get(key)
        if values is None:
            read = self._read({mark: at for mark, at in marks.items() if mark is not last})
            values = tuple(read.get(name or "") for name in fields[:-1])
            if end - start < LONGEST_KNOWN:
                if len(known) >= self._reader.most:
                    known.clear()
                known[key] = values
        return (*values, later)

    def _read_later(self, mark: Mark, at: int) -> Any:
        try:
            return self.value_at(mark, at)
        except Exception as error:  # no received bytes may stop the panel
            raise self.failed(error) from error


class RowReader(_Program):
    """Reads the same fields of each element of a list, up to `most` elements. `last_later`: the last
    one is read only where its value is asked for. `known` has the values before it, by the order and
    the phase of their bytes and by these."""

    def __init__(
        self,
        type_name: str,
        ops: Sequence[Op],
        make: StructureFactory,
        fields: Sequence[str | None],
        most: int,
        last_later: bool = False,
    ) -> None:
        super().__init__(type_name, ops, make)
        self.fields = fields
        self.most = most
        self.last_later = last_later
        self.known: dict[tuple[ByteOrder, int, bytes], tuple[Any, ...]] = {}

    def walk(self, data: bytes) -> Walk[Rows]:
        """Starts to decode a message."""
        return _RowWalk(self, data)


class _Readers:
    """Cached value readers by type."""

    def __init__(self, order: ByteOrder) -> None:
        self._order = order
        self._known: dict[Type, Read] = {}

    def reader_for(self, kind: Type) -> Read:
        read = self._known.get(kind)
        if read is None:
            read = self._known[kind] = value_reader(kind, self._order)
        return read
