"""The message definitions of a distribution, from rosbags. Importing this module is slow, so it is done
only if the cache (`distribution_cache`) has none."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, Final, Literal

from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore

from app.interfaces.definitions import PLACEHOLDER, Field, Structure, Type

# Rolling uses the messages of the newest distribution that rosbags knows.
ALIASES: Final[Mapping[str, str]] = {"rolling": "lyrical"}


def load_messages(distro: str) -> dict[str, Structure]:
    """Name → structure, without default values: rosbags drops them."""
    definitions = get_typestore(Stores(f"ros2_{ALIASES.get(distro, distro)}")).fielddefs
    return {name: _to_structure(name, definition) for name, definition in definitions.items()}


def _to_structure(name: str, definition: Any) -> Structure:
    """A structure from rosbags' nested tuples: ([(name, type, value)…], [(field, type)…])."""
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
