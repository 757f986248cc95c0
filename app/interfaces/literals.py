"""Values in interface definitions: defaults and constants. No I/O.

Source: the ROS 2 interface definition language (design.ros2.org, "legacy_interface_definition"),
and what rosidl_adapter takes.
"""

import re
from typing import Any, Final

from app.errors import FieldError
from app.interfaces.definitions import FLOATS, INTEGERS, TEXTS, Type
from app.interfaces.scalars import scalar_check

BOOLS: Final = {"true": True, "1": True, "false": False, "0": False}
_QUOTED: Final = re.compile(r"""("(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*')\s*(?:#.*)?""")
_ELEMENT: Final = re.compile(r"""\s*("(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|[^,'"\s][^,]*?)\s*(,|$)""")
_LIST: Final = re.compile(r"""\[((?:"(?:[^"\\]|\\.)*"|'(?:[^'\\]|\\.)*'|[^#'"\]])*)\]\s*(?:#.*)?""")


def literal(kind: Type, text: str) -> Any:
    """The value written as `text`, which a comment may follow; ValueError says what is wrong."""
    if kind.nested:
        raise ValueError(f"{kind} takes no default: only base types do")
    if kind.many != "one":
        return _list(kind, text)
    quoted = _QUOTED.fullmatch(text) if kind.name in TEXTS else None
    return _value(kind, quoted[1] if quoted else text.partition("#")[0].strip())


def _list(kind: Type, text: str) -> list[Any]:
    match = _LIST.fullmatch(text)
    if match is None:
        raise ValueError(f"{text} is not a list: the default of {kind} must be like [1, 2]")
    values = [_value(kind.element, one) for one in _elements(match[1])]
    if kind.many == "array" and len(values) != kind.size:
        raise ValueError(f"{kind} needs {kind.size} elements, not {len(values)}")
    if kind.size and len(values) > kind.size:
        raise ValueError(f"{kind} takes {kind.size} elements at most, not {len(values)}")
    return values


def _elements(inside: str) -> list[str]:
    found: list[str] = []
    at = 0
    while inside[at:].strip():
        match = _ELEMENT.match(inside, at)
        if match is None:
            raise ValueError(f"[{inside}] is not a list of values with commas between them")
        found.append(match[1])
        at = match.end()
    return found


def _value(kind: Type, text: str) -> Any:
    value = _read(kind.name, text)
    if value is None:
        raise ValueError(f"{text or 'nothing'} is not a value of {kind}")
    try:
        return scalar_check(kind)(value)
    except FieldError as error:
        raise ValueError(f"{text}: {error.message}") from None


def _read(name: str, text: str) -> Any:
    """The value, whether or not it is in range; None where it is not written as one."""
    if name == "bool":
        return BOOLS.get(text.lower())
    if name in TEXTS:
        return _unquoted(text)
    try:
        if name in INTEGERS:
            return _integer(text)
        assert name in FLOATS
        return float(text)
    except ValueError:
        return None


def _integer(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        return int(text, 0)


def _unquoted(text: str) -> str:
    """Without the quotes around it, if it has any; an escaped quote inside is the quote alone."""
    if len(text) > 1 and text[0] in "\"'" and text[-1] == text[0]:
        return text[1:-1].replace("\\" + text[0], text[0])
    return text
