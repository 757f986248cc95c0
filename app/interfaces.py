"""ROS 2 interface definitions of one distribution, and messages to and from CDR bytes. No I/O.

The definitions and the codec are rosbags' (`rosbags.typesys`, `rosbags.serde`). What it does not
check is checked here first: its serializer drops unknown keys, takes any truthy value for a bool
and raises `struct.error` for a number out of range.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from difflib import get_close_matches
from functools import lru_cache
from typing import Any, Final

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from app.errors import DecodeError, FieldError, InterfaceError

DISTROS: Final[Mapping[str, Stores]] = {
    "humble": Stores.ROS2_HUMBLE,
    "iron": Stores.ROS2_IRON,
    "jazzy": Stores.ROS2_JAZZY,
    "kilted": Stores.ROS2_KILTED,
}

# What rosbags puts into a message without fields, so that it has one byte.
PLACEHOLDER: Final = "structure_needs_at_least_one_member"

INTEGERS: Final[Mapping[str, tuple[int, int]]] = {
    **{f"int{bits}": (-(2 ** (bits - 1)), 2 ** (bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, 2**bits - 1) for bits in (8, 16, 32, 64)},
    **dict.fromkeys(("byte", "char", "octet"), (0, 255)),
}
FLOAT_MAX: Final[Mapping[str, float]] = {
    "float32": float(numpy.finfo(numpy.float32).max),
    "float64": math.inf,
}
DTYPES: Final[Mapping[str, str]] = {
    **dict.fromkeys(("byte", "char", "octet"), "uint8"),
    "bool": "bool",
}

Definition = Any  # rosbags' nested tuples: (Nodetype, what it needs)


class Interfaces:
    """The types that a panel may name, with their codec."""

    def __init__(self, distro: str = "jazzy") -> None:
        self._store = get_typestore(DISTROS[distro])
        self._distro = distro

    def require(self, type_name: str) -> None:
        """Raises InterfaceError, with the nearest known names, if there is no such type."""
        if type_name in self._store.fielddefs:
            return
        near = get_close_matches(type_name, self._store.fielddefs, n=3)
        hint = f"; did you mean {' or '.join(near)}?" if near else ""
        raise InterfaceError(f'"{type_name}" is not an interface of ROS 2 {self._distro}{hint}')

    def field_type(self, type_name: str, path: str) -> str:
        """The type at a dotted path, as in a .msg file ("float64", "string<=8", "float64[36]")."""
        self.require(type_name)
        at: Definition = (Nodetype.NAME, type_name)
        for name in path.split("."):
            at = self._step(at, name, path)
        return _written(at)

    def _step(self, at: Definition, name: str, path: str) -> Definition:
        kind, detail = at
        fields = self._fields(detail) if kind == Nodetype.NAME else {}
        if name not in fields:
            has = f"has {', '.join(fields)}" if fields else "has no fields of its own"
            raise InterfaceError(f'there is no "{name}" (in "{path}"): {_written(at)} {has}')
        return fields[name]

    def _fields(self, type_name: str) -> dict[str, Definition]:
        """Name → definition, without the placeholder of an empty message."""
        fields = self._store.fielddefs[type_name][1]
        return {name: definition for name, definition in fields if name != PLACEHOLDER}

    def type_hash(self, type_name: str) -> str:
        """The REP 2016 type hash, `RIHS01_…`, as the robot's own nodes compute it."""
        return self._store.hash_rihs01(type_name)

    def encode(self, type_name: str, fields: Mapping[str, Any]) -> bytes:
        """The message as XCDR1 bytes with their encapsulation header (00 01 00 00).

        Every field must be there and fit its definition: else FieldError, which names it.
        """
        message = self._message(type_name, fields, "")
        return bytes(self._store.serialize_cdr(message, type_name))

    def decode(self, type_name: str, data: bytes) -> Any:
        """The message object (fields as attributes); DecodeError if these bytes are not one."""
        try:
            return self._store.deserialize_cdr(data, type_name)
        except Exception as error:  # whatever arrived, it must not stop the panel
            raise DecodeError(f"{len(data)} bytes are not a {type_name}: {error}") from error

    def _message(self, type_name: str, given: Any, where: str) -> Any:
        if not isinstance(given, Mapping):
            raise FieldError(where, f"must be a table of the fields of {type_name}, not {given!r}")
        fields = self._fields(type_name)
        for name in given:
            if name not in fields:
                raise FieldError(
                    _at(where, name), f"unknown field; {type_name} has {', '.join(fields) or 'none'}"
                )
        for name in fields:
            if name not in given:
                raise FieldError(_at(where, name), f"is missing; {type_name} has it")
        made = {n: self._value(fields[n], given[n], _at(where, n)) for n in fields}
        if not fields:
            made[PLACEHOLDER] = 0
        return self._store.types[type_name](**made)

    def _value(self, definition: Definition, given: Any, where: str) -> Any:
        kind, detail = definition
        if kind == Nodetype.BASE:
            name, bound = detail
            return BASE_CHECKS[name](name, bound, given, where)
        if kind == Nodetype.NAME:
            return self._message(detail, given, where)
        return self._list(definition, given, where)

    def _list(self, definition: Definition, given: Any, where: str) -> Any:
        kind, (inner, size) = definition
        if not isinstance(given, Sequence) or isinstance(given, str):
            raise FieldError(where, f"must be a list ({_written(definition)}), not {given!r}")
        if kind == Nodetype.ARRAY and len(given) != size:
            raise FieldError(where, f"must have {size} elements, not {len(given)}")
        if kind == Nodetype.SEQUENCE and size and len(given) > size:
            raise FieldError(where, f"may have {size} elements at most, not {len(given)}")
        made = [self._value(inner, item, f"{where}[{i}]") for i, item in enumerate(given)]
        if inner[0] == Nodetype.BASE and inner[1][0] not in ("string", "wstring"):
            return numpy.array(made, dtype=DTYPES.get(inner[1][0], inner[1][0]))
        return made


