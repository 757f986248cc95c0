"""Reads fields of a message by their paths, without decoding the rest."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from app.errors import DecodeError
from app.interfaces.cdr.beginnings import StructureFactory, TruncatedReader
from app.interfaces.cdr.encapsulation import check_end, split_header
from app.interfaces.cdr.formats import is_number
from app.interfaces.cdr.reader import ByteOrder, Read, value_reader
from app.interfaces.cdr.scanner import Scan
from app.interfaces.cdr.steps import Op
from app.interfaces.definitions import Type


class Fields:
    """The values of a message at some paths. Texts, lists and structures are decoded as far as they are
    ever shown."""

    __slots__ = ("_ambiguous", "_values")

    def __init__(self, values: Mapping[str, Any], several: Collection[str] = ()) -> None:
        self._values = values
        self._ambiguous = several

    def get(self, path: str) -> Any:
        """The value; None if no element matches the path, or several have its key."""
        return self._values.get(path)

    def is_ambiguous(self, path: str) -> bool:
        """Whether several elements have the path's key."""
        return path in self._ambiguous


class Walk:
    """One message that is being decoded, in slices."""

    __slots__ = ("_body", "_data", "_order", "_reader", "_scan")

    def __init__(self, reader: "FieldReader", data: bytes) -> None:
        self._reader = reader
        self._data = data
        self._scan: Scan | None = None

    def advance(self) -> Fields | None:
        """Decodes one slice, which takes some milliseconds at most; None if the message is not complete
        yet. DecodeError if the bytes are no such message."""
        reader = self._reader
        try:
            if self._scan is None:
                self._body, self._order = split_header(self._data)
                read = reader.readers[self._order]
                self._scan = Scan(reader.ops, self._body, self._order, read)
            if not self._scan.advance():
                return None
            check_end(self._body, self._scan.at)
            return reader.collect_fields(self._scan, self._body, self._order)
        except Exception as error:  # no received bytes may stop the panel
            size = len(self._data)
            raise DecodeError(f"{size} bytes are not a {reader.type_name}: {error}") from error


class FieldReader:
    """Reads the same paths of each message of a type."""

    def __init__(self, type_name: str, ops: Sequence[Op], make: StructureFactory) -> None:
        self.type_name = type_name
        self.ops = ops
        self._make = make
        self.readers: Mapping[ByteOrder, Callable[[Type], Read]] = {
            "<": _Readers("<").reader_for,
            ">": _Readers(">").reader_for,
        }

    def walk(self, data: bytes) -> Walk:
        """Starts to decode a message."""
        return Walk(self, data)

    def read(self, data: bytes) -> Fields:
        """Decodes a whole message; DecodeError if the bytes are no such message."""
        walk = Walk(self, data)
        while (fields := walk.advance()) is None:
            pass
        return fields

    def collect_fields(self, going: Scan, body: "memoryview[int]", order: ByteOrder) -> Fields:
        """The values of a message that was scanned to its end."""
        values = {}
        reader = self.readers[order]
        for mark, at in going.marks.items():
            if not mark.paths:
                continue
            if mark.type.container == "one" and is_number(mark.type):
                value = reader(mark.type)(body, at)[0]
            else:
                value = TruncatedReader(reader, self._make, body).read(mark.type, at)
            for path in mark.paths:
                values[path] = value
        return Fields(values, going.ambiguous)


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
