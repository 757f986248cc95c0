"""Text of robots, browsers and operators, made fit to be shown or written: the one place for this.

What hides, moves or forges text around it (control characters, marks and overrides of the writing
direction, line separators, halves of surrogate pairs) becomes its escape, which everybody can see; in
JSON it says the same.
Source: Unicode 16, general category Cc and property Bidi_Control; UTR 36, 2.10.
"""

import re
from collections.abc import Mapping
from typing import Any, Final

# Of the control characters tab and line feed stay: they do no harm on a page or between a CSV's quotes.
_HIDDEN: Final = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200e\u200f\u2028-\u202e\u2066-\u2069\ud800-\udfff]"
)


def printable(text: str) -> str:
    """The text with an escape, like `\\u202e`, for each character that must not be shown."""
    return _HIDDEN.sub(lambda found: f"\\u{ord(found[0]):04x}", text)


def printable_texts(values: Mapping[str, Any]) -> dict[str, str]:
    """Those of the values that are texts, made printable."""
    return {name: printable(text) for name, text in values.items() if isinstance(text, str)}
