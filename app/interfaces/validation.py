"""What a field takes: plain values checked against their definitions, and what is wrong with them."""

import datetime
import math
import reprlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from itertools import islice
from typing import Any, Final

from app.errors import FieldError
from app.interfaces.cdr.formats import FORMATS
from app.interfaces.definitions import INTEGERS, Structure, Type

Check = Callable[[Any], Any]  # what came → what is sent; FieldError with "" or "[3]" as its field

FLOAT_MAX: Final[Mapping[str, float]] = {
    "float32": (2 - 2**-23) * 2.0**127,
    "float64": math.inf,
}

LONGEST_SHOWN: Final = 60  # characters
MOST_SHOWN: Final = 3  # elements of a list or a table
DEEPEST_SHOWN: Final = 3

_short = reprlib.Repr()
_short.maxother = LONGEST_SHOWN


def shown(given: Any, depth: int = DEEPEST_SHOWN) -> str:
    """A value as TOML and JSON write it, for an error message: never longer than a line."""
    match given:
        case None:
            return "null"
        case bool():
            return "true" if given else "false"
        case str():
            return _quoted(given)
        case datetime.date() | datetime.time():
            return given.isoformat()
        case Mapping() | list() | tuple() if not depth:
            return "…"
        case Mapping():
            items = (
                f"{key} = {shown(one, depth - 1)}" for key, one in islice(given.items(), MOST_SHOWN)
            )
            return f"{{{_cut(items, len(given))}}}"
        case list() | tuple():
            elements = (shown(one, depth - 1) for one in given[:MOST_SHOWN])
            return f"[{_cut(elements, len(given))}]"
    return _short.repr(given)


def _quoted(text: str) -> str:
    """In double quotes; what would not show, or show as something else, is escaped."""
    cut = f"{text[:LONGEST_SHOWN]}…" if len(text) > LONGEST_SHOWN else text
    escaped = cut.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else _escaped(ord(c)) for c in escaped) + '"'


def _escaped(code: int) -> str:
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"


def _cut(parts: Iterable[str], count: int) -> str:
    text = ", ".join(parts) + (", …" if count > MOST_SHOWN else "")
    return f"{text[:LONGEST_SHOWN]}…" if len(text) > LONGEST_SHOWN else text


def scalar_check(kind: Type) -> Check:
    """The check of one value of a base type."""
    if kind.name == "bool":
        return _bool
    if kind.name in INTEGERS:
        return _integer(kind.name)
    if kind.name in FLOAT_MAX:
        return _float(kind.name)
    return _text(kind)


def _plain(given: Any) -> Any:
    """A scalar of an array library as Python's own."""
    return given.item() if hasattr(given, "item") else given


def _bool(given: Any) -> bool:
    value = _plain(given)
    if value is True or value is False:
        return bool(value)
    raise FieldError("", f"must be true or false, not {shown(given)}")


def _integer(name: str) -> Check:
    low, high = INTEGERS[name]

    def check(given: Any) -> int:
        if type(given) is not int:
            given = _plain(given)
            if type(given) is not int:
                raise FieldError("", f"must be a whole number ({name}), not {shown(given)}")
        if low <= given <= high:
            return given
        raise FieldError("", f"{given} is out of range: {name} goes from {low} to {high}")

    return check


def _float(name: str) -> Check:
    highest = FLOAT_MAX[name]

    def check(given: Any) -> float:
        given = _plain(given)
        if type(given) not in (int, float):
            raise FieldError("", f"must be a number ({name}), not {shown(given)}")
        try:
            value = float(given)
        except OverflowError:
            raise FieldError("", f"{shown(given)} is out of range for {name}") from None
        if abs(value) > highest and not math.isinf(value):
            raise FieldError("", f"{given} is out of range: {name} goes to {highest:g}")
        return value

    return check


def _text(kind: Type) -> Check:
    name, bound = kind.name, kind.bound
    encoding, unit, units = (
        ("utf-8", 1, "bytes") if name == "string" else ("utf-16-le", 2, "UTF-16 units")
    )

    def check(given: Any) -> str:
        if not isinstance(given, str):
            raise FieldError("", f"must be text ({name}), not {shown(given)}")
        if "\0" in given:
            raise FieldError("", "has a NUL character, at which a ROS string ends")
        size = len(given)
        if not given.isascii():
            try:
                size = len(given.encode(encoding)) // unit
            except UnicodeEncodeError:
                why = "is not valid Unicode text (it has half of a surrogate pair)"
                raise FieldError("", why) from None
        if bound and size > bound:
            raise FieldError("", f"is {size} {units} long; {kind} takes {bound} at most")
        return given

    return check


def message_check(structure: Structure, make: Callable[..., Any], checks: Sequence[Check]) -> Check:
    """The check of a whole structure: a mapping of its fields → `make(*values)`."""
    names = {field.name for field in structure.fields}
    plan = [
        (field.name, check, check(field.left_out))
        for field, check in zip(structure.fields, checks, strict=True)
    ]

    def message(given: Any) -> Any:
        if type(given) is not dict and not isinstance(given, Mapping):
            raise FieldError(
                "", f"must be a table of the fields of {structure.name}, not {shown(given)}"
            )
        if not given.keys() <= names:
            raise _unknown(structure, given)
        name = ""
        try:
            values = []
            for name, check, left_out in plan:
                values.append(check(given[name]) if name in given else left_out)
        except FieldError as error:
            raise _within(name, error) from None
        return make(*values)

    return message


def list_check(kind: Type, element: Check) -> Check:
    """The check of an array or a sequence, whose elements `element` checks; bytes stand for 8-bit
    numbers, and an array of any library with one dimension for a list."""

    def many(given: Any) -> Any:
        if isinstance(given, bytes | bytearray | memoryview) and FORMATS.get(kind.name) == "B":
            given = bytes(given)
            _check_length(kind, len(given))
            return given
        if getattr(given, "ndim", 0) == 1:
            given = given.tolist()
        if not isinstance(given, Sequence) or isinstance(given, str | bytes | bytearray | memoryview):
            raise FieldError("", f"must be a list ({kind}), not {shown(given)}")
        _check_length(kind, len(given))
        return _each(given, element)

    return many


def _each(given: Sequence[Any], check: Check) -> list[Any]:
    made: list[Any] = []
    try:
        for item in given:
            made.append(check(item))
    except FieldError as error:
        raise _within(f"[{len(made)}]", error) from None
    return made


def _check_length(kind: Type, length: int) -> None:
    if kind.many == "array" and length != kind.size:
        raise FieldError("", f"must have {kind.size} elements, not {length}")
    if kind.many == "sequence" and kind.size and length > kind.size:
        raise FieldError("", f"may have {kind.size} elements at most, not {length}")


def _within(step: str, error: FieldError) -> FieldError:
    """The same error, one step further out: "c" within "b[3]" is "b[3].c"."""
    joint = "." if error.field and not error.field.startswith("[") else ""
    return FieldError(f"{step}{joint}{error.field}", error.message)


def _unknown(structure: Structure, given: Mapping[str, Any]) -> FieldError:
    names = [field.name for field in structure.fields]
    name = next(name for name in given if name not in names)
    return FieldError(str(name), f"unknown field; {structure.name} has {', '.join(names) or 'none'}")


def field_check(kind: Type, nested: Callable[[str], Check]) -> Check:
    """The check of a field; `nested` finds that of another structure."""
    one = nested(kind.name) if kind.nested else scalar_check(kind)
    return one if kind.many == "one" else list_check(kind, one)
