"""Reads a panel file as TOML."""

import hashlib
import re
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

from app.errors import Fault, PanelError
from app.panel.faults.toml_hints import hint

AT_LINE: Final = re.compile(r"(.*) \(at (?:line ([0-9]+), column [0-9]+|end of document)\)", re.DOTALL)
NAMES: Final = re.compile(r"\(((?:'[^']*'(?:, |,)?)+)\)")
HEADER: Final = re.compile(r"\s*\[\[?\s*([a-zA-Z_.]+)\s*\]\]?\s*(?:#.*)?")
FREE_FORM_TABLES: Final = ("message", "request", "goal", "release")
TABLES: Final = (
    "log", "control", "record", "demo", "robot", "source", "interlock", "alarm", "alarms",
    "diagnostics", "page", "group", "frame", "brand", "state", "detail", "widget", "qos", "confirm",
    "options", "states",
    *FREE_FORM_TABLES,
)  # fmt: skip
TABLE_SIMILARITY: Final = 0.8
# Messages of Python's TOML reader about duplicate keys and tables → plainer ones.
PLAIN_MESSAGES: Final[Mapping[str, str]] = {
    "Cannot overwrite a value": "this key or table is above already, perhaps as another kind of table",
    "Cannot mutate immutable namespace": "nothing can be added to what is whole already:",
}


@dataclass(frozen=True, slots=True)
class TomlFile:
    """A parsed file; `revision` is a hash of its bytes."""

    path: Path
    text: str
    tables: dict[str, Any]
    revision: str


def read_toml(path: Path) -> TomlFile:
    """The parsed file; PanelError (`unreadable`) with the line if it is no TOML."""
    try:
        data = path.read_bytes()
    except OSError as error:
        raise PanelError(str(path), (_read_fault(error),), unreadable=True) from error
    return parse_toml(path, data)


def parse_toml(path: Path, data: bytes) -> TomlFile:
    """The same, of a file that has these bytes."""
    try:
        text = data.decode("utf-8-sig")  # some editors begin a file with a mark
        tables = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        fault = _read_fault(error)
        if isinstance(error, tomllib.TOMLDecodeError):
            fault = _misspelt_header(text) or _hint(text, error) or fault
        raise PanelError(str(path), (fault,), unreadable=True) from error
    return TomlFile(path, text, tables, hashlib.sha256(data).hexdigest()[:12])


def _misspelt_header(text: str) -> Fault | None:
    """A fault of the first header that is similar to a known one. Its keys count as those of another
    table, so that the parser's error is far from it."""
    for number, line in enumerate(text.splitlines(), 1):
        header = HEADER.fullmatch(line)
        for part in header[1].split(".") if header else ():
            if part in FREE_FORM_TABLES:
                break  # the tables of a message are not known here
            meant = get_close_matches(part, TABLES, n=1, cutoff=TABLE_SIMILARITY)
            if meant and meant[0] != part:
                message = f'there is no table "{part}"; did you mean "{meant[0]}"?'
                return Fault("", message, line=number)
    return None


def _hint(text: str, error: tomllib.TOMLDecodeError) -> Fault | None:
    match = AT_LINE.fullmatch(str(error))
    if match is None:
        return None
    last = len(text.splitlines())
    known = hint(text, int(match[2] or last), match[1])
    return Fault("", known[1], line=known[0]) if known else None


def _read_fault(error: Exception) -> Fault:
    match error:
        case OSError(strerror=str(reason)):
            return Fault("", reason)
        case UnicodeDecodeError(object=data, start=at):
            line = data.count(b"\n", 0, at) + 1
            return Fault("", f"byte {data[at]:#04x} is not UTF-8: save the file as UTF-8", line=line)
        case tomllib.TOMLDecodeError():
            return _syntax_fault(str(error))
        case RecursionError():
            return Fault("", "it has too many brackets in brackets")
    return Fault("", "a number has too many digits")  # the only other ValueError of Python's reader


def _syntax_fault(text: str) -> Fault:
    """The fault of a syntax error, with the names of tables as in the file."""
    match = AT_LINE.fullmatch(text)
    message, line = (match[1], match[2]) if match else (text, None)
    for theirs, plainer in PLAIN_MESSAGES.items():
        message = message.replace(theirs, plainer)
    message = NAMES.sub(lambda names: ".".join(re.findall("'([^']*)'", names[1])), message)
    return Fault("", message if line else f"{message}, at the end of the file", line=int(line or 0))
