"""Definitions as text in the format "ros2msg": a message, then each structure that it references, after
a separator line and its name. Source: the MCAP format registry, and rosbag2's recordings. No I/O."""

from collections.abc import Callable, Iterator
from typing import Any, Final

from app.ros.messages.definitions import Structure
from app.ros.messages.derived import referenced_structures

SEPARATOR: Final = "=" * 80


def definition_text(structure: Structure, find: Callable[[str], Structure]) -> str:
    """The definition as text; `find` returns referenced structures by name."""
    inner = referenced_structures(structure, find)
    parts = [
        _structure_text(structure),
        *(f"{SEPARATOR}\nMSG: {_short_name(name)}\n{_structure_text(inner[name])}" for name in inner),
    ]
    return "".join(parts)


def _structure_text(structure: Structure) -> str:
    return "".join(f"{line}\n" for line in _lines(structure))


def _lines(structure: Structure) -> Iterator[str]:
    for name, value in structure.constants.items():
        yield f"{_base_name(structure.constant_types[name])} {name}={_literal(value)}"
    for field in structure.fields:
        kind, name = str(field.type), field.type.name
        short = _short_name(name) if field.type.is_nested else _base_name(name)
        yield f"{short}{kind.removeprefix(name)} {field.name}"


def _short_name(name: str) -> str:
    """ "geometry_msgs/msg/Pose" → "geometry_msgs/Pose"."""
    package, _, message = name.split("/")
    return f"{package}/{message}"


def _base_name(name: str) -> str:
    return "byte" if name == "octet" else name


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    return repr(value)
