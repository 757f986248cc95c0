"""From plain values to message objects, each value checked against its field's definition; what is left
out has its default, else zero, as in ROS.

A check is made once per type, as nested closures: a small message costs some microseconds.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from app.errors import FieldError
from app.interfaces.definitions import Structure, Type
from app.interfaces.formats import FORMATS
from app.interfaces.scalars import Check, scalar_check, shown


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
