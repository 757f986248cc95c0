"""Type hashes (REP 2016, version 1): the SHA-256 of a type description in JSON."""

import json
from collections.abc import Callable, Mapping
from hashlib import sha256
from typing import Any, Final

from app.interfaces.definitions import PLACEHOLDER, Field, Structure, Type

# Numbers of type_description_interfaces/msg/FieldType. `char` of a .msg file is uint8 there.
NESTED: Final = 1
BASE_IDS: Final[Mapping[str, int]] = {
    "int8": 2,
    "uint8": 3,
    "char": 3,
    "int16": 4,
    "uint16": 5,
    "int32": 6,
    "uint32": 7,
    "int64": 8,
    "uint64": 9,
    "float32": 10,
    "float64": 11,
    "bool": 15,
    "byte": 16,
    "octet": 16,
    "string": 17,
    "wstring": 18,
}
BOUNDED_TEXT: Final = 4  # added to the number of a string type; the next three to that of any type
ARRAY: Final = 48
BOUNDED_SEQUENCE: Final = 96
SEQUENCE: Final = 144


def type_hash(structure: Structure, find: Callable[[str], Structure]) -> str:
    """`RIHS01_` and 64 hexadecimal digits; `find` returns referenced structures by name."""
    inner = referenced_structures(structure, find)
    whole = {
        "type_description": _describe_structure(structure),
        "referenced_type_descriptions": [_describe_structure(inner[name]) for name in sorted(inner)],
    }
    return f"RIHS01_{sha256(json.dumps(whole).encode()).hexdigest()}"


def referenced_structures(
    structure: Structure, find: Callable[[str], Structure]
) -> dict[str, Structure]:
    """All structures that one references, directly or indirectly, by name; without itself."""
    inner: dict[str, Structure] = {}
    _collect(structure, find, inner)
    return inner


def _collect(
    structure: Structure, find: Callable[[str], Structure], inner: dict[str, Structure]
) -> None:
    for _, name in structure.nested_fields():
        if name not in inner:
            inner[name] = find(name)
            _collect(inner[name], find, inner)


def _describe_structure(structure: Structure) -> dict[str, Any]:
    fields = structure.fields or (Field(PLACEHOLDER, Type("uint8")),)
    return {"type_name": structure.name, "fields": [_describe_field(field) for field in fields]}


def _describe_field(field: Field) -> dict[str, Any]:
    described = {
        "type_id": _type_id(field.type),
        "capacity": field.type.size,
        "string_capacity": field.type.bound,
        "nested_type_name": field.type.name if field.type.is_nested else "",
    }
    return {"name": field.name, "type": described}


def _type_id(kind: Type) -> int:
    type_id = NESTED if kind.is_nested else BASE_IDS[kind.name] + (BOUNDED_TEXT if kind.bound else 0)
    match kind.container:
        case "one":
            return type_id
        case "array":
            return type_id + ARRAY
    return type_id + (BOUNDED_SEQUENCE if kind.size else SEQUENCE)