@lru_cache
def interfaces_of(distro: str) -> Interfaces:
    """The one instance for a distribution: reading all its definitions takes a tenth of a second."""
    return Interfaces(distro)


def _at(where: str, name: str) -> str:
    return f"{where}.{name}" if where else name


def _written(definition: Definition) -> str:
    """A definition as a .msg file writes it."""
    kind, detail = definition
    if kind == Nodetype.BASE:
        name, bound = detail
        return f"{name}<={bound}" if bound else str(name)
    if kind == Nodetype.NAME:
        return str(detail)
    inner, size = detail
    bound = size if kind == Nodetype.ARRAY else f"<={size}" if size else ""
    return f"{_written(inner)}[{bound}]"


def _bool(name: str, bound: int, given: Any, where: str) -> bool:
    if type(given) is not bool:
        raise FieldError(where, f"must be true or false, not {given!r}")
    return given


def _integer(name: str, bound: int, given: Any, where: str) -> int:
    low, high = INTEGERS[name]
    if type(given) is not int:
        raise FieldError(where, f"must be a whole number ({name}), not {given!r}")
    if not low <= given <= high:
        raise FieldError(where, f"{given} is out of range: {name} goes from {low} to {high}")
    return given


def _float(name: str, bound: int, given: Any, where: str) -> float:
    if type(given) not in (int, float):
        raise FieldError(where, f"must be a number ({name}), not {given!r}")
    try:
        value = float(given)
    except OverflowError:
        raise FieldError(where, f"{given} is out of range for {name}") from None
    if math.isfinite(value) and abs(value) > FLOAT_MAX[name]:
        raise FieldError(where, f"{given} is out of range: {name} goes to {FLOAT_MAX[name]:g}")
    return value


def _string(name: str, bound: int, given: Any, where: str) -> str:
    if not isinstance(given, str):
        raise FieldError(where, f"must be text ({name}), not {given!r}")
    if "\0" in given:
        raise FieldError(where, "has a NUL character, at which a ROS string ends")
    try:
        size = len(given.encode())
    except UnicodeEncodeError:
        raise FieldError(where, "is not valid Unicode text (it has half of a surrogate pair)") from None
    if bound and size > bound:
        raise FieldError(where, f"is {size} bytes long; {name}<={bound} takes {bound} at most")
    return given


Check = Callable[[str, int, Any, str], Any]

BASE_CHECKS: Final[Mapping[str, Check]] = {
    "bool": _bool,
    **dict.fromkeys(INTEGERS, _integer),
    **dict.fromkeys(FLOAT_MAX, _float),
    "string": _string,
    "wstring": _string,
}
