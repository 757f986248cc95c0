"""Checks plain values against field definitions."""

import datetime
import math
import reprlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from difflib import get_close_matches
from itertools import islice
from typing import Any, Final

from app.ros.cdr.reader import FORMATS
from app.ros.messages.definitions import FLOAT_TYPES, INTEGER_RANGES, STRING_TYPES, Structure, Type
from app.system.errors import FieldError

Check = Callable[[Any], Any]  # given value → value to encode; FieldError with "" or "[3]" as its field

FLOAT_MAX: Final[Mapping[str, float]] = {
    "float32": (2 - 2**-23) * 2.0**127,
    "float64": math.inf,
}

MAX_SHOWN_CHARS: Final = 60  # characters
MAX_SHOWN_ELEMENTS: Final = 3  # elements of a list or a table
MAX_SHOWN_DEPTH: Final = 3
MAX_LISTED: Final = 12  # names

_shortener = reprlib.Repr()
_shortener.maxother = MAX_SHOWN_CHARS


def format_value(value: Any, depth: int = MAX_SHOWN_DEPTH) -> str:
    """A value as TOML and JSON write it, cut to a line, for an error message."""
    match value:
        case None:
            return "null"
        case bool():
            return "true" if value else "false"
        case str():
            return _quote(value)
        case datetime.date() | datetime.time():
            return value.isoformat()
        case Mapping() | list() | tuple() if not depth:
            return "…"
        case Mapping():
            items = (
                f"{key} = {format_value(item, depth - 1)}"
                for key, item in islice(value.items(), MAX_SHOWN_ELEMENTS)
            )
            return f"{{{_join_limited(items, len(value))}}}"
        case list() | tuple():
            elements = (format_value(element, depth - 1) for element in value[:MAX_SHOWN_ELEMENTS])
            return f"[{_join_limited(elements, len(value))}]"
    return _shortener.repr(value)


def _quote(text: str) -> str:
    """The text in double quotes; characters that are not printable are escaped."""
    cut = f"{text[:MAX_SHOWN_CHARS]}…" if len(text) > MAX_SHOWN_CHARS else text
    escaped = cut.replace("\\", "\\\\").replace('"', '\\"')
    return '"' + "".join(c if c.isprintable() else _escape(ord(c)) for c in escaped) + '"'


def _escape(code: int) -> str:
    return f"\\u{code:04x}" if code <= 0xFFFF else f"\\U{code:08x}"


def _join_limited(parts: Iterable[str], count: int) -> str:
    text = ", ".join(parts) + (", …" if count > MAX_SHOWN_ELEMENTS else "")
    return f"{text[:MAX_SHOWN_CHARS]}…" if len(text) > MAX_SHOWN_CHARS else text


def list_names(names: Iterable[str]) -> str:
    """The first names and the number of others, for a fault; "none" without names."""
    every = list(names)
    more = f" and {len(every) - MAX_LISTED} more" if len(every) > MAX_LISTED else ""
    return ", ".join(every[:MAX_LISTED]) + more or "none"


def scalar_check(kind: Type) -> Check:
    """The check of one value of a base type."""
    if kind.name == "bool":
        return _check_bool
    if kind.name in INTEGER_RANGES:
        return _integer_check(kind.name)
    if kind.name in FLOAT_MAX:
        return _float_check(kind.name)
    return _text_check(kind)


def named_check(kind: Type, structure: Structure) -> Check:
    """The same of a field of a structure: a number or a bool may be given by a constant's name."""
    check = scalar_check(kind)
    fitting = fitting_constants(kind, structure.constants)
    if not fitting:
        return check

    def named(value: Any) -> Any:
        if type(value) is not str:
            return check(value)
        if value in fitting:
            return check(fitting[value])
        raise FieldError("", unknown_constant(value, kind, structure.name, fitting))

    return named


def fitting_constants(kind: Type, constants: Mapping[str, Any]) -> Mapping[str, Any]:
    """The constants that a field of this type can have. None for a text: it may read like a name."""
    return {} if kind.name in STRING_TYPES else {n: v for n, v in constants.items() if _fits(kind, v)}


def _fits(kind: Type, value: Any) -> bool:
    try:
        scalar_check(kind)(value)
    except FieldError:
        return False
    return True


def unknown_constant(name: str, kind: Type, type_name: str, constants: Mapping[str, Any]) -> str:
    """The message about a text that is not the name of a constant, in place of a number or bool."""
    fitting = fitting_constants(kind, constants)
    value = "true or false" if kind.name == "bool" else "a whole number"
    value = "a number" if kind.name in FLOAT_TYPES else value
    right = f"{value} ({kind.element}) or the name of a constant of {type_name}"
    message = f"must be {right}, not {format_value(name)}"
    near = get_close_matches(name, fitting, n=1, cutoff=0.5)
    has = f"it has {list_names(fitting)}"
    return f"{message}; did you mean {near[0]}? {has}" if near else f"{message}; {has}"


def _to_python_scalar(value: Any) -> Any:
    """A scalar of an array library as a Python scalar."""
    return value.item() if hasattr(value, "item") else value


