"""Message objects to and from CDR."""

from collections.abc import Mapping
from dataclasses import field, make_dataclass
from typing import Any, Final

from app.interfaces.decoding import Order, Read, message_reader
from app.interfaces.definitions import PLACEHOLDER, Field, Structure, Type
from app.interfaces.encoding import Write, message_writer
from app.interfaces.formats import HEADER

LITTLE_ENDIAN: Final = b"\0\1\0\0"
ORDERS: Final[Mapping[bytes, Order]] = {b"\0\0": ">", b"\0\1": "<"}  # the last two bytes are options
ALIGNMENT: Final = 4  # bytes: a message may be padded to a multiple of it (RTPS 2.5, 9.4.2.12)


class Codec:
    """Serializes the structures of one set of definitions; each is prepared at its first use."""

    def __init__(self, structures: Mapping[str, Structure]) -> None:
        self._structures = structures
        self._classes: dict[str, type[Any]] = {}
        self._writers: dict[str, Write] = {}
        self._readers: dict[tuple[Order, str], Read] = {}

    def serialize(self, message: Any, name: str) -> bytes:
        out = bytearray(LITTLE_ENDIAN)
        self._writer(name)(out, message)
        return bytes(out)

    def deserialize(self, data: bytes, name: str) -> Any:
        """The message object; ValueError, `struct.error` or UnicodeError where it is none."""
        order = ORDERS.get(bytes(data[:2])) if len(data) >= HEADER else None
        if order is None:
            raise ValueError("it does not begin as plain CDR does")
        body = memoryview(data)[HEADER:]
        message, end = self._reader(order, name)(body, 0)
        if len(body) not in (end, end + -end % ALIGNMENT):
            raise ValueError(f"it ends at {HEADER + end}")
        return message

    def message_class(self, name: str) -> type[Any]:
        """The class of a structure's message objects: fields as attributes, constants on the class."""
        if name not in self._classes:
            self._classes[name] = _message_class(self._structures[name])
        return self._classes[name]

    def _writer(self, name: str) -> Write:
        if name not in self._writers:
            self._writers[name] = message_writer(self._fields(name), self._writer)
        return self._writers[name]

    def _reader(self, order: Order, name: str) -> Read:
        known = self._readers.get((order, name))
        if known is None:
            fields, made = self._fields(name), self.message_class(name)
            known = message_reader(fields, made, order, lambda inner: self._reader(order, inner))
            self._readers[order, name] = known
        return known

    def _fields(self, name: str) -> tuple[Field, ...]:
        return self._structures[name].fields or (Field(PLACEHOLDER, Type("uint8")),)


def _message_class(structure: Structure) -> type[Any]:
    fields: list[Any] = [(one.attribute, Any) for one in structure.fields]
    return make_dataclass(
        structure.name.rpartition("/")[2],
        fields or [(PLACEHOLDER, int, field(default=0, repr=False))],
        namespace={"__msgtype__": structure.name, **structure.constants},
    )
