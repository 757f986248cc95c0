"""Definitions as text in the format "ros2msg": a message, then each that it is made of, after a
separator and its name. Source: the MCAP format registry, and rosbag2's recordings. No I/O."""

from collections.abc import Callable, Iterator
from typing import Any, Final

from app.interfaces.definitions import Structure
from app.interfaces.type_hash import gathered

SEPARATOR: Final = "=" * 80


def definition_text(of: Structure, find: Callable[[str], Structure]) -> str:
    """The whole text; `find` gives the structures that it is made of."""
    inner = gathered(of, find)
    parts = [_own(of), *(f"{SEPARATOR}\nMSG: {_short(name)}\n{_own(inner[name])}" for name in inner)]
    return "".join(parts)


def _own(of: Structure) -> str:
    return "".join(f"{line}\n" for line in _lines(of))


def _lines(of: Structure) -> Iterator[str]:
    for name, value in of.constants.items():
        yield f"{_base(of.constant_types[name])} {name}={_literal(value)}"
    for one in of.fields:
        kind, name = str(one.type), one.type.name
        short = _short(name) if one.type.nested else _base(name)
        yield f"{short}{kind.removeprefix(name)} {one.name}"


def _short(name: str) -> str:
    """ "geometry_msgs/msg/Pose" → "geometry_msgs/Pose"."""
    package, _, message = name.split("/")
    return f"{package}/{message}"


def _base(name: str) -> str:
    return "byte" if name == "octet" else name


def _literal(value: Any) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return f'"{escaped}"'
    return repr(value)
