"""The checks of Host, Origin and Sec-Fetch-Site, and the security headers.

Only the panel's own names and its own pages are allowed. Pure ASGI, so that the event stream passes
through without a task of its own. The checks use what browsers send with every request: Host (DNS
rebinding), Origin and Sec-Fetch-Site (requests made by other sites' pages).
"""

import re
from collections.abc import Iterable
from typing import Final
from urllib.parse import urlsplit

from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import JSONResponse, PlainTextResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.cell.permission.client_limits import RATE_LIMITS, RateLimit
from app.panel.rules import EmbedRules
from app.system.printable import printable
from app.system.texts import render, say
from app.web.assets import PAGE_GUARD_HASH
from app.web.caller import Caller, caller_in, only_shows
from app.web.root_path import path_of

# Read by the panel's own pages only.
GUARDED: Final = re.compile(
    r"(/robots/[^/]+)?/(events|widgets/[^/]+/(frame|lines|lock|map(\.png|/.*)))/?"
)
# Asked by a browser before Foxglove reads a recording that was shared with it.
PREFLIGHTED: Final = re.compile(r"/recordings/shared/[^/]+")
STARTS: Final = frozenset({"http.response.start", "websocket.http.response.start"})
POLICY_VIOLATION: Final = 1008
READING: Final = frozenset({"GET", "HEAD"})
SECURE: Final = frozenset({"https", "wss"})
HOST: Final = re.compile(r"(?P<name>\[[0-9a-f:.]+\]|[a-z0-9._-]+)(:\d{1,5})?")
PROXY: Final = (
    ", but the panel was reached by HTTP: a proxy with TLS sends X-Forwarded-Proto, and KIOSK_PROXIES "
    "names it"
)
NO_FRAMES: Final = EmbedRules()
OWN_SITE: Final = frozenset({"same-origin", "none"})


def content_security_policy(ancestors: str = "'none'", forms: str = "'self'") -> str:
    """The policy of a page; `ancestors` may show it in a frame."""
    return (
        f"default-src 'none'; script-src 'self' {PAGE_GUARD_HASH}; style-src 'self'; "
        "img-src 'self' data:; font-src 'self'; "
        f"connect-src 'self'; form-action {forms}; base-uri 'none'; frame-ancestors {ancestors}"
    )


FOR_ALL: Final = {
    "x-content-type-options": "nosniff",
    "cross-origin-resource-policy": "same-origin",
}
# Over HTTPS: from then on a browser asks this host by HTTPS only, for a year.
ONLY_HTTPS: Final = {"strict-transport-security": "max-age=31536000"}
POLICY: Final = "content-security-policy"
SECURITY_HEADERS: Final = FOR_ALL | {
    POLICY: content_security_policy(),
    # Not "no-referrer": with it browsers send "Origin: null" with the panel's own form posts.
    "referrer-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
}
# The others are about documents: with these they would be a tenth of a page's bytes.
NO_DOCUMENTS: Final = ("text/css", "text/javascript", "text/event-stream")


class RequestGuard:
    """Refuses with 403 before anything is read; adds the security headers to what goes out."""

    def __init__(self, app: ASGIApp, hosts: Iterable[str], embed: EmbedRules = NO_FRAMES) -> None:
        self._app = app
        self._hosts = frozenset(hosts)
        self._embed = embed

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return

        why = self._refusal(scope)
        if why is None:
            await self._app(scope, receive, secured(send, scope["scheme"] in SECURE))
        else:
            await refuse(JSONResponse({"error": printable(why)}, status_code=403), scope, receive, send)

    def _refusal(self, scope: Scope) -> str | None:
        headers = Headers(scope=scope)
        host = ",".join(headers.getlist("host")).lower()  # two are none of its names
        if _without_port(host) not in self._hosts:
            return f'"{host}" is not a name of this panel: KIOSK_HOSTS lists the names it answers to'
        if (
            scope["type"] == "http"
            and scope["method"] in READING
            and not GUARDED.fullmatch(path_of(scope))
        ):
            return None
        if scope.get("method") == "OPTIONS" and PREFLIGHTED.fullmatch(path_of(scope)):
            return None
        for site in headers.getlist("sec-fetch-site"):
            if site not in OWN_SITE:
                return f"a page of another site ({site}) asked for this"
        scheme = "https" if scope["scheme"] in SECURE else "http"
        for origin in headers.getlist("origin"):
            if (parts := _parts_of(origin)) != (scheme, host):
                hint = PROXY if parts == ("https", host) else ""
                return f'a page of "{origin}" asked for this{hint}'
        if moves(scope) and only_shows(self._embed, caller_in(scope).from_frame):
            return "a page in a frame asked for this: open the panel itself"
        return None


