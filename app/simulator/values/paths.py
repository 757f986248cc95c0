"""Puts values at the paths of fields into messages that are dicts and lists: pure.

A list grows to have the element of an index, or one with the key that a path names.
"""

from collections.abc import Mapping, Sequence
from typing import Any

from app.interfaces import Structure, Type
from app.interfaces.cdr.selection import Resolver
from app.interfaces.definitions import zero_value
from app.interfaces.field_path import Key, PathStep, path_steps

Fields = dict[str, Any]
Structures = Mapping[str, Structure]


def put(fields: Fields, type_name: str, path: str, value: Any, structures: Structures) -> None:
    """Sets one field of a message of a type."""
    _put(
        fields,
        structures[type_name],
        Resolver(structures).typed_steps(type_name, path),
        value,
        structures,
    )


def _put(
    fields: Fields, structure: Structure, steps: Sequence[PathStep], value: Any, structures: Structures
) -> None:
    name, *rest = steps
    field = next(field for field in structure.fields if field.name == name)
    if not rest:
        fields[str(name)] = value
    elif isinstance(rest[0], str):
        inner = fields.setdefault(str(name), {})
        _put(inner, structures[field.type.name], rest, value, structures)
    else:
        items = fields[str(name)] = list(fields.get(str(name), field.default_value))
        index = _index(fields, items, structure, field.type, rest[0], structures)
        _grow(items, field.type, index)
        if len(rest) == 1:
            items[index] = value
        else:
            items[index] = dict(items[index])
            _put(items[index], structures[field.type.name], rest[1:], value, structures)


def _index(
    fields: Fields,
    items: list[Any],
    structure: Structure,
    kind: Type,
    step: PathStep,
    structures: Structures,
) -> int:
    """Which element a step names."""
    if not isinstance(step, Key):
        return int(step)
    first = step.path.partition(".")[0]
    if kind.is_nested and any(field.name == first for field in structures[kind.name].fields):
        for number, item in enumerate(items):
            if get(item, path_steps(step.path)) == step.value:
                return number
        index = 0 if kind.container == "array" else len(items)
        items[index : index + 1] = [{}]
        _put(items[index], structures[kind.name], path_steps(step.path), step.value, structures)
        return index
    if not any(field.name == first for field in structure.fields):
        return 0
    beside = fields[first] = list(fields.get(first, ()))
    if step.value not in beside:
        beside.append(step.value)
    return beside.index(step.value)


def _grow(items: list[Any], kind: Type, index: int) -> None:
    while len(items) <= index:
        items.append(zero_value(kind.element))


def get(fields: Any, steps: Sequence[PathStep]) -> Any:
    """The value at a path; None where a message does not have it."""
    if not steps:
        return fields
    step, *rest = steps
    if isinstance(step, str):
        if len(rest) and isinstance(rest[0], Key) and isinstance(fields, Mapping):
            return _get_by_key(fields, step, rest[0], rest[1:])
        return get(fields.get(step), rest) if isinstance(fields, Mapping) else None
    if isinstance(step, int) and isinstance(fields, list | tuple) and step < len(fields):
        return get(fields[step], rest)
    return None


def _get_by_key(fields: Mapping[str, Any], name: str, key: Key, rest: Sequence[PathStep]) -> Any:
    items = fields.get(name, ())
    keys = fields.get(key.path)
    if not isinstance(keys, list | tuple):
        keys = [get(item, path_steps(key.path)) for item in items]
    index = next((i for i, element_key in enumerate(keys) if element_key == key.value), len(items))
    return get(items[index], rest) if index < len(items) else None


def merged(fields: Fields, over: Mapping[str, Any]) -> Fields:
    """Both; tables within tables are merged too."""
    for key, value in over.items():
        inner: Any = fields.get(key)
        tables = isinstance(value, Mapping) and isinstance(inner, dict)
        fields[key] = merged(inner, value) if tables else value
    return fields
