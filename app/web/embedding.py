"""Whether a page is shown in a frame of another page, and what it may do there.

A page in a frame has `embed=1` in its query: put there by the page around it, or by a redirect where
the browser says that a frame asks (Sec-Fetch-Dest, over HTTPS and on localhost). Only such a page may
be framed. Browsers name it as the referrer of what it requests, so its presses are known too.
"""

from typing import Final
from urllib.parse import parse_qsl, urlsplit

from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.types import Scope

from app.panel.rules import EmbedRules

QUERY: Final = "embed"
FRAMES: Final = frozenset({"iframe", "frame", "embed", "object", "fencedframe"})


def is_embedded(request: HTTPConnection) -> bool:
    """Whether a page is asked for that a frame shows. One that is opened by itself is not such a page,
    whatever it comes from."""
    headers = request.headers
    if headers.get("sec-fetch-dest") == "document":
        return says_embedded(request.url.query)
    return headers.get("sec-fetch-dest") in FRAMES or from_frame(request.scope)


def from_frame(scope: Scope) -> bool:
    """Whether a request comes from a page in a frame."""
    headers = Headers(scope=scope)
    # Browsers send `Sec-Fetch-Storage-Access` where a page is in a frame of another site.
    if headers.get("sec-fetch-dest") in FRAMES or "sec-fetch-storage-access" in headers:
        return True
    try:
        referrer = urlsplit(headers.get("referer", "")).query
    except ValueError:
        referrer = ""
    return says_embedded(scope.get("query_string", b"").decode("latin-1")) or says_embedded(referrer)


def says_embedded(query: str) -> bool:
    return (QUERY, "1") in parse_qsl(query)


def only_shows(rules: EmbedRules, embedded: bool) -> bool:
    """Whether a page may not press."""
    return embedded and bool(rules.origins) and not rules.controls


def frame_ancestors(rules: EmbedRules, embedded: bool) -> str:
    """The sources of a page's `frame-ancestors`."""
    return " ".join(rules.origins) if embedded and rules.origins else "'none'"
