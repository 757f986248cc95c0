"""Fields of a message by their paths, each read at its place."""

from collections.abc import Callable, Collection, Mapping, Sequence
from typing import Any

from app.errors import DecodeError
from app.interfaces.cdr.beginnings import Beginning, Make
from app.interfaces.cdr.encapsulation import judge_end, opened
from app.interfaces.cdr.formats import is_number
from app.interfaces.cdr.reader import Order, Read, value_reader
from app.interfaces.cdr.scanner import Scan
from app.interfaces.cdr.steps import Op
from app.interfaces.definitions import Type


class Fields:
    """What a message says at some paths. A text, a list or a message among them is read as far as it is
    ever shown."""

    __slots__ = ("_several", "_values")

    def __init__(self, values: Mapping[str, Any], several: Collection[str] = ()) -> None:
        self._values = values
        self._several = several

    def get(self, path: str) -> Any:
        """The value; None where there is no such element, or more than one with its key."""
        return self._values.get(path)

    def several(self, path: str) -> bool:
        """Whether the value is not known because more than one element has its key."""
        return path in self._several


class Walk:
    """One message that is being read."""

    __slots__ = ("_body", "_data", "_going", "_order", "_reader")

    def __init__(self, reader: "FieldReader", data: bytes) -> None:
        self._reader = reader
        self._data = data
        self._going: Scan | None = None

    def go_on(self) -> Fields | None:
        """Reads on for some milliseconds at the most; None where it is not through then. DecodeError
        where these bytes are no such message."""
        reader = self._reader
        try:
            if self._going is None:
                self._body, self._order = opened(self._data)
                read = reader.reads[self._order]
                self._going = Scan(reader.ops, self._body, self._order, read)
            if not self._going.go_on():
                return None
            judge_end(self._body, self._going.at)
            return reader.found(self._going, self._body, self._order)
        except Exception as error:  # whatever arrived, it must not stop the panel
            size = len(self._data)
            raise DecodeError(f"{size} bytes are not a {reader.type_name}: {error}") from error


class FieldReader:
    """Reads the same paths of each message of a type."""

    def __init__(self, type_name: str, ops: Sequence[Op], make: Make) -> None:
        self.type_name = type_name
        self.ops = ops
        self._make = make
        self.reads: Mapping[Order, Callable[[Type], Read]] = {
            "<": _Readers("<").of,
            ">": _Readers(">").of,
        }

    def walk(self, data: bytes) -> Walk:
        """Begins to read a message."""
        return Walk(self, data)

    def read(self, data: bytes) -> Fields:
        """Reads it to its end; DecodeError if these bytes are no such message."""
        walk = Walk(self, data)
        while (fields := walk.go_on()) is None:
            pass
        return fields

    def found(self, going: Scan, body: "memoryview[int]", order: Order) -> Fields:
        """The values, of a message that was gone through."""
        values = {}
        reader = self.reads[order]
        for mark, at in going.marks.items():
            if not mark.paths:
                continue
            if mark.type.many == "one" and is_number(mark.type):
                value = reader(mark.type)(body, at)[0]
            else:
                value = Beginning(reader, self._make, body).value(mark.type, at)
            for path in mark.paths:
                values[path] = value
        return Fields(values, going.several)


class _Readers:
    """What reads values, by their types."""

    def __init__(self, order: Order) -> None:
        self._order = order
        self._known: dict[Type, Read] = {}

    def of(self, kind: Type) -> Read:
        read = self._known.get(kind)
        if read is None:
            read = self._known[kind] = value_reader(kind, self._order)
        return read
