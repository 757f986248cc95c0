"""Reads a panel file as TOML; says what is wrong in a line that is not TOML."""

import hashlib
import re
import tomllib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Final

from app.system.errors import Fault, PanelError

# What is wrong in a line that is no TOML, in words that say what would be right.
#
# Python's reader only says what it did not expect. Here the line is compared with mistakes that people
# make who know JSON, YAML, Python or C, or who write a table's header with too few brackets.

Hint = tuple[int, str]  # (line from 1, message)

_HEADER: Final = re.compile(r"\s*(\[\[?)\s*([\w.\"-]+)\s*(\]*)\s*(?:#.*)?")
_PAIR: Final = re.compile(r"""\s*([\w."'-]+)\s*=\s*(.*?)\s*""")
_COLON: Final = re.compile(r"\s*([\w-]+)\s*:(\s.*)?")
_STRING: Final = re.compile(r'"(?:\\.|[^"\\])*"|\'[^\']*\'')
_CURLY: Final = re.compile("[“”„‟‘’‚«»「」]")
_DASH: Final = re.compile("[–—−]")
_WORDS: Final = {
    **dict.fromkeys(("True", "TRUE", "yes", "Yes", "on", "On", "On"), "true"),
    **dict.fromkeys(("False", "FALSE", "no", "No", "off", "Off"), "false"),
}
_NOTHING: Final = ("None", "null", "Null", "NULL", "nil", "undefined", "~")
_WORD: Final = re.compile(r"(?:^|[=\[{,]\s*)([A-Za-z_~][\w /.-]*?)\s*(?=$|[,\]}#])")


def hint(text: str, line: int, message: str) -> Hint | None:
    """The fault in `line` (from 1), of which Python's reader says `message`; None if it is none of the
    known ones. The line of the hint may be an earlier one, which caused it."""
    lines = text.splitlines()
    if text.lstrip().startswith("{"):
        return 1, 'this looks like JSON; a panel file is TOML, like title = "Cell"'
    if not 0 < line <= len(lines):
        return None
    if match := _open_hint(lines[:line], message):
        return match
    whole = lines[line - 1]
    if match := _header_hint(lines, line, message):
        return match
    for rule in _RULES:
        if words := rule(_outside_strings(whole), whole, message):
            return line, words
    return None


def _outside_strings(line: str) -> str:
    """The line with its whole texts blanked."""
    return _STRING.sub(lambda text: text[0][0] + "_" * (len(text[0]) - 2) + text[0][-1], line)


def _open_hint(lines: Sequence[str], message: str) -> Hint | None:
    """A list or a text over several lines that has no end: the line where it begins."""
    if message in ("Unclosed array", "Invalid value"):
        for number in range(len(lines) - (message == "Invalid value"), 0, -1):
            text = lines[number - 1]
            bare = _outside_strings(text).split("#")[0]
            if not _HEADER.fullmatch(text) and bare.count("[") > bare.count("]"):
                return number, f"the list has no closing ], or lacks a comma: {_shortened(text)}"
            if "]" in bare:
                break
    for quotes in ('"""', "'''"):
        if message in ("Unterminated string", f'Expected "{quotes}"'):
            for number, text in enumerate(lines, 1):
                if text.count(quotes) % 2:
                    return number, f"a text has no closing {quotes}: {_shortened(text)}"
    return None


def _header_hint(lines: Sequence[str], line: int, message: str) -> Hint | None:
    """Headers with wrong brackets, and tables or keys that are there twice."""
    header = _HEADER.fullmatch(lines[line - 1])
    if header is None:
        return _second_key(lines, line) if "overwrite" in message else None
    opening, name, closing = header.groups()
    if len(opening) != len(closing):
        several = "[[" if "[[" in (opening, closing.replace("]", "[")) else "["
        brackets = several + name + several.replace("[", "]")
        return line, f"the brackets of a header are the same on both sides: write {brackets}"
    earlier = [
        (number, match[1])
        for number, text in enumerate(lines[: line - 1], 1)
        if (match := _HEADER.fullmatch(text)) and match[2] == name
    ]
    if not earlier or not re.search("twice|overwrite|immutable", message):
        return None
    single = [number for number, kind in [*earlier, (line, opening)] if kind == "["]
    if any(kind == "[[" for _, kind in [*earlier, (line, opening)]):
        return single[0], f"[{name}] must be [[{name}]]: there are several"
    return line, f"[{name}] is above already, in line {earlier[0][0]}: write all its keys there"


def _second_key(lines: Sequence[str], line: int) -> Hint | None:
    pair = _PAIR.fullmatch(lines[line - 1])
    for number in range(line - 1, 0, -1) if pair else ():
        above = _PAIR.fullmatch(lines[number - 1])
        if above and pair and above[1] == pair[1]:
            return (
                line,
                f'"{pair[1]}" is above already, in line {number}: a key stands once in its table',
            )
        if _HEADER.fullmatch(lines[number - 1]):
            return None
    return None


Rule = Callable[[str, str, str], str]


def _comment(bare: str, _: str, __: str) -> str:
    sign = re.search(r"(?:^\s*|\s)(//|/\*|--|;)", bare)
    stands_for_comment = sign and (sign[1] != ";" or bare.lstrip().startswith(";"))
    return f"a comment begins with #, not {sign[1]}" if sign and stands_for_comment else ""


def _curly_quotes(bare: str, _: str, __: str) -> str:
    sign = _CURLY.search(bare)
    return f'{sign[0]} is no quotation mark of TOML: write "…"' if sign else ""


def _dash(bare: str, _: str, __: str) -> str:
    sign = _DASH.search(bare)
    return f"{sign[0]} is a dash: a negative number has -, as on the keyboard" if sign else ""


