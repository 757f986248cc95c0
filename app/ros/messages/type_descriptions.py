"""Definitions from type_description_interfaces/msg/TypeDescription, as nodes give them (REP 2016).

A node that offers the service `get_type_description` describes the types that it uses, so that a panel
need not have the files of their packages. Default values are left out: they matter to who publishes.
"""

from typing import Any, Final, Literal

from app.ros.messages.definitions import PLACEHOLDER, Definitions, Field, Structure, Type
from app.ros.messages.derived import (
    ARRAY,
    BASE_IDS,
    BOUNDED_SEQUENCE,
    BOUNDED_TEXT,
    NESTED,
    SEQUENCE,
    type_hash,
)
from app.ros.messages.names import ACTION_TYPE, MESSAGE_TYPE, SERVICE_TYPE
from app.ros.messages.parsing import FIELD
from app.system.errors import InterfaceError

SERVICE: Final = "get_type_description"
SERVICE_TYPE_NAME: Final = "type_description_interfaces/srv/GetTypeDescription"
MOST_TYPES: Final = 1000
MOST_ELEMENTS: Final = 2**31

_NAMES: Final = {number: name for name, number in BASE_IDS.items() if name not in ("char", "octet")}


def definitions_of(described: Any, wanted_hash: str = "") -> Definitions:
    """The definitions in a TypeDescription message object.

    InterfaceError if it is malformed, lacks a type that it refers to, or does not have the hash that
    was asked for.
    """
    parts = [described.type_description, *described.referenced_type_descriptions]
    if len(parts) > MOST_TYPES:
        raise InterfaceError(f"a type description of {len(parts)} types is too large")
    structures = {structure.name: structure for structure in map(_structure, parts)}
    main = structures[described.type_description.type_name]

    def find(name: str) -> Structure:
        if name not in structures:
            raise InterfaceError(f"the description of {main.name} lacks {name}")
        return structures[name]

    for structure in structures.values():
        for _, name in structure.nested_fields():
            find(name)
    _check_acyclic(structures)
    if wanted_hash and (own_hash := type_hash(main, find)) != wanted_hash:
        raise InterfaceError(
            f"the description of {main.name} has the hash {own_hash}, not {wanted_hash}"
        )
    return Definitions(structures)


def _check_acyclic(structures: dict[str, Structure]) -> None:
    done: set[str] = set()

    def visit(name: str, above: frozenset[str]) -> None:
        if name in above:
            raise InterfaceError(f"the type {name} contains itself")
        if name not in done:
            for _, inner in structures[name].nested_fields():
                visit(inner, above | {name})
            done.add(name)

    for name in structures:
        visit(name, frozenset())


def _structure(described: Any) -> Structure:
    name = described.type_name
    if not _is_type_name(name):
        raise InterfaceError(f'"{name}" is not a type name, in a type description')
    fields = tuple(_field(name, field) for field in described.fields if field.name != PLACEHOLDER)
    if len({field.name for field in fields}) < len(fields):
        raise InterfaceError(f"{name} has two fields of one name, in a type description")
    return Structure(name, fields)


def _is_type_name(name: str) -> bool:
    """Parts of services and actions have names like SetBool_Request."""
    whole = name.partition("_")[0] if "/" not in name else name
    package, _, last = whole.rpartition("/")
    base = f"{package}/{last.partition('_')[0]}"
    return any(form.fullmatch(base) for form in (MESSAGE_TYPE, SERVICE_TYPE, ACTION_TYPE))


def _field(owner: str, described: Any) -> Field:
    if not FIELD.fullmatch(described.name):
        raise InterfaceError(f'"{described.name}" is not the name of a field, in {owner}')
    return Field(described.name, _type(owner, described))


def _type(owner: str, described: Any) -> Type:
    kind = described.type
    number, container = _split(kind.type_id)
    if max(kind.capacity, kind.string_capacity) > MOST_ELEMENTS:
        raise InterfaceError(f"{owner}.{described.name} has room for too much, in a type description")
    if number == NESTED:
        if not _is_type_name(kind.nested_type_name):
            raise InterfaceError(f"{owner}.{described.name} has no type, in a type description")
        return Type(kind.nested_type_name, container=container, size=_size(kind, container))
    bounded = number - BOUNDED_TEXT in (BASE_IDS["string"], BASE_IDS["wstring"])
    name = _NAMES.get(number - BOUNDED_TEXT if bounded else number)
    if name is None:
        raise InterfaceError(f"{owner}.{described.name} is of a type ({kind.type_id}) that is not read")
    return Type(name, kind.string_capacity if bounded else 0, container, _size(kind, container))


def _split(type_id: int) -> tuple[int, Literal["one", "array", "sequence"]]:
    """(number of the element's type, container)."""
    if type_id > SEQUENCE:
        return type_id - SEQUENCE, "sequence"
    if type_id > BOUNDED_SEQUENCE:
        return type_id - BOUNDED_SEQUENCE, "sequence"
    return (type_id - ARRAY, "array") if type_id > ARRAY else (type_id, "one")


def _size(kind: Any, container: str) -> int:
    return 0 if container == "one" or kind.type_id > SEQUENCE else int(kind.capacity)
