"""The language of a response; nothing else decides it.

The cookie that a choice on the page sets goes before Accept-Language (RFC 9110, 12.5.4), and that
before the panel file's `language`. Only languages of the panel count.
"""

import re
from functools import lru_cache
from typing import Final

from babel.core import negotiate_locale

COOKIE: Final = "kiosk_language"
MOST_ACCEPTED: Final = 500  # characters of the header
_accepted: Final = re.compile(
    r"\s*(?P<tag>[A-Za-z]{1,8}(?:-[A-Za-z0-9]{1,8})*)\s*(?:;\s*q=(?P<weight>[01](?:\.[0-9]{1,3})?)\s*)?"
)


@lru_cache(maxsize=256)
def negotiated(chosen: str, accepted: str, available: tuple[str, ...]) -> str:
    """The available language that fits best; "" if none does. `chosen` and `accepted` are kept: cut
    them to `MOST_ACCEPTED`."""
    by_name = {tag.lower(): tag for tag in available}
    preferred = [*([chosen] if chosen else []), *_preferred(accepted)]
    language = negotiate_locale(preferred, available, sep="-")
    return by_name.get((language or "").lower(), "")


def _preferred(accepted: str) -> list[str]:
    """The tags of the header, by falling weight."""
    matches = [match for part in accepted.split(",") if (match := _accepted.fullmatch(part))]
    weighted = [(float(match["weight"] or 1), match["tag"]) for match in matches]
    return [
        tag for weight, tag in sorted(weighted, key=lambda weighted_tag: -weighted_tag[0]) if weight > 0
    ]
