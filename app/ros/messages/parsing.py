"""Parses the text of .msg, .srv and .action files. No I/O.

Source: the ROS 2 interface definition language (design.ros2.org, "legacy_interface_definition").
"""

import re
from pathlib import Path
from typing import Any, Final, Literal, NoReturn

from app.ros.messages.definitions import (
    BASE_TYPES,
    FLOAT_TYPES,
    INTEGER_RANGES,
    STRING_TYPES,
    Definitions,
    Field,
    Structure,
    Type,
)
from app.ros.messages.derived import compose_action, compose_service
from app.ros.messages.validation import scalar_check
from app.system.errors import FieldError, InterfaceError

PACKAGE: Final = re.compile(r"[a-z](?:_?[a-z0-9])*")
MESSAGE: Final = re.compile(r"[A-Z][A-Za-z0-9]*")
FIELD: Final = re.compile(r"[a-z](?:_?[a-z0-9])*")
CONSTANT: Final = re.compile(r"[A-Z](?:_?[A-Z0-9])*")

_LINE: Final = re.compile(r"(?P<type>\S+)\s+(?P<name>\w+)(?:\s*(?P<is>=)\s*|\s+|(?=#)|$)(?P<value>.*)")
_TYPE: Final = re.compile(
    r"(?P<name>[A-Za-z][\w/]*)(?:<=(?P<bound>[0-9]+))?(?:\[(?P<most><=)?(?P<size>[0-9]*)\])?"
)
_OLD_NAMES: Final = {
    "time": "builtin_interfaces/msg/Time",
    "duration": "builtin_interfaces/msg/Duration",
}
SEPARATOR: Final = "---"
KINDS: Final = ("msg", "srv", "action")

Line = tuple[int, str]


def parse_definition(text: str, package: str, kind: str, name: str, source: Path) -> Definitions:
    """The definitions of one file; `kind` is its suffix: "msg", "srv" or "action".

    A service or an action yields all types that ROS derives from it. InterfaceError names file and
    line.
    """
    if not PACKAGE.fullmatch(package):
        raise InterfaceError(f'{source}: "{package}" is not a package name: a-z, 0-9 and "_"', source)
    if not MESSAGE.fullmatch(name):
        why = "is not an interface name: letters and digits, a capital first"
        raise InterfaceError(f'{source}: "{name}" {why}', source)
    whole = f"{package}/{kind}/{name}"
    sections = _split_sections(text)
    wanted = KINDS.index(kind) + 1
    if len(sections) != wanted:
        why = f'has {len(sections) - 1} "{SEPARATOR}" lines; a .{kind} file has {wanted - 1}'
        raise InterfaceError(f"{source}: {why}", source)
    if kind == "msg":
        return Definitions({whole: _parse_structure(whole, sections[0], source)})
    endings = ("Request", "Response") if kind == "srv" else ("Goal", "Result", "Feedback")
    parts = [
        _parse_structure(f"{whole}_{ending}", lines, source)
        for ending, lines in zip(endings, sections, strict=True)
    ]
    return compose_service(whole, *parts) if kind == "srv" else compose_action(whole, *parts)


def _split_sections(text: str) -> list[list[Line]]:
    """The numbered lines without blank ones and comments, split at the separators."""
    sections: list[list[Line]] = [[]]
    for number, line in enumerate(text.removeprefix("\ufeff").splitlines(), 1):
        line = line.strip()
        if line == SEPARATOR:
            sections.append([])
        elif line and not line.startswith("#"):
            sections[-1].append((number, line))
    return sections


def _parse_structure(name: str, lines: list[Line], source: Path) -> Structure:
    fields: dict[str, Field] = {}
    constants: dict[str, Any] = {}
    types: dict[str, str] = {}
    for number, line in lines:
        try:
            match = _LINE.fullmatch(line) or _fail(f'"{line}" is not "type name"')
            kind = _parse_type(match["type"], name.split("/")[0])
            each, value = match["name"], match["value"]
            if each in fields or each in constants:
                _fail(f'"{each}" is there twice')
            if match["is"]:
                constants[each] = _parse_constant(kind, each, value)
                types[each] = kind.name
            else:
                fields[each] = _parse_field(kind, each, value)
        except ValueError as error:
            raise InterfaceError(f"{source}:{number}: {error}", source) from None
    return Structure(name, tuple(fields.values()), constants, source, types)


def _parse_constant(kind: Type, name: str, value: str) -> Any:
    if kind.is_nested or kind.container != "one":
        _fail(f"a constant is of a base type, not {kind}")
    if not CONSTANT.fullmatch(name):
        _fail(f'"{name}" is not a constant\'s name: A-Z, 0-9 and single "_"')
    return parse_literal(kind, value)


