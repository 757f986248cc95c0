"""Decodes the beginning of a value of any size: as much as is ever shown.

Of a list or a message, at most `MAX_PARTS` parts are built; the rest is not read.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final

from app.interfaces.cdr.formats import is_number
from app.interfaces.cdr.reader import Read
from app.interfaces.definitions import Field, Type

MAX_PARTS: Final = 1000  # each is shown with two characters at least

StructureFactory = Callable[
    [str], tuple[Sequence[Field], Callable[..., Any]]
]  # structure name → its fields and class


class TruncatedReader:
    """Decodes one value; used once."""

    def __init__(
        self, reader: Callable[[Type], Read], make: StructureFactory, body: "memoryview[int]"
    ) -> None:
        """`reader` returns the reader of a type that is neither a structure nor a list of
        structures."""
        self._reader_for = reader
        self._factory = make
        self._body = body
        self._parts_left = MAX_PARTS

    def read(self, kind: Type, at: int) -> Any:
        """The value that begins at the offset `at`."""
        return self._read_value(kind, at)[0]

    def _read_value(self, kind: Type, at: int) -> tuple[Any, int]:
        self._parts_left -= 1
        if self._parts_left < 0:
            return None, at
        if is_number(kind):
            return self._reader_for(kind)(self._body, at)
        if kind.container != "one":
            return self._read_list(kind, at)
        return (
            self._read_structure(kind.name, at)
            if kind.is_nested
            else self._reader_for(kind)(self._body, at)
        )

    def _read_structure(self, name: str, at: int) -> tuple[Any, int]:
        fields, make = self._factory(name)
        values = []
        for field in fields:
            value, at = self._read_value(field.type, at)
            values.append(value)
        return make(*values), at

    def _read_list(self, kind: Type, at: int) -> tuple[list[Any], int]:
        count = kind.size
        if kind.container == "sequence":
            count, at = self._reader_for(Type("uint32"))(self._body, at)
        values: list[Any] = []
        while len(values) < count and self._parts_left > 0:
            value, at = self._read_value(kind.element, at)
            values.append(value)
        return values, at
