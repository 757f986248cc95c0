"""The messages of a distribution, as rosbags has them: to import this takes as long as a tenth of the
server's start, so it is done only where what was read before is not kept (`kept`)."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, Literal

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from app.interfaces.definitions import PLACEHOLDER, Field, Structure, Type

# Rolling is what the next distribution will be: it has the messages of the newest that rosbags knows.
ALIASES: Final[Mapping[str, str]] = {"rolling": "lyrical"}


def load_messages(distro: str) -> dict[str, Structure]:
    """By name, without defaults: rosbags drops them."""
    definitions = get_typestore(Stores(f"ros2_{ALIASES.get(distro, distro)}")).fielddefs
    return {name: _to_structure(name, definition) for name, definition in definitions.items()}


def _to_structure(name: str, definition: Any) -> Structure:
    """Out of rosbags' nested tuples: ([(name, type, value)…], [(field, type)…])."""
    constants, fields = definition
    return Structure(
        name,
        tuple(Field(each, _to_type(described)) for each, described in fields if each != PLACEHOLDER),
        {each: value for each, _, value in constants},
        constant_types={each: kind for each, kind, _ in constants},
    )


def _to_type(described: Any) -> Type:
    kind, detail = described
    if kind == Nodetype.NAME:
        return Type(detail)
    if kind == Nodetype.BASE:
        return Type(*detail)
    inner, size = detail
    container: Literal["array", "sequence"] = "array" if kind == Nodetype.ARRAY else "sequence"
    return replace(_to_type(inner), container=container, size=size)
