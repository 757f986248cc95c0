"""The format of base types in CDR, and runs of fields that are decoded together.

A number is aligned to its size, counted from the end of the four bytes of the encapsulation header:
XCDR1, as ROS 2 sends it (OMG DDS-XTypes 1.3, 7.4.1).
"""

from collections.abc import Iterable, Iterator, Mapping
from itertools import groupby
from struct import calcsize
from typing import Any, Final

from app.interfaces.definitions import Field, Type

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