def moves(scope: Scope) -> bool:
    """Whether a request may move something: a post, or a socket that does not only read."""
    if scope["type"] == "websocket":
        return not path_of(scope).endswith("/frames")
    return scope["method"] not in READING


def secured(send: Send, is_https: bool = False) -> Send:
    """`send` with the security headers."""
    for_all = FOR_ALL | (ONLY_HTTPS if is_https else {})
    for_documents = SECURITY_HEADERS | for_all

    async def send_secured(message: Message) -> None:
        if message["type"] in STARTS:
            headers = MutableHeaders(scope=message)
            document = not headers.get("content-type", "").startswith(NO_DOCUMENTS)
            for name, value in (for_documents if document else for_all).items():
                headers.setdefault(name, value)
        await send(message)

    return send_secured


async def refuse(answer: Response, scope: Scope, receive: Receive, send: Send) -> None:
    """Answers a request, or the opening of a WebSocket, which is closed where the server can't."""
    if scope["type"] == "websocket":
        await receive()  # its connection request
        if "websocket.http.response" not in scope.get("extensions", {}):
            await send({"type": "websocket.close", "code": POLICY_VIOLATION, "reason": ""})
            return
    await answer(scope, receive, secured(send))


def _parts_of(origin: str) -> tuple[str, str] | None:
    """The scheme and the host of an origin."""
    try:
        parts = urlsplit(origin)
    except ValueError:
        return None
    return parts.scheme, parts.netloc.lower()


def _without_port(host: str) -> str | None:
    """`localhost:8000` → `localhost`; an IPv6 address keeps its brackets; None if it is no host."""
    match = HOST.fullmatch(host)
    return match["name"] if match else None


# Refuses the requests of programs whose token is not known or makes too many, before anything else
# reads them. Pure ASGI, for WebSockets too.

CHALLENGE: Final = {"www-authenticate": 'Bearer realm="operator-panel", error="invalid_token"'}


def too_many(caller: Caller, limit: RateLimit) -> Response:
    """The answer over a limit, a sentence: to render a page would take the time that is saved."""
    sentence, again_s = render(say(limit.sentence), caller.language), limit.retry_after_s
    headers = {"retry-after": str(again_s), "cache-control": "no-store"}
    if caller.accepts_html:
        return PlainTextResponse(sentence, 429, headers | {"refresh": str(2 * again_s)})
    return JSONResponse({"error": sentence}, 429, headers)


def unknown(caller: Caller) -> Response:
    """The answer to a token that the panel does not know."""
    return JSONResponse({"error": render(say("token_unknown"), caller.language)}, 401, CHALLENGE)


class BearerGuard:
    """Lets requests without a token through, and all of a panel without users."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] in ("http", "websocket"):
            caller = caller_in(scope)
            if caller.bearer and (access := caller.state.access).configured:
                known = access.knows(caller.bearer)
                if not known or not access.admit_token(caller.bearer):
                    limit = RATE_LIMITS["token_requests"]
                    answer = too_many(caller, limit) if known else unknown(caller)
                    await refuse(answer, scope, receive, send)
                    return
        await self._app(scope, receive, send)
