"""Message objects to and from CDR bytes."""

from collections.abc import Mapping, Sequence
from dataclasses import field, make_dataclass
from typing import Any, Final

from app.ros.cdr.fields import FieldReader, RowReader
from app.ros.cdr.reader import (
    LITTLE_ENDIAN_HEADER,
    ByteOrder,
    Read,
    check_end,
    message_reader,
    split_header,
)
from app.ros.cdr.scan import SLICE_ELEMENTS, ReadPlans
from app.ros.cdr.selection import Selection
from app.ros.cdr.writer import Write, message_writer
from app.ros.messages.definitions import PLACEHOLDER, Field, Structure, Type
from app.ros.messages.field_path import FieldCall

SMALL_MESSAGE_BYTES: Final = 20_000  # has few elements
MAX_ELEMENTS: Final = 2_000  # of a message that is decoded at once


class Codec:
    """Encodes and decodes the structures of one set of definitions. Each codec is compiled at its first
    use."""

    def __init__(self, structures: Mapping[str, Structure]) -> None:
        self._structures = structures
        self._classes: dict[str, type[Any]] = {}
        self._writers: dict[str, Write] = {}
        self._readers: dict[tuple[ByteOrder, str], Read] = {}
        self._plans = ReadPlans(self._fields)
        self._counters: dict[str, FieldReader] = {}

    def serialize(self, message: Any, name: str) -> bytes:
        out = bytearray(LITTLE_ENDIAN_HEADER)
        self._writer(name)(out, message)
        return bytes(out)

    def deserialize(self, data: bytes, name: str, whole: bool = False) -> Any:
        """The message object; ValueError, `struct.error` or UnicodeError if the bytes are no such
        message. `whole`: of any number of elements."""
        if len(data) > SMALL_MESSAGE_BYTES and not whole:
            self._check_element_count(data, name)
        body, order = split_header(data)
        message, end = self._reader(order, name)(body, 0)
        check_end(body, end)
        return message

    def _check_element_count(self, data: bytes, name: str) -> None:
        """ValueError for a message with too many elements to be decoded at once."""
        if name not in self._counters:
            ops = self._plans.make_program(name, Selection(), each=True)
            self._counters[name] = FieldReader(name, ops, self._fields_and_class)
        walk = self._counters[name].walk(data)
        for _ in range(MAX_ELEMENTS // SLICE_ELEMENTS):
            if walk.advance() is not None:
                return
        raise ValueError(f"it has more than {MAX_ELEMENTS} elements, which are not read at once")

    def field_reader(
        self, name: str, wanted: Selection, calls: Mapping[str, FieldCall] | None = None
    ) -> FieldReader:
        """A reader of the selected fields of a type, and of functions of them."""
        ops = self._plans.make_program(name, wanted)
        return FieldReader(name, ops, self._fields_and_class, calls)

    def row_reader(
        self,
        name: str,
        wanted: Selection,
        fields: Sequence[str | None],
        most: int,
        last_later: bool = False,
    ) -> RowReader:
        """A reader of the selected fields of each element of a list."""
        ops = self._plans.make_program(name, wanted)
        return RowReader(name, ops, self._fields_and_class, fields, most, last_later)

    def message_class(self, name: str) -> type[Any]:
        """The class of a structure's message objects: fields as attributes, constants on the class."""
        if name not in self._classes:
            self._classes[name] = _message_class(self._structures[name])
        return self._classes[name]

    def _writer(self, name: str) -> Write:
        if name not in self._writers:
            self._writers[name] = message_writer(self._fields(name), self._writer)
        return self._writers[name]

    def _reader(self, order: ByteOrder, name: str) -> Read:
        known = self._readers.get((order, name))
        if known is None:
            fields, made = self._fields(name), self.message_class(name)
            known = message_reader(fields, made, order, lambda inner: self._reader(order, inner))
            self._readers[order, name] = known
        return known

    def _fields_and_class(self, name: str) -> tuple[tuple[Field, ...], type[Any]]:
        return self._fields(name), self.message_class(name)

    def _fields(self, name: str) -> tuple[Field, ...]:
        return self._structures[name].fields or (Field(PLACEHOLDER, Type("uint8")),)


def _message_class(structure: Structure) -> type[Any]:
    fields: list[Any] = [(field.attribute, Any) for field in structure.fields]
    return make_dataclass(
        structure.name.rpartition("/")[2],
        fields or [(PLACEHOLDER, int, field(default=0, repr=False))],
        namespace={"__msgtype__": structure.name, **structure.constants},
    )
