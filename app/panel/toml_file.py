"""A panel file as it stands on the disk: its text and its tables, or why it is no TOML."""

import hashlib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from app.errors import Fault, PanelError

AT_LINE: Final = re.compile(r"(.*) \(at (?:line ([0-9]+), column [0-9]+|end of document)\)", re.DOTALL)
NAMES: Final = re.compile(r"\(((?:'[^']*'(?:, |,)?)+)\)")
# What Python's reader says of a key or a table that is there twice, in plainer words.
PLAINER: Final[Mapping[str, str]] = {
    "Cannot overwrite a value": "this key or table is above already, perhaps as another kind of table",
    "Cannot mutate immutable namespace": "nothing can be added to what is whole already:",
}


@dataclass(frozen=True, slots=True)
class TomlFile:
    """`revision` changes with the file's bytes."""

    path: Path
    text: str
    tables: dict[str, Any]
    revision: str


def read_toml(path: Path) -> TomlFile:
    """PanelError, `unreadable`, with the line where it is no TOML."""
    try:
        data = path.read_bytes()
        text = data.decode("utf-8-sig")  # some editors begin a file with a mark
        tables = tomllib.loads(text)
    except (OSError, ValueError, RecursionError) as error:
        raise PanelError(str(path), (_unreadable(error),), unreadable=True) from error
    return TomlFile(path, text, tables, hashlib.sha256(data).hexdigest()[:12])


def _unreadable(error: Exception) -> Fault:
    match error:
        case OSError(strerror=str(reason)):
            return Fault("", reason)
        case UnicodeDecodeError(object=data, start=at):
            line = data.count(b"\n", 0, at) + 1
            return Fault("", f"byte {data[at]:#04x} is not UTF-8: save the file as UTF-8", line=line)
        case tomllib.TOMLDecodeError():
            return _no_toml(str(error))
        case RecursionError():
            return Fault("", "it has too many brackets in brackets")
    return Fault("", "a number has too many digits")  # the one other ValueError of Python's reader


def _no_toml(said: str) -> Fault:
    """What Python's reader said, with the names of tables as the file has them."""
    found = AT_LINE.fullmatch(said)
    what, line = (found[1], found[2]) if found else (said, None)
    for theirs, plainer in PLAINER.items():
        what = what.replace(theirs, plainer)
    what = NAMES.sub(lambda names: ".".join(re.findall("'([^']*)'", names[1])), what)
    return Fault("", what if line else f"{what}, at the end of the file", line=int(line or 0))
