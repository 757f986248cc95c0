"""Paths to a field: "pose.position.x", "position[2]", "poses[0].position"."""

import re
from functools import lru_cache
from typing import Any, Final

from app.errors import FieldError, InterfaceError
from app.interfaces.definitions import attribute

_PART: Final = re.compile(r"([^\[\]]*)((?:\[[0-9]+\])*)")


@lru_cache(4096)
def steps(path: str) -> tuple[str | int, ...]:
    """The names and indexes that a path goes through; InterfaceError where it is not written so."""
    found: list[str | int] = []
    for part in path.split("."):
        match = _PART.fullmatch(part)
        if match is None:
            raise InterfaceError(f'"{path}" is not a field: it must be like pose.x or position[2]')
        found.append(match[1])
        found.extend(int(index) for index in re.findall("[0-9]+", match[2]))
    return tuple(found)


def value_at(message: Any, path: str) -> Any:
    """The value at a path of a decoded message: a number, a text, a message or a list.

    FieldError where a list is shorter than the path's index; the path must be one of the type's
    (`Interfaces.field_type` says).
    """
    at = message
    for step in steps(path):
        if isinstance(step, str):
            at = getattr(at, attribute(step))
        elif step < len(at):
            at = at[step]
        else:
            raise FieldError(path, f"there is no [{step}]: the list has {len(at)} elements now")
    return at
