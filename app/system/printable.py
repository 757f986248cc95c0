"""Makes text of robots, browsers and operators safe to show and write.

Characters that hide, move or forge text (control characters, marks and overrides of the writing
direction, line separators, lone surrogates) become visible escapes, which are also valid in JSON.
Source: Unicode 16, general category Cc and property Bidi_Control; UTR 36, 2.10.
"""

import re
from collections.abc import Mapping
from typing import Any, Final

# Tab and line feed are kept: they are harmless on a page and in a quoted CSV field.
_HIDDEN: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


# What colours text on a terminal, moves its cursor or links it: CSI and OSC sequences, and the choice
# of a character set. Source: ECMA-48, 5.4 and 8.3.89; xterm's OSC.
_TERMINAL_CODE: Final = re.compile(
    "(?:\x1b\\[|\x9b)[0-?]*[ -/]*(?:[@-~]|\\Z)"
    "|\x1b\\][^\x07\x1b\n]{0,2000}(?:\x07|\x1b\\\\)"
    "|\x1b[()][0-9A-Z]"
)


def without_terminal_codes(text: str) -> str:
    """The text without the codes by which a terminal colours it."""
    return _TERMINAL_CODE.sub("", text) if "\x1b" in text or "\x9b" in text else text


def readable(text: str) -> str:
    """The text of a robot for people: printable, without the codes of terminals."""
    return printable(without_terminal_codes(text))


def printable(text: str) -> str:
    """The text with an escape, such as `\\u202e`, for each character that must not be shown."""
    return _HIDDEN.sub(lambda match: f"\\u{ord(match[0]):04x}", text)


def one_line(text: str, most: int | None = None) -> str:
    """`readable` without line breaks and tabs, of `most` characters: for text within a line."""
    shown = readable(text).replace("\n", "\\u000a").replace("\t", "\\u0009")
    return shown if most is None or len(shown) <= most else f"{shown[:most]}…"


def printable_texts(values: Mapping[str, Any]) -> dict[str, str]:
    """The values that are texts, made printable."""
    return {name: printable(text) for name, text in values.items() if isinstance(text, str)}
