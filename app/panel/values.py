"""Formats and compares values of a panel file; lists as text: elements separated by commas. An element
with a comma, a quote or enclosing spaces is quoted; a quote inside is doubled."""

import re
from collections.abc import Iterable
from typing import Any, Final

# No two parts match the same text: a long text causes no backtracking.
_ELEMENT: Final = re.compile(r'(?:\s*"(?P<quoted>(?:[^"]|"")*)"\s*|(?P<plain>[^",]*))(?P<end>,|\Z)')
_PLAIN: Final = re.compile(r'[^\s",](?:[^",]*[^\s",])?')


def number_text(number: float) -> str:
    """A number as in a panel file and in HTML: "5", "0.25", "1e-07"."""
    return str(int(number)) if number.is_integer() else repr(number)


def same_value(value: Any, other: Any) -> bool:
    """Whether two values are equal in TOML and JSON: 1 equals 1.0, but not true."""
    return value == other and isinstance(value, bool) == isinstance(other, bool)


def join_list(texts: Iterable[str]) -> str:
    """The elements joined to one text."""
    return ", ".join(texts)


def quote_element(text: str) -> str:
    """A text as an element, quoted if necessary."""
    return text if _PLAIN.fullmatch(text) else '"' + text.replace('"', '""') + '"'


def split_list(text: str) -> list[str]:
    """The elements of a text; ValueError for an empty element without quotes, or unmatched quotes."""
    elements: list[str] = []
    at = 0
    more = bool(text.strip())
    while more:
        match = _ELEMENT.match(text, at)
        plain, quoted = ("", None) if match is None else match.group("plain", "quoted")
        if match is None or (quoted is None and not plain.strip()):
            raise ValueError(f"the {len(elements) + 1}. of them is none")
        elements.append(plain.strip() if quoted is None else quoted.replace('""', '"'))
        at, more = match.end(), match["end"] == ","
    return elements


class NegatedText(str):
    """The text of `"-{id}"`, which in a field of numbers is the negative of the input's number."""

    number: float

    def item(self) -> float:
        """The number, as scalars of array libraries give theirs."""
        return self.number


def negated(value: float) -> NegatedText:
    """The negative of an input's number."""
    text = NegatedText(f"-{value}")
    text.number = -value
    return text
