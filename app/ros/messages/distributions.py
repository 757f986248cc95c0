"""The interfaces of a ROS 2 distribution, from `builtin/`: messages from a file that `make_builtin`
writes; services, actions and further packages as ROS has them."""

import json
from functools import cache, lru_cache
from pathlib import Path
from typing import Final

from app.ros.messages.definitions import Definitions, Field, Structure, Type
from app.ros.messages.packages import complete_definitions, read_folders

DISTROS: Final = ("humble", "iron", "jazzy", "kilted", "lyrical", "rolling")

BUILTIN: Final = Path(__file__).parent / "builtin"
MESSAGES: Final = BUILTIN / "messages.json"


@cache
def read_distribution(distro: str) -> Definitions:
    """The definitions of one of `DISTROS`."""
    messages = Definitions(_read_messages(distro))
    return complete_definitions(_packages(), messages) | messages


@cache
def _packages() -> Definitions:
    return read_folders([BUILTIN])


def _read_messages(distro: str) -> dict[str, Structure]:
    """Name → structure. The file has rows of (distributions, name, fields, constants), a field being
    (name, default, attributes of its type), a constant (base type, name, value)."""
    kind = lru_cache(None)(Type)
    return {
        name: Structure(
            name,
            tuple(Field(each, kind(*parts), default) for each, default, *parts in fields),
            {each: value for _, each, value in constants},
            constant_types={each: base for base, each, _ in constants},
        )
        for distros, name, fields, constants in json.loads(MESSAGES.read_bytes())
        if distro in distros
    }
