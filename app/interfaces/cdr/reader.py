"""Decodes CDR bytes. Malformed bytes raise ValueError or `struct.error`.

A reader is compiled once for each structure and byte order, as nested closures. Lists of numbers are
views of the received bytes, not copies: an image costs no more than its header.
"""

import sys
from array import array
from codecs import utf_8_decode, utf_16_be_decode, utf_16_le_decode
from collections.abc import Callable, Sequence
from struct import Struct, unpack_from
from typing import Any, Final, Literal

from app.interfaces.cdr.formats import FORMATS, LENGTH_BYTES, SIZES, group_runs, is_number
from app.interfaces.definitions import Field, Type

ByteOrder = Literal["<", ">"]  # little-endian, big-endian; as `struct` names them
Read = Callable[["memoryview[int]", int], tuple[Any, int]]  # (bytes, offset) → (value, end offset)
ReadStep = Callable[
    ["memoryview[int]", int, list[Any]], int
]  # (bytes, offset, list to append values to) → end offset

NATIVE: Final[ByteOrder] = "<" if sys.byteorder == "little" else ">"
MIN_STRING_BYTES: Final = LENGTH_BYTES + 1
MAX_UTF16_UNIT: Final = 0xFFFF  # of UTF-16
MAX_TEXT: Final = 50_000  # bytes or UTF-16 units that are decoded of one value
ELLIPSIS: Final = "…"
BOOLS: Final = b"\0\1"
# `struct` takes any byte for a bool: as a number it can be checked.
_FORMATS_READ: Final = {**FORMATS, "bool": "B"}


def message_reader(
    fields: Sequence[Field], make: Callable[..., Any], order: ByteOrder, nested: Callable[[str], Read]
) -> Read:
    """The reader of a structure; `nested` returns the reader of another structure by name."""
    steps = [_field_step(run, order, nested) for run in group_runs(fields)]

    def read(data: "memoryview[int]", at: int) -> tuple[Any, int]:
        values: list[Any] = []
        for step in steps:
            at = step(data, at, values)
        return make(*values), at

    return read


def value_reader(kind: Type, order: ByteOrder) -> Read:
    """The reader of a number, a bool, a list of them, or the beginning of a text."""
    if not is_number(kind):
        return (_string_reader if kind.name == "string" else _wstring_reader)(order, MAX_TEXT)
    if kind.container != "one":
        return _number_list_reader(kind, order)
    step = _numbers_step([kind], order)

    def read_number(data: "memoryview[int]", at: int) -> tuple[Any, int]:
        values: list[Any] = []
        end = step(data, at, values)
        return values[0], end

    return read_number


def _field_step(run: Sequence[Field], order: ByteOrder, nested: Callable[[str], Read]) -> ReadStep:
    kind = run[0].type
    if is_number(kind) and kind.container == "one":
        return _numbers_step([step.type for step in run], order)
    read = _field_reader(kind, order, nested)

    def read_value(data: "memoryview[int]", at: int, values: list[Any]) -> int:
        value, at = read(data, at)
        values.append(value)
        return at

    return read_value


def _numbers_step(kinds: Sequence[Type], order: ByteOrder) -> ReadStep:
    size = SIZES[kinds[0].name]
    form = Struct(order + "".join(_FORMATS_READ[kind.name] for kind in kinds))
    bools = [index for index, kind in enumerate(kinds) if kind.name == "bool"]

    def numbers(data: "memoryview[int]", at: int, values: list[Any]) -> int:
        at = _align_up(at, size)
        values += form.unpack_from(data, at)
        return at + form.size

    def numbers_and_bools(data: "memoryview[int]", at: int, values: list[Any]) -> int:
        first = len(values)
        end = numbers(data, at, values)
        for index in bools:
            values[first + index] = _to_bool(values[first + index])
        return end

    return numbers_and_bools if bools else numbers


def _to_bool(byte: int) -> bool:
    """ValueError for a byte that is not 0 or 1, the only bools of CDR."""
    if byte > 1:
        raise ValueError(f"a bool is {byte}, not 0 or 1")
    return byte == 1