def _colon(bare: str, whole: str, _: str) -> str:
    match = _COLON.fullmatch(bare)
    if not match:
        return ""
    key, value = match[1], whole.split(":", 1)[1].strip()
    if not value:
        return f"a key and its value stand on one line with =: {key} = …"
    return f"a key has = after it, no colon: write {key} = {_as_value(value)}"


def _key_with_space(bare: str, _: str, __: str) -> str:
    match = re.match(r"\s*([A-Za-z]\w*(?: +\w+)+)\s*=", bare)
    return f"a key has no spaces: write {'_'.join(match[1].split())}" if match else ""


def _open_text(bare: str, whole: str, message: str) -> str:
    if "Illegal character" not in message and "Unterminated string" not in message:
        return ""
    quote = next((sign for sign in bare if sign in "\"'" and bare.count(sign) % 2), '"')
    return f"a text has no closing {quote}: {_shortened(whole)}"


def _backslash(_: str, __: str, message: str) -> str:
    known = "Unescaped" in message or "Invalid hex value" in message
    return r"a backslash in a text is written twice: \\" if known else ""


def _words(bare: str, whole: str, _: str) -> str:
    pair = _PAIR.fullmatch(bare.split("#")[0])
    if pair is None:
        return ""
    for match in _WORD.finditer(pair[2]):
        word = match[1]
        if word in _WORDS:
            return f"{word} is not a value of TOML: write {_WORDS[word]}"
        if word in _NOTHING:
            return f'{word} is not a value of TOML: leave out "{pair[1]}"'
        if word not in ("true", "false", "inf", "nan") and "=" not in pair[2].split(word, 1)[1][:2]:
            return f'a text stands in quotes: write "{word}"'
    return "" if pair[2] else f'"{pair[1]}" has no value: write one after =, or leave the line out'


def _number(bare: str, _: str, __: str) -> str:
    pair = _PAIR.fullmatch(bare.split("#")[0])
    value = pair[2] if pair else ""
    if re.fullmatch(r"[+-]?\d+,\d+", value):
        return f"a number has a point: write {value.replace(',', '.')}"
    if open_point := re.fullmatch(r"([+-]?)(\d*)\.(\d*)", value):
        sign, before, after = open_point.groups()
        return (
            f"a number has a digit before and after its point: write {sign}{before or 0}.{after or 0}"
        )
    if re.fullmatch(r"[+-]?0\d+(\.\d+)?", value):
        return f"a number has no 0 before it: write {value.replace('0', '', 1)}"
    return ""


def _after_value(bare: str, _: str, __: str) -> str:
    match = re.search(r"([;,])\s*(?:#.*)?$", bare)
    return f"nothing stands after a value: remove {match[1]}" if match and "=" in bare else ""


def _inline_table(bare: str, _: str, message: str) -> str:
    pair = _PAIR.fullmatch(bare)
    if re.search(r",\s*}", bare):
        return "no comma stands before }"
    if message == "Unclosed inline table" and bare.count("{") == bare.count("}"):
        return "a comma stands between the keys of a table in braces: { a = 1, b = 2 }"
    if message == "Unclosed array" and bare.count("[") == bare.count("]"):
        return "a comma stands between the values of a list: [1, 2]"
    if pair and bare.count("{") > bare.count("}"):
        return (
            f"a table in braces stands on one line: {pair[1]} = {{ … }}; a long one gets a header of "
            f"its own, like [page.widget.{pair[1]}]"
        )
    return ""


# The first that says something is reported.
_RULES: Final[tuple[Rule, ...]] = (
    _comment,
    _curly_quotes,
    _dash,
    _backslash,
    _open_text,
    _key_with_space,
    _colon,
    _inline_table,
    _number,
    _after_value,
    _words,
)


def _as_value(text: str) -> str:
    """A value as TOML writes it: a text in quotes, all else as it is."""
    is_value = re.fullmatch(r"true|false|[+-]?\d+(\.\d+)?|[\"'\[{].*", text)
    return text if is_value else f'"{text}"'


def _shortened(text: str, most: int = 60) -> str:
    text = text.strip()
    return text if len(text) <= most else f"{text[:most]}…"


# Reads a panel file as TOML.

AT_LINE: Final = re.compile(r"(.*) \(at (?:line ([0-9]+), column [0-9]+|end of document)\)", re.DOTALL)
NAMES: Final = re.compile(r"\(((?:'[^']*'(?:, |,)?)+)\)")
HEADER: Final = re.compile(r"\s*\[\[?\s*([a-zA-Z_.]+)\s*\]\]?\s*(?:#.*)?")
FREE_FORM_TABLES: Final = ("message", "request", "goal", "release")
TABLES: Final = (
    "access", "alarm", "alarms", "brand", "column", "condition", "confirm", "control", "counter",
    "current", "demo", "detail", "diagnostics", "embed", "font", "frame", "group", "help",
    "interlock", "joint", "lamp", "layer", "level", "line", "list", "log", "mqtt", "oee", "oidc",
    "options", "overview", "page", "pen", "place", "plan", "pose", "qos", "readback", "reason",
    "recipe", "record", "recovery", "reported", "robot", "robot_level", "routes", "screen",
    "setpoint", "site", "sort", "source", "state", "states", "steps", "target", "texts", "twist",
    "value", "when", "while", "widget", "x_axis", "y_axis", "zone", "zone_file",
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
    """A parsed file; `revision` is a hash of its bytes. `line_of` has the line of a place where it is
    known without the text."""

    path: Path
    text: str
    tables: dict[str, Any]
    revision: str
    line_of: Callable[[str], int] | None = None


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
