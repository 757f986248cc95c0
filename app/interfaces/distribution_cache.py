"""A distribution's messages, kept in a file: read at the first start, they are at hand at the next.

The file is made on the user's machine and may be deleted at any time. One that is damaged, or of
another version of rosbags or of this format, is as good as none.
"""

import json
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import astuple
from functools import lru_cache
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Any, Final

from app.interfaces.definitions import Field, Structure, Type

FORMAT: Final = 1  # of `_packed`, and of what `stock` makes

Messages = dict[str, Structure]


def read(folder: Path, distro: str) -> Messages | None:
    """The messages, or None where nothing is kept that can be used."""
    try:
        head, _, body = _file(folder, distro).read_bytes().partition(b"\n")
    except OSError:
        return None
    return _unpack(json.loads(body)) if head == _header(distro, body) else None


def write(folder: Path, distro: str, messages: Messages) -> None:
    """Keeps them, where the folder can be written; a reader finds the old file or the new one."""
    body = json.dumps(_pack(messages), separators=(",", ":")).encode()
    file = _file(folder, distro)
    aside = file.with_suffix(".new")
    with suppress(OSError):
        folder.parent.mkdir(parents=True, exist_ok=True)
        folder.mkdir(mode=0o700, exist_ok=True)
        aside.write_bytes(_header(distro, body) + b"\n" + body)
        aside.replace(file)


def _file(folder: Path, distro: str) -> Path:
    return folder / f"messages-{distro}.json"


def _header(distro: str, body: bytes) -> bytes:
    """What the first line says of the rest."""
    made_of = f"{distro} of rosbags {version('rosbags')}, format {FORMAT}"
    return f"{made_of}, sha256 {sha256(body).hexdigest()}".encode()


def _pack(messages: Messages) -> Mapping[str, Any]:
    """Name → its fields and its constants, as JSON has them."""
    return {
        name: [
            [[one.name, *astuple(one.type)] for one in message.fields],
            [[each, message.constant_types[each], value] for each, value in message.constants.items()],
        ]
        for name, message in messages.items()
    }


def _unpack(packed: Mapping[str, Any]) -> Messages:
    kind = lru_cache(None)(Type)
    return {
        name: Structure(
            name,
            tuple(Field(each, kind(*described)) for each, *described in fields),
            {each: value for each, _, value in constants},
            constant_types={each: of for each, of, _ in constants},
        )
        for name, (fields, constants) in packed.items()
    }
