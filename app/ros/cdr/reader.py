"""Decodes CDR bytes, whole messages or only their beginning, and the format of base types."""

import sys
from array import array
from codecs import utf_8_decode, utf_16_be_decode, utf_16_le_decode
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import groupby
from struct import Struct, calcsize, unpack_from
from typing import Any, Final, Literal

from app.ros.messages.definitions import Field, Type

# The format of base types in CDR, and runs of fields that are decoded together.
#
# A number is aligned to its size, counted from the end of the four bytes of the encapsulation header:
# XCDR1, as ROS 2 sends it (OMG DDS-XTypes 1.3, 7.4.1).

# Format characters of `struct`, `array` and `memoryview`. `byte`, `char` and `octet` are numbers from 0
# to 255.
FORMATS: Final[Mapping[str, str]] = {
    "bool": "?",
    "int8": "b",
    "int16": "h",
    "int32": "i",
    "int64": "q",
    "uint8": "B",
    "uint16": "H",
    "uint32": "I",
    "uint64": "Q",
    "float32": "f",
    "float64": "d",
    **dict.fromkeys(("byte", "char", "octet"), "B"),
}
SIZES: Final[Mapping[str, int]] = {name: calcsize(f"<{form}") for name, form in FORMATS.items()}
HEADER_BYTES: Final = 4  # bytes
LENGTH_BYTES: Final = 4  # bytes of the count before a text or a sequence


def group_runs(fields: Iterable[Field]) -> Iterator[list[Field]]:
    """The fields in order; consecutive single numbers of one size are grouped."""

    def size(field: Field) -> Any:
        return SIZES.get(field.type.name) if field.type.container == "one" else None

    for each, group in groupby(fields, size):
        together = list(group)
        yield from [together] if each else ([format_part] for format_part in together)


def is_number(kind: Type) -> bool:
    """Whether a type is a number or a bool, or a list of them."""
    return kind.name in FORMATS


# Decodes CDR bytes. Malformed bytes raise ValueError or `struct.error`.
#
# A reader is compiled once for each structure and byte order, as nested closures. Lists of numbers are
# views of the received bytes, not copies: an image costs no more than its header.

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


# Decodes the beginning of a value of any size: as much as is ever shown.
#
# Of a list or a message, at most `MAX_PARTS` parts are built; the rest is not read.

MAX_PARTS: Final = 1000  # each is shown with two characters at least

StructureFactory = Callable[
    [str], tuple[Sequence[Field], Callable[..., Any]]
]  # structure name → its fields and class


class TruncatedReader:
    """Decodes one value; used once."""

    def __init__(
        self, reader: Callable[[Type], Read], make: StructureFactory, body: "memoryview[int]"
    ) -> None:
        """`reader` returns the reader of a type that is neither a structure nor a list of
        structures."""
        self._reader_for = reader
        self._factory = make
        self._body = body
        self._parts_left = MAX_PARTS

    def read(self, kind: Type, at: int) -> Any:
        """The value that begins at the offset `at`."""
        return self._read_value(kind, at)[0]

    def _read_value(self, kind: Type, at: int) -> tuple[Any, int]:
        self._parts_left -= 1
        if self._parts_left < 0:
            return None, at
        if is_number(kind):
            return self._reader_for(kind)(self._body, at)
        if kind.container != "one":
            return self._read_list(kind, at)
        return (
            self._read_structure(kind.name, at)
            if kind.is_nested
            else self._reader_for(kind)(self._body, at)
        )

    def _read_structure(self, name: str, at: int) -> tuple[Any, int]:
        fields, make = self._factory(name)
        values = []
        for field in fields:
            value, at = self._read_value(field.type, at)
            values.append(value)
        return make(*values), at

    def _read_list(self, kind: Type, at: int) -> tuple[list[Any], int]:
        count = kind.size
        if kind.container == "sequence":
            count, at = self._reader_for(Type("uint32"))(self._body, at)
        values: list[Any] = []
        while len(values) < count and self._parts_left > 0:
            value, at = self._read_value(kind.element, at)
            values.append(value)
        return values, at


# The encapsulation header before a message's fields, and the padding after them.

LITTLE_ENDIAN_HEADER: Final = b"\0\1\0\0"
ORDERS: Final[Mapping[bytes, ByteOrder]] = {
    b"\0\0": ">",
    b"\0\1": "<",
}  # the last two bytes are options
ALIGNMENT: Final = 4  # bytes: a message may be padded to a multiple of it (RTPS 2.5, 9.4.2.12)


def split_header(data: bytes) -> "tuple[memoryview[int], ByteOrder]":
    """(bytes of the fields, byte order) of a message; ValueError if the header is not plain CDR."""
    order = ORDERS.get(data[:2]) if len(data) >= HEADER_BYTES else None
    if order is None:
        raise ValueError("it does not begin as plain CDR does")
    return memoryview(data)[HEADER_BYTES:], order


def check_end(body: "memoryview[int]", end: int) -> None:
    """ValueError unless the message ends at `end`, or after padding."""
    if len(body) != end and len(body) != end + -end % ALIGNMENT:
        raise ValueError(f"it ends at {HEADER_BYTES + end}")
