"""The beginning of a value that has any size: as much of it as is ever shown.

Of a list or a message so many parts are built; what comes after is not even looked at.
"""

from collections.abc import Callable, Sequence
from typing import Any, Final

from app.interfaces.cdr.formats import is_number
from app.interfaces.cdr.reader import Read
from app.interfaces.definitions import Field, Type

MOST: Final = 1000  # parts: each is two characters at the least when it is shown

Make = Callable[[str], tuple[Sequence[Field], Callable[..., Any]]]  # a structure's fields and class


class Beginning:
    """Builds one value; used once."""

    def __init__(self, reader: Callable[[Type], Read], make: Make, body: "memoryview[int]") -> None:
        """`reader` reads what is no structure, and no list of such."""
        self._reader = reader
        self._make = make
        self._body = body
        self._left = MOST

    def value(self, kind: Type, at: int) -> Any:
        """The value that begins at a place."""
        return self._value(kind, at)[0]

    def _value(self, kind: Type, at: int) -> tuple[Any, int]:
        self._left -= 1
        if self._left < 0:
            return None, at
        if is_number(kind):
            return self._reader(kind)(self._body, at)
        if kind.many != "one":
            return self._list(kind, at)
        return self._structure(kind.name, at) if kind.nested else self._reader(kind)(self._body, at)

    def _structure(self, name: str, at: int) -> tuple[Any, int]:
        fields, make = self._make(name)
        values = []
        for one in fields:
            value, at = self._value(one.type, at)
            values.append(value)
        return make(*values), at

    def _list(self, kind: Type, at: int) -> tuple[list[Any], int]:
        count = kind.size
        if kind.many == "sequence":
            count, at = self._reader(Type("uint32"))(self._body, at)
        values: list[Any] = []
        while len(values) < count and self._left > 0:
            value, at = self._value(kind.element, at)
            values.append(value)
        return values, at
