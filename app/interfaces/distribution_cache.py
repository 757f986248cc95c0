"""A file cache of a distribution's message definitions, for a faster start.

The file may be deleted at any time. A damaged file, or one of another version of rosbags or of this
format, is ignored.
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

FORMAT: Final = 1  # of `_pack` and `bundled_messages`

Messages = dict[str, Structure]


def read(folder: Path, distro: str) -> Messages | None:
    """The messages; None without a usable file."""
    try:
        head, _, body = _file(folder, distro).read_bytes().partition(b"\n")
    except OSError:
        return None
    return _unpack(json.loads(body)) if head == _header(distro, body) else None


def write(folder: Path, distro: str, messages: Messages) -> None:
    """Writes the file atomically, if the folder can be written."""
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
    """The first line: what the body is made of, and its hash."""
    made_of = f"{distro} of rosbags {version('rosbags')}, format {FORMAT}"
    return f"{made_of}, sha256 {sha256(body).hexdigest()}".encode()


def _pack(messages: Messages) -> Mapping[str, Any]:
    """Name → (fields, constants) as JSON values."""
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
