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


def printable(text: str) -> str:
    """The text with an escape, such as `\\u202e`, for each character that must not be shown."""
    return _HIDDEN.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def printable_texts(values: Mapping[str, Any]) -> dict[str, str]:
    """The values that are texts, made printable."""
    return {name: printable(text) for name, text in values.items() if isinstance(text, str)}
