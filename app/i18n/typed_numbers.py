"""Numbers that a person typed, pasted or scanned, in the notation of the reader's language.

One rule: a text is a number only if it is what the panel writes for that number, up to thousands
separators, trailing zeros, a plus sign and the width of its characters. Anything else is refused:
nothing is left out and nothing is guessed. `static/js/number-text.js` has the same rule.
"""

import re
from collections.abc import Mapping
from decimal import Decimal
from functools import cache
from math import isfinite
from typing import Final

from app.i18n.locales import MINUS, symbols

LONGEST: Final = 40  # characters
MAX_EXACT: Final = 2**53  # whole numbers up to here are exact in a browser
AROUND: Final = " \t\r\n\N{NO-BREAK SPACE}\N{IDEOGRAPHIC SPACE}"
# Separators of thousands that look alike: a keyboard has only one of each.
ALIKE: Final = ("\N{NARROW NO-BREAK SPACE}\N{NO-BREAK SPACE} ", "\N{RIGHT SINGLE QUOTATION MARK}'")
_PLAIN: Final = re.compile(
    r"([-+]?)((?:0|[1-9][0-9]*|[1-9][0-9]{0,2}(?:,[0-9]{3})+)(?:\.[0-9]+)?(?:e[-+][0-9]{2,3})?)",
    re.ASCII,
)
_WHOLE: Final = re.compile(r"(-?[0-9]+)(?:\.0+)?", re.ASCII)
# A comma that may separate thousands or values: "1,234".
_UNCLEAR: Final = re.compile(r"[0-9],[0-9]{3}(?![0-9])", re.ASCII)


def read_number(text: str, language: str, *, whole: bool = False) -> int | float | None:
    """The number that the text is in this language, None if it is not one; `whole`: a whole number, of
    any size. Otherwise an int is exact in a browser too."""
    plain = _plain(text, language)
    if plain is None:
        return None
    if whole:
        match = _WHOLE.fullmatch(plain)
        return int(match[1]) if match else None
    value = float(plain)
    if not isfinite(value) or not _is_shown_as(value, plain):
        return None
    return int(value) if value.is_integer() and abs(value) <= MAX_EXACT else value


def read_numbers(text: str, language: str, *, whole: bool = False) -> list[int | float | str]:
    """The numbers of a list; an element that is not a number is returned as its text."""
    separator = list_separator(language)
    if not text.strip(AROUND):
        return []
    if separator == "," and _UNCLEAR.search(text):
        return [text]
    elements = (element.strip(AROUND) for element in text.split(separator))
    read = ((element, read_number(element, language, whole=whole)) for element in elements)
    return [element if number is None else number for element, number in read]


def list_separator(language: str) -> str:
    """What separates the numbers of a list: a semicolon where the comma is the decimal sign."""
    return ";" if symbols(language).decimal == "," else ","


def _is_shown_as(value: float, plain: str) -> bool:
    shown = repr(value)
    return plain == shown if "e" in plain else Decimal(plain) == Decimal(shown)


def _plain(text: str, language: str) -> str | None:
    """The text in Python's notation, with all of its digits."""
    text = text.strip(AROUND)
    if len(text) > LONGEST:
        return None
    match = _PLAIN.fullmatch(text.translate(_signs(language)))
    if match is None:
        return None
    return match[1].replace("+", "") + match[2].replace(",", "")


@cache
def _signs(language: str) -> Mapping[int, str]:
    """What each character stands for; a separator of another language stands for none."""
    own = symbols(language)
    plain = {own.decimal: ".", MINUS: "-"}
    for sign in next((signs for signs in ALIKE if own.group in signs), own.group):
        plain.setdefault(sign, ",")
    signs = {sign: plain.get(sign, "?") for sign in ".,"} | plain
    digits = {sign: sign for sign in "0123456789+-"}
    wide = {chr(ord(sign) + 0xFEE0): read for sign, read in (signs | digits).items() if sign < "~"}
    return {ord(sign): read for sign, read in (wide | signs).items()}
