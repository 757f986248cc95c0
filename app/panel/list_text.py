"""Lists as an operator reads and enters them: values with commas between them.

A text with a comma, a quote or spaces around it stands in quotes, in which a quote is written twice.
"""

import re
from collections.abc import Iterable
from typing import Final

# No part can take what another one could: else a long text would be tried again and again.
_ELEMENT: Final = re.compile(r'(?:\s*"(?P<quoted>(?:[^"]|"")*)"\s*|(?P<plain>[^",]*))(?P<end>,|\Z)')
_PLAIN: Final = re.compile(r'[^\s",](?:[^",]*[^\s",])?')


def join_list(texts: Iterable[str]) -> str:
    """The elements as one text."""
    return ", ".join(texts)


def quote_element(text: str) -> str:
    """A text as an element."""
    return text if _PLAIN.fullmatch(text) else '"' + text.replace('"', '""') + '"'


def split_list(text: str) -> list[str]:
    """The elements of a text; ValueError where one is empty without quotes, or quotes don't match."""
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
