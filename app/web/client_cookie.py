"""Which browser asks: a cookie that the server gives it, never in a path."""

import re
from dataclasses import dataclass
from typing import Final

from fastapi import Request
from fastapi.responses import Response
from starlette.requests import HTTPConnection

from app.permission.clients import TOKEN, anonymous, new_client, new_token
from app.permission.principal import Principal
from app.web.app_state import AppState

COOKIE: Final = "panel_browser"
KEPT_S: Final = 365 * 86_400
OTHER_SITES: Final = frozenset({"cross-site", "same-site"})


@dataclass(frozen=True, slots=True)
class Caller:
    """Who asks, as long as a connection lasts; `token` is "" without a cookie, or with none of ours."""

    token: str
    address: str

    def principal(self, state: AppState) -> Principal:
        """Who this is now; without a token an anonymous client."""
        if not self.token:
            return Principal(anonymous(self.address))
        return Principal(state.clients.identify(self.token, self.address))


def caller(request: HTTPConnection) -> Caller:
    token = request.cookies.get(COOKIE, "")
    address = request.client.host if request.client else ""
    return Caller(token if TOKEN.fullmatch(token) else "", address)


def visitor(request: HTTPConnection, state: AppState) -> Principal:
    """Who asks, by the cookie; without one, or with one that is not ours, an anonymous client."""
    return caller(request).principal(state)


def welcomed(request: Request, state: AppState) -> tuple[Principal, str]:
    """Who asks, and the token that their browser gets with the answer, "" where it has one.

    With a link on another site's page a browser does not send the cookie that it may have: it
    gets no second one: its next request has the first.
    """
    who = visitor(request, state)
    if who.client.id or request.headers.get("sec-fetch-site") in OTHER_SITES:
        return who, ""
    token = new_token()
    if by_hand(request):
        return Principal(state.clients.identify(token, who.client.address)), token
    return Principal(new_client(token, who.client.address)), token


def keep(response: Response, request: Request, token: str) -> Response:
    """The response, with the cookie where the browser gets one."""
    if token:
        response.set_cookie(
            COOKIE,
            token,
            max_age=KEPT_S,
            path="/",
            httponly=True,
            samesite="strict",
            secure=request.url.scheme == "https",
        )
    return response


def by_hand(request: Request) -> bool:
    """Whether a person opened this page: no program, and no browser that fetches ahead."""
    headers = request.headers
    ahead = re.search("prefetch|prerender", headers.get("sec-purpose", ""))
    return headers.get("sec-fetch-dest") == "document" and not ahead
