"""Message objects to and from CDR: rosbags' generated code, and what it lacks.

rosbags takes `byte` for signed and knows no `wstring`. So what it is given is not the definition
but its wire form: `byte` and `char` are uint8, and a wstring is a structure with a sequence of
uint32, which has the same bytes: a count of UTF-16 units, then each unit in four bytes, no
terminator and no byte order mark (so do rmw_fastrtps and rmw_cyclonedds; source:
rosidl_typesupport_fastrtps, and tried).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, make_dataclass
from typing import Any, Final

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from app.interfaces.definitions import PLACEHOLDER, Field, Structure, Type

WIDE: Final = "wire/msg/WString"
LAST_UNIT: Final = 0xFFFF
WIRE_NAMES: Final[Mapping[str, str]] = dict.fromkeys(("byte", "char", "octet"), "uint8")


@dataclass
class Wide:
    """A wstring on its way: UTF-16 units, uint32 each."""

    units: Any


def widened(text: str) -> Wide:
    return Wide(numpy.frombuffer(text.encode("utf-16-le"), "<u2").astype(numpy.uint32))


def narrowed(wide: Wide) -> str:
    """The text; ValueError for what is not UTF-16 (half of a surrogate pair, a larger unit)."""
    if (wide.units > LAST_UNIT).any():
        raise ValueError("a wstring has a unit beyond UTF-16's")
    return str(wide.units.astype("<u2").tobytes().decode("utf-16-le"))


class Codec:
    """Serializes the structures of one set of definitions; each is prepared at its first use."""

    def __init__(self, structures: Mapping[str, Structure]) -> None:
        self._store = Typestore()
        self._structures = structures
        self._narrow: dict[str, Callable[[Any], None] | None] = {}
        self._add(WIDE, Wide, [("units", _wire(Type("uint32", many="sequence")))])

    def serialize(self, message: Any, name: str) -> bytes:
        return bytes(self._store.serialize_cdr(message, name, little_endian=True))

    def deserialize(self, data: bytes, name: str) -> Any:
        """The message object; rosbags and Unicode errors as they are."""
        if name not in self._narrow:
            self.prepare(name)
        message = self._store.deserialize_cdr(data, name)
        narrow = self._narrow[name]
        if narrow is not None:
            narrow(message)
        return message

    def prepare(self, name: str) -> type[Any]:
        """The class of a structure's message objects, after all that it is made of is ready."""
        if name not in self._narrow:
            structure = self._structures[name]
            for _, inner in structure.needs():
                self.prepare(inner)
            described = [(one.name, _wire(one.type)) for one in structure.fields]
            described = described or [(PLACEHOLDER, _wire(Type("uint8")))]
            self._add(name, _message_class(structure), described)
            self._narrow[name] = self._narrowing(structure)
        return self._store.types[name]

    def _add(self, name: str, made: type[Any], described: list[Any]) -> None:
        self._store.types[name] = made
        self._store.fielddefs[name] = ([], described)

    def _narrowing(self, structure: Structure) -> Callable[[Any], None] | None:
        """What turns the wstrings of a decoded structure into text; None where it has none."""
        steps = [(one, self._narrow.get(one.type.name)) for one in structure.fields]
        plan = [(one, inner) for one, inner in steps if inner or one.type.name == "wstring"]
        return _narrowing(plan) if plan else None


def _narrowing(plan: list[tuple[Field, Callable[[Any], None] | None]]) -> Callable[[Any], None]:
    def narrow(message: Any) -> None:
        for one, inner in plan:
            value = getattr(message, one.attribute)
            if inner is None:
                text = narrowed(value) if one.type.many == "one" else [narrowed(each) for each in value]
                setattr(message, one.attribute, text)
            else:
                for each in [value] if one.type.many == "one" else value:
                    inner(each)

    return narrow


def _message_class(structure: Structure) -> type[Any]:
    """A class for message objects: fields as attributes, constants on the class."""
    fields: list[Any] = [(one.attribute, Any) for one in structure.fields]
    return make_dataclass(
        structure.name.rpartition("/")[2],
        fields or [(PLACEHOLDER, int, field(default=0, repr=False))],
        namespace={"__msgtype__": structure.name, **structure.constants},
    )


def _wire(of: Type) -> Any:
    """A type as rosbags' nested tuples, in its wire form."""
    if of.many != "one":
        kind = Nodetype.ARRAY if of.many == "array" else Nodetype.SEQUENCE
        return kind, (_wire(of.element), of.size)
    if of.nested:
        return Nodetype.NAME, of.name
    if of.name == "wstring":
        return Nodetype.NAME, WIDE
    return Nodetype.BASE, (WIRE_NAMES.get(of.name, of.name), of.bound)
