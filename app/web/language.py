"""In which language a reader is answered: the one place for this.

The browser's cookie, which a choice on the page sets, counts before its settings (Accept-Language, RFC
9110, 12.5.4), and these before the panel file's `language`. Only a language with a catalogue counts.
"""

import re
from functools import lru_cache
from typing import Final

from babel.core import negotiate_locale
from starlette.requests import HTTPConnection

from app.i18n.catalogue import files
from app.web.app_state import site_of

COOKIE: Final = "kiosk_language"
MOST_ACCEPTED: Final = 500  # characters of the header
_accepted: Final = re.compile(
    r"\s*(?P<tag>[A-Za-z]{1,8}(?:-[A-Za-z0-9]{1,8})*)\s*(?:;\s*q=(?P<weight>[01](?:\.[0-9]{1,3})?)\s*)?"
)


def language_of(connection: HTTPConnection) -> str:
    """The language of who reads the answer: that of a catalogue."""
    usual = site_of(connection).fleet.panel.language
    if len(files()) == 1:
        return usual
    given = connection.headers.get("accept-language", "")[:MOST_ACCEPTED]
    return negotiated(connection.cookies.get(COOKIE, ""), given, tuple(files())) or usual


@lru_cache(maxsize=256)
def negotiated(chosen: str, accepted: str, available: tuple[str, ...]) -> str:
    """The language with a catalogue that suits best; "" where none does."""
    by_name = {tag.lower(): tag for tag in available}
    preferred = [*([chosen] if chosen else []), *_preferred(accepted)]
    found = negotiate_locale(preferred, available, sep="-")
    return by_name.get((found or "").lower(), "")


def _preferred(accepted: str) -> list[str]:
    """The tags of the header, the most wanted first."""
    found = [match for one in accepted.split(",") if (match := _accepted.fullmatch(one))]
    weighted = [(float(match["weight"] or 1), match["tag"]) for match in found]
    return [tag for weight, tag in sorted(weighted, key=lambda one: -one[0]) if weight > 0]
