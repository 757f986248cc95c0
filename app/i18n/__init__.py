"""What a person reads: sentences by their codes, the one place to translate.

Codes are stable names for tests and logs; `say` fills in what the sentence is about.
"""

from app.i18n.en import ENGLISH
from app.printable import printable

__all__ = ["ENGLISH", "say"]


def say(code: str, **about: object) -> str:
    """The sentence for `code`, filled in; a KeyError is a mistake of the programmer's."""
    return printable(ENGLISH[code].format(**about))
