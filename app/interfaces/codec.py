"""Message objects to and from CDR: rosbags' generated code, and what it lacks.

rosbags takes `byte` for signed and knows no `wstring`. So what it is given is not the definition
but its wire form: `byte` and `char` are uint8, and a wstring is a structure of uint16 units,
which has the same bytes (a count of UTF-16 units and the units; no terminator, no byte order mark:
what rmw_fastrtps and rmw_cyclonedds write).
"""

import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass, make_dataclass
from typing import Any, Final

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys.store import Typestore

from app.interfaces.definitions import PLACEHOLDER, Field, Structure, Type

WIDE: Final = "wire/msg/WString"
WIRE_NAMES: Final[Mapping[str, str]] = dict.fromkeys(("byte", "char", "octet"), "uint8")
NATIVE_UTF16: Final = "utf-16-le" if sys.byteorder == "little" else "utf-16-be"


@dataclass
class Wide:
    """A wstring on its way: UTF-16 units in this machine's byte order."""

    units: Any


def widened(text: str) -> Wide:
    return Wide(numpy.frombuffer(text.encode(NATIVE_UTF16), numpy.uint16))


def narrowed(wide: Wide) -> str:
    """The text; UnicodeDecodeError for half of a surrogate pair."""
    return str(wide.units.tobytes().decode(NATIVE_UTF16))


class Codec:
    """Serializes the structures of one set of definitions; each is prepared at its first use."""

    def __init__(self, stock: Typestore, structures: Mapping[str, Structure]) -> None:
        """`stock` is rosbags' store of the distribution; its classes serve where they fit."""
        self._store = Typestore()
        self._stock = stock
        self._structures = structures
        self._narrow: dict[str, Callable[[Any], None] | None] = {}
        self._add(WIDE, Wide, [("units", _wire(Type("uint16", many="sequence")))])

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
            made = self._stock_class(structure) or _message_class(structure)
            described = [(one.name, _wire(one.type)) for one in structure.fields]
            self._add(name, made, described or [(PLACEHOLDER, _wire(Type("uint8")))])
            self._narrow[name] = self._narrowing(structure)
        return self._store.types[name]

    def _add(self, name: str, made: type[Any], described: list[Any]) -> None:
        self._store.types[name] = made
        self._store.fielddefs[name] = ([], described)

    def _stock_class(self, structure: Structure) -> type[Any] | None:
        """The class that rosbags has, if it has the same fields."""
        known = self._stock.fielddefs.get(structure.name)
        names = [name for name, _ in known[1] if name != PLACEHOLDER] if known else []
        if known and names == [one.name for one in structure.fields]:
            return self._stock.types[structure.name]
        return None

    def _narrowing(self, structure: Structure) -> Callable[[Any], None] | None:
        """What turns the wstrings of a decoded structure into text; None where it has none."""
        steps = [(one, self._narrow.get(one.type.name)) for one in structure.fields]
        plan = [(one, inner) for one, inner in steps if inner or one.type.name == "wstring"]
        return _narrowing(plan) if plan else None


def _narrowing(plan: list[tuple[Field, Callable[[Any], None] | None]]) -> Callable[[Any], None]:
    def narrow(message: Any) -> None:
        for field, inner in plan:
            value = getattr(message, field.attribute)
            if inner is None:
                text = narrowed(value) if field.type.many == "one" else [narrowed(one) for one in value]
                setattr(message, field.attribute, text)
            else:
                for one in [value] if field.type.many == "one" else value:
                    inner(one)

    return narrow


def _message_class(structure: Structure) -> type[Any]:
    """A class for message objects, like those of rosbags: positional, fields as attributes."""
    names = [one.attribute for one in structure.fields] or [PLACEHOLDER]
    made = make_dataclass(structure.name.rpartition("/")[2], [(name, Any) for name in names])
    made.__msgtype__ = structure.name  # type: ignore[attr-defined]
    return made


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
