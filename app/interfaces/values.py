"""From plain values to message objects, each value checked against its field's definition.

A check is made once per type, as nested closures: a small message costs some microseconds.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final

import numpy

from app.errors import FieldError
from app.interfaces.definitions import TEXTS, Structure, Type
from app.interfaces.scalars import FLOAT_MAX, Check, scalar_check, shown

DTYPES: Final[Mapping[str, str]] = dict.fromkeys(("byte", "char", "octet"), "uint8")
PYTHON_TYPES: Final[Mapping[str, frozenset[type]]] = {
    "b": frozenset((bool,)),
    "i": frozenset((int,)),
    "u": frozenset((int,)),
    "f": frozenset((int, float)),
}
MISSING: Final = object()


def message_check(structure: Structure, make: Callable[..., Any], checks: Sequence[Check]) -> Check:
    """The check of a whole structure: a mapping of its fields → `make(*values)`."""
    names = {field.name for field in structure.fields}
    plan = [
        (field.name, check, MISSING if field.default is None else check(field.default))
        for field, check in zip(structure.fields, checks, strict=True)
    ]

    def message(given: Any) -> Any:
        if type(given) is not dict and not isinstance(given, Mapping):
            raise FieldError(
                "", f"must be a table of the fields of {structure.name}, not {shown(given)}"
            )
        if not given.keys() <= names:
            raise _unknown(structure, given)
        values = []
        name = ""
        try:
            for name, check, default in plan:
                if name in given:
                    values.append(check(given[name]))
                elif default is not MISSING:
                    values.append(default)
                else:
                    raise FieldError("", f"is missing; {structure.name} has it")
        except FieldError as error:
            raise _within(name, error) from None
        return make(*values)

    return message


def list_check(kind: Type, element: Check) -> Check:
    """The check of an array or a sequence, whose elements `element` checks."""

    def many(given: Any) -> Any:
        if not isinstance(given, list | tuple) and (
            not isinstance(given, Sequence) or isinstance(given, str | bytes | bytearray | memoryview)
        ):
            if not isinstance(given, numpy.ndarray) or given.ndim != 1:
                raise FieldError("", f"must be a list ({kind}), not {shown(given)}")
            given = given.tolist()
        _check_length(kind, len(given))
        return _each(given, element)

    return many


def numbers_check(kind: Type, element: Check) -> Check:
    """The same for numbers and bools, which go as one NumPy array; bytes stand for 8-bit ones."""
    dtype = numpy.dtype(DTYPES.get(kind.name, kind.name))
    slowly = list_check(kind, element)
    python_types = PYTHON_TYPES[dtype.kind]

    def many(given: Any) -> Any:
        if isinstance(given, list | tuple):
            packed = _packed(given, dtype) if python_types.issuperset(map(type, given)) else None
        elif isinstance(given, numpy.ndarray):
            packed = _repacked(given, dtype) if given.ndim == 1 else None
        elif isinstance(given, bytes | bytearray | memoryview) and dtype == numpy.uint8:
            packed = numpy.frombuffer(bytes(given), numpy.uint8)
        else:
            packed = None
        if packed is None:
            return numpy.array(slowly(given), dtype)
        _check_length(kind, len(packed))
        return packed

    return many


def _packed(given: Sequence[Any], dtype: "numpy.dtype[Any]") -> Any:
    """As an array, or None where a value is out of range."""
    try:
        if dtype == numpy.float32:
            return _repacked(numpy.array(given, numpy.float64), dtype)
        return numpy.array(given, dtype)
    except OverflowError:
        return None


def _repacked(given: "numpy.ndarray[Any, Any]", dtype: "numpy.dtype[Any]") -> Any:
    """An array as one of `dtype`, or None where its values would not be the same."""
    if given.dtype == dtype:
        return numpy.ascontiguousarray(given)
    if given.dtype.kind not in ("iu" if dtype.kind in "iu" else "iuf" if dtype.kind == "f" else ""):
        return None
    if dtype == numpy.float32:
        beyond = numpy.abs(given) > FLOAT_MAX["float32"]
        if (beyond & numpy.isfinite(given)).any():
            return None
    elif dtype.kind in "iu" and len(given):
        limits = numpy.iinfo(dtype)
        if int(given.min()) < limits.min or int(given.max()) > limits.max:
            return None
    return given.astype(dtype)


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


def field_check(kind: Type, nested: Callable[[str], Check], wide: Callable[[str], Any]) -> Check:
    """The check of a field; `nested` finds that of another structure, `wide` is for wstrings."""
    one = nested(kind.name) if kind.nested else scalar_check(kind)
    if kind.name == "wstring":
        one = _then(one, wide)
    if kind.many == "one":
        return one
    if kind.nested or kind.name in TEXTS:
        return list_check(kind, one)
    return numbers_check(kind, one)


def _then(check: Check, made: Callable[[str], Any]) -> Check:
    return lambda given: made(check(given))
