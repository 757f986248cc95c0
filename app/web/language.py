"""The language of a response; nothing else decides it.

The cookie that a choice on the page sets goes before Accept-Language (RFC 9110, 12.5.4), and that
before the panel file's `language`. Only languages of the panel count.
"""

import re
from functools import lru_cache
from typing import Final

from babel.core import negotiate_locale
from starlette.datastructures import MutableHeaders
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.web.app_state import site_of

SCOPE: Final = "panel.language"  # of the answer, in its scope
STARTS: Final = frozenset({"http.response.start"})
COOKIE: Final = "kiosk_language"
MOST_ACCEPTED: Final = 500  # characters of the header
_accepted: Final = re.compile(
    r"\s*(?P<tag>[A-Za-z]{1,8}(?:-[A-Za-z0-9]{1,8})*)\s*(?:;\s*q=(?P<weight>[01](?:\.[0-9]{1,3})?)\s*)?"
)


def language_of(connection: HTTPConnection) -> str:
    """The language of the response to a request, one of the panel's."""
    panel = site_of(connection).fleet.panel
    available = panel.readers_languages
    language = panel.language
    if len(available) > 1:
        accepted = connection.headers.get("accept-language", "")[:MOST_ACCEPTED]
        language = negotiated(connection.cookies.get(COOKIE, ""), accepted, available) or language
    connection.scope[SCOPE] = language
    return language


class LanguageHeaders:
    """Sets Content-Language and Vary on each response whose language was negotiated (RFC 9110, 8.5 and
    12.5.5)."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def said(message: Message) -> None:
            if message["type"] in STARTS and SCOPE in scope:
                headers = MutableHeaders(scope=message)
                headers["content-language"] = scope[SCOPE]
                headers.add_vary_header("Accept-Language, Cookie")
            await send(message)

        await self._app(scope, receive, said if scope["type"] == "http" else send)


@lru_cache(maxsize=256)
def negotiated(chosen: str, accepted: str, available: tuple[str, ...]) -> str:
    """The available language that fits best; "" if none does."""
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