def _check_bool(scalar: Any) -> bool:
    value = _to_python_scalar(scalar)
    if value is True or value is False:
        return bool(value)
    raise FieldError("", f"must be true or false, not {format_value(scalar)}")


def _integer_check(name: str) -> Check:
    low, high = INTEGER_RANGES[name]

    def check(value: Any) -> int:
        if type(value) is not int:
            value = _to_python_scalar(value)
            if type(value) is not int:
                raise FieldError("", f"must be a whole number ({name}), not {format_value(value)}")
        if low <= value <= high:
            return value
        raise FieldError("", f"{value} is out of range: {name} goes from {low} to {high}")

    return check


def _float_check(name: str) -> Check:
    highest = FLOAT_MAX[name]

    def check(number: Any) -> float:
        number = _to_python_scalar(number)
        if type(number) not in (int, float):
            raise FieldError("", f"must be a number ({name}), not {format_value(number)}")
        try:
            value = float(number)
        except OverflowError:
            raise FieldError("", f"{format_value(number)} is out of range for {name}") from None
        if abs(value) > highest and not math.isinf(value):
            raise FieldError("", f"{number} is out of range: {name} goes to {highest:g}")
        return value

    return check


def _text_check(kind: Type) -> Check:
    name, bound = kind.name, kind.bound
    encoding, unit, units = (
        ("utf-8", 1, "bytes") if name == "string" else ("utf-16-le", 2, "UTF-16 units")
    )

    def check(value: Any) -> str:
        if not isinstance(value, str):
            raise FieldError("", f"must be text ({name}), not {format_value(value)}")
        if "\0" in value:
            raise FieldError("", "has a NUL character, at which a ROS string ends")
        size = len(value)
        if not value.isascii():
            try:
                size = len(value.encode(encoding)) // unit
            except UnicodeEncodeError:
                why = "is not valid Unicode text (it has half of a surrogate pair)"
                raise FieldError("", why) from None
        if bound and size > bound:
            raise FieldError("", f"is {size} {units} long; {kind} takes {bound} at most")
        return value

    return check


def message_check(structure: Structure, make: Callable[..., Any], checks: Sequence[Check]) -> Check:
    """The check of a whole structure: a mapping of its fields → `make(*values)`."""
    names = {field.name for field in structure.fields}
    plan = [
        (field.name, check, check(field.default_value))
        for field, check in zip(structure.fields, checks, strict=True)
    ]

    def message(value: Any) -> Any:
        if type(value) is not dict and not isinstance(value, Mapping):
            raise FieldError(
                "", f"must be a table of the fields of {structure.name}, not {format_value(value)}"
            )
        if not value.keys() <= names:
            raise _unknown_field_error(structure, value)
        name = ""
        try:
            values = []
            for name, check, left_out in plan:
                values.append(check(value[name]) if name in value else left_out)
        except FieldError as error:
            raise _prefix_field(name, error) from None
        return make(*values)

    return message


def list_check(kind: Type, element: Check) -> Check:
    """The check of an array or a sequence; `element` checks its elements. `bytes` are accepted for
    8-bit numbers, and one-dimensional arrays of any library for lists."""

    def many(value: Any) -> Any:
        if isinstance(value, bytes | bytearray | memoryview) and FORMATS.get(kind.name) == "B":
            value = bytes(value)
            _check_length(kind, len(value))
            return value
        if getattr(value, "ndim", 0) == 1:
            value = value.tolist()
        if not isinstance(value, Sequence) or isinstance(value, str | bytes | bytearray | memoryview):
            raise FieldError("", f"must be a list ({kind}), not {format_value(value)}")
        _check_length(kind, len(value))
        return _check_elements(value, element)

    return many


def _check_elements(values: Sequence[Any], check: Check) -> list[Any]:
    made: list[Any] = []
    try:
        for item in values:
            made.append(check(item))
    except FieldError as error:
        raise _prefix_field(f"[{len(made)}]", error) from None
    return made


def _check_length(kind: Type, length: int) -> None:
    if kind.container == "array" and length != kind.size:
        raise FieldError("", f"must have {kind.size} elements, not {length}")
    if kind.container == "sequence" and kind.size and length > kind.size:
        raise FieldError("", f"may have {kind.size} elements at most, not {length}")


def _prefix_field(step: str, error: FieldError) -> FieldError:
    """The error with `step` before its field: "c" in "b[3]" becomes "b[3].c"."""
    joint = "." if error.field and not error.field.startswith("[") else ""
    return FieldError(f"{step}{joint}{error.field}", error.message)


def _unknown_field_error(structure: Structure, value: Mapping[str, Any]) -> FieldError:
    names = [field.name for field in structure.fields]
    name = next(name for name in value if name not in names)
    return FieldError(str(name), f"unknown field; {structure.name} has {', '.join(names) or 'none'}")


def field_check(kind: Type, structure: Structure, nested: Callable[[str], Check]) -> Check:
    """The check of a field of a structure; `nested` returns the check of a structure by name."""
    check = nested(kind.name) if kind.is_nested else named_check(kind, structure)
    return check if kind.container == "one" else list_check(kind, check)