def _field_reader(kind: Type, order: ByteOrder, nested: Callable[[str], Read]) -> Read:
    if is_number(kind):
        return _number_list_reader(kind, order)
    text = _string_reader if kind.name == "string" else _wstring_reader
    read_element = nested(kind.name) if kind.is_nested else text(order)
    return read_element if kind.container == "one" else _sequence_reader(kind, read_element, order)


def _sequence_reader(kind: Type, read: Read, order: ByteOrder) -> Read:
    count = _count_reader(kind, order)
    least = MIN_STRING_BYTES if kind.name == "string" else 1

    def many(data: "memoryview[int]", at: int) -> tuple[Any, int]:
        length, at = count(data, at)
        _require_bytes(data, at, length * least)
        values = []
        for _ in range(length):
            value, at = read(data, at)
            values.append(value)
        return values, at

    return many


def _number_list_reader(kind: Type, order: ByteOrder) -> Read:
    count = _count_reader(kind, order)
    form, size = FORMATS[kind.name], SIZES[kind.name]

    def many(data: "memoryview[int]", at: int) -> tuple[Any, int]:
        length, at = count(data, at)
        at = _align_up(at, size) if length else at
        end = at + length * size
        _require_bytes(data, at, length * size)
        return _view_numbers(data[at:end], form, order), end

    return many


def _view_numbers(data: "memoryview[int]", form: Any, order: ByteOrder) -> Any:
    """A view of a list of numbers; `form` is their format character."""
    if form == "?":
        for byte in bytes(data).translate(None, BOOLS)[:1]:
            _to_bool(byte)
        return data.cast(form)
    if order == NATIVE:
        return data.cast(form)
    turned = array(form, data.tobytes())
    turned.byteswap()
    return memoryview(turned)


def _count_reader(kind: Type, order: ByteOrder) -> Read:
    """The reader of the number of elements: fixed for an array, before the elements of a sequence."""
    if kind.container == "array":
        return lambda _, at: (kind.size, at)
    return _length_reader(order)


def _length_reader(order: ByteOrder) -> Read:
    form = Struct(f"{order}I")

    def length(data: "memoryview[int]", at: int) -> tuple[int, int]:
        at = _align_up(at, LENGTH_BYTES)
        return form.unpack_from(data, at)[0], at + LENGTH_BYTES

    return length


def _string_reader(order: ByteOrder, most: int | None = None) -> Read:
    """The reader of a "string": UTF-8 with a terminating NUL, which counts. A longer text is cut to
    `most` bytes and ends with `ELLIPSIS`."""
    length = _length_reader(order)

    def text(data: "memoryview[int]", at: int) -> tuple[str, int]:
        size, at = length(data, at)
        end = at + size
        if not size or end > len(data) or data[end - 1]:
            raise ValueError(f"a text of {size} bytes at {at} is cut off or has no end")
        if most is not None and size > most:
            return utf_8_decode(data[at : at + most])[0] + ELLIPSIS, end
        return str(data[at : end - 1], "utf-8"), end

    return text


def _wstring_reader(order: ByteOrder, most: int | None = None) -> Read:
    """The reader of a "wstring": a count of UTF-16 units, each in four bytes, without terminator and
    byte order mark (as in rmw_fastrtps and rmw_cyclonedds; source: rosidl_typesupport_fastrtps, and
    tried)."""
    length = _length_reader(order)

    def text(data: "memoryview[int]", at: int) -> tuple[str, int]:
        count, at = length(data, at)
        _require_bytes(data, at, count * LENGTH_BYTES)
        read = count if most is None else min(count, most)
        units = unpack_from(f"{order}{read}I", data, at)
        if any(unit > MAX_UTF16_UNIT for unit in units):
            raise ValueError("a wstring has a unit beyond UTF-16's")
        text = array("H", units).tobytes()
        cut = read < count
        decode = utf_16_le_decode if NATIVE == "<" else utf_16_be_decode
        return decode(text, "strict", not cut)[0] + ELLIPSIS * cut, at + count * LENGTH_BYTES

    return text


def _align_up(at: int, size: int) -> int:
    return (at + size - 1) & -size


def _require_bytes(data: "memoryview[int]", at: int, size: int) -> None:
    if size > len(data) - at:
        raise ValueError(f"{size} bytes at {at} are more than there are")