def _parse_field(kind: Type, name: str, value: str) -> Field:
    if not FIELD.fullmatch(name):
        _fail(f'"{name}" is not a field\'s name: a-z, 0-9 and single "_", a letter first')
    default = value if value and not value.startswith("#") else None
    return Field(name, kind, None if default is None else parse_literal(kind, default))


def _parse_type(text: str, package: str) -> Type:
    match = _TYPE.fullmatch(text) or _fail(f'"{text}" is not a type')
    name, bound, size = match["name"], match["bound"], match["size"]
    if name not in BASE_TYPES or name == "octet":
        name = _OLD_NAMES.get(name) or _full_name(name, package)
    if bound is not None and (name not in STRING_TYPES or not int(bound)):
        _fail(f'"{text}": only a string has a bound, of 1 at least')
    if size and not int(size):
        _fail(f'"{text}": a list has 1 element at least')
    if match["most"] and not size:
        _fail(f'"{text}": after "<=" stands how many at most')
    many: Literal["one", "array", "sequence"] = "sequence"
    if size is None or (size and not match["most"]):
        many = "one" if size is None else "array"
    return Type(name, int(bound or 0), many, int(size or 0))


def _full_name(name: str, package: str) -> str:
    """ "Pose" and "geometry_msgs/Pose" in a definition → "geometry_msgs/msg/Pose"."""
    *before, last = name.split("/")
    named = MESSAGE.fullmatch(last.partition("_")[0]) and all(map(PACKAGE.fullmatch, before))
    if named and len(before) < 3:
        where = before if len(before) == 2 else [*(before or [package]), "msg"]
        return "/".join([*where, last])
    return _fail(f'"{name}" is not a type: a base type, Name, or package/Name')


def _fail(why: str) -> NoReturn:
    raise ValueError(why)


BOOLS: Final = {"true": True, "1": True, "false": False, "0": False}
_QUOTED: Final = re.compile(r"""("(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')\s*(?:#.*)?""")
_ELEMENT: Final = re.compile(r"""\s*("(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|[^,'"\s][^,]*?)\s*(,|$)""")
_LIST: Final = re.compile(r"""\[((?:"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|[^#'"\]])*)\]\s*(?:#.*)?""")


def parse_literal(kind: Type, text: str) -> Any:
    """The value of a literal, which a comment may follow; ValueError if it is malformed."""
    if kind.is_nested:
        raise ValueError(f"{kind} takes no default: only base types do")
    if kind.container != "one":
        return _parse_list(kind, text)
    quoted = _QUOTED.fullmatch(text) if kind.name in STRING_TYPES else None
    return _parse_value(kind, quoted[1] if quoted else text.partition("#")[0].strip())


def _parse_list(kind: Type, text: str) -> list[Any]:
    match = _LIST.fullmatch(text)
    if match is None:
        raise ValueError(f"{text} is not a list: the default of {kind} must be like [1, 2]")
    values = [_parse_value(kind.element, element) for element in _split_elements(match[1])]
    if kind.container == "array" and len(values) != kind.size:
        raise ValueError(f"{kind} needs {kind.size} elements, not {len(values)}")
    if kind.size and len(values) > kind.size:
        raise ValueError(f"{kind} takes {kind.size} elements at most, not {len(values)}")
    return values


def _split_elements(inside: str) -> list[str]:
    parts: list[str] = []
    at = 0
    while inside[at:].strip():
        match = _ELEMENT.match(inside, at)
        if match is None:
            raise ValueError(f"[{inside}] is not a list of values with commas between them")
        parts.append(match[1])
        at = match.end()
    return parts


def _parse_value(kind: Type, text: str) -> Any:
    value = _parse_scalar(kind.name, text)
    if value is None:
        raise ValueError(f"{text or 'nothing'} is not a value of {kind}")
    try:
        return scalar_check(kind)(value)
    except FieldError as error:
        raise ValueError(f"{text}: {error.message}") from None


def _parse_scalar(name: str, text: str) -> Any:
    """The value, without a check of its range; None if the text is malformed."""
    if name == "bool":
        return BOOLS.get(text.lower())
    if name in STRING_TYPES:
        return _unquote(text)
    try:
        if name in INTEGER_RANGES:
            return _parse_integer(text)
        assert name in FLOAT_TYPES
        return float(text)
    except ValueError:
        return None


def _parse_integer(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        return int(text, 0)


def _unquote(text: str) -> str:
    """The text without enclosing quotes, if any; escaped quotes inside are unescaped."""
    if len(text) > 1 and text[0] in "\"'" and text[-1] == text[0]:
        return text[1:-1].replace("\\" + text[0], text[0])
    return text
