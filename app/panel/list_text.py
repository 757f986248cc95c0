"""Lists as text: values separated by commas.

A text with a comma, a quote or enclosing spaces is quoted; a quote inside is doubled.
"""

import re
from collections.abc import Iterable
from typing import Final

# No two parts match the same text: a long text causes no backtracking.
_ELEMENT: Final = re.compile(r'(?:\s*"(?P<quoted>(?:[^"]|"")*)"\s*|(?P<plain>[^",]*))(?P<end>,|\Z)')
_PLAIN: Final = re.compile(r'[^\s",](?:[^",]*[^\s",])?')


def join_list(texts: Iterable[str]) -> str:
    """The elements joined to one text."""
    return ", ".join(texts)


def quote_element(text: str) -> str:
    """A text as an element, quoted if necessary."""
    return text if _PLAIN.fullmatch(text) else '"' + text.replace('"', '""') + '"'


def split_list(text: str) -> list[str]:
    """The elements of a text; ValueError for an empty element without quotes, or unmatched quotes."""
    found: list[str] = []
    at = 0
    more = bool(text.strip())
    while more:
        match = _ELEMENT.match(text, at)
        plain, given = ("", None) if match is None else match.group("plain", "quoted")
        if match is None or (given is None and not plain.strip()):
            raise ValueError(f"the {len(found) + 1}. of them is none")
        found.append(plain.strip() if given is None else given.replace('""', '"'))
        at, more = match.end(), match["end"] == ","
    return found
