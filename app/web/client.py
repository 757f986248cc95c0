"""Who a client is to the server: its cookie, the frame around its page, and the confirmation of its
press."""

import re
from dataclasses import dataclass, field, replace
from typing import Any, Final, TypeVar
from urllib.parse import parse_qsl, urlsplit

from fastapi import Request
from fastapi.responses import Response
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.types import Scope

from app.cell.commands.press import Press, fingerprint
from app.cell.people.confirmer import Question
from app.cell.permission.client_places import client_key
from app.cell.session.session import RobotSession
from app.panel.rules import EmbedRules
from app.panel.template import needed_inputs
from app.panel.widgets.families import Command
from app.panel.widgets.key_parts import confirmation_of
from app.records.principal import TOKEN, Client, Principal, anonymous, new_client, new_token
from app.system.errors import NotFound
from app.web.app_state import AppState, site_of

# The client of a request, by a cookie that the server sets, and its session, by another. No token is in
# a path.

COOKIE: Final = "panel_browser"
SESSION: Final = "panel_session"
BEARER: Final = re.compile(r"Bearer +(?P<token>[A-Za-z0-9._~+/-]{1,200}=*) *", re.IGNORECASE)
KEPT_S: Final = 365 * 86_400
OTHER_SITES: Final = frozenset({"cross-site", "same-site"})


@dataclass(frozen=True, slots=True)
class Caller:
    """The client of a connection; `token` is "" without a valid cookie, `session` the id of a session,
    `bearer` the token of a program, "" without them."""

    token: str
    address: str
    session: str = field(default="", repr=False)
    bearer: str = field(default="", repr=False)

    def principal(self, state: AppState) -> Principal:
        """The principal at this moment; an anonymous one without a token."""
        return state.access.principal(self.client(state), self.session, self.bearer)

    def signed_in_since(self, state: AppState) -> bool:
        """Whether somebody has signed in at this browser since the connection began, which then has
        not the cookie of that session."""
        session = state.access.sessions.of_client(self.client(state).id) if self.token else None
        return session is not None and session.id != self.session

    def client(self, state: AppState) -> Client:
        if not self.token:
            return anonymous(self.address)
        return state.clients.identify(self.token, self.address)


def caller(request: HTTPConnection) -> Caller:
    cookies = request.cookies
    token = cookies.get(client_cookie(request)) or cookies.get(COOKIE, "")
    address = request.client.host if request.client else ""
    session = cookies.get(session_cookie(request), "")
    own = token if TOKEN.fullmatch(token) else ""
    return Caller(own, address, session, bearer_of(request.headers.get("authorization", "")))


def bearer_of(authorization: str) -> str:
    """The token of a program in the header Authorization; "" without one."""
    match = BEARER.fullmatch(authorization)
    return match["token"] if match else ""


def session_cookie(request: HTTPConnection) -> str:
    """The name of the cookie of a session."""
    return _bound(SESSION, request)


def client_cookie(request: HTTPConnection) -> str:
    """The name of the cookie of a client. A browser that has one without the prefix, of a version
    before or of HTTP, keeps its token and gets the other."""
    return _bound(COOKIE, request)


def _bound(name: str, request: HTTPConnection) -> str:
    """A cookie's name. Over HTTPS its prefix binds it to this host (RFC 6265bis); below a root path to
    HTTPS only, as another panel may be at the same host."""
    if request.url.scheme not in ("https", "wss"):
        return name
    return f"__Secure-{name}" if site_of(request).root else f"__Host-{name}"


def client_of(connection: HTTPConnection) -> str:
    """The client of a connection by its address, for limits."""
    return client_key(connection.client.host if connection.client else "")


def principal_of(request: HTTPConnection, state: AppState) -> Principal:
    """The client of a request, by its cookie; an anonymous one without a valid cookie."""
    return caller(request).principal(state)


def principal_with_new_token(
    request: Request, state: AppState, embedded: bool = False
) -> tuple[Principal, str]:
    """The client of a request, and the token to set with the response, "" if it needs none.

    A browser that follows a link from another site does not send its cookie. It gets no second one,
    since its next request has the first. One that shows a page in a frame (`embedded`) would keep none.
    """
    who = principal_of(request, state)
    if who.client.id and client_cookie(request) not in request.cookies and not embedded:
        return who, caller(request).token
    if who.client.id or embedded or request.headers.get("sec-fetch-site") in OTHER_SITES:
        return who, ""
    token = new_token()
    if opened_by_person(request):
        client = state.clients.identify(token, who.client.address)
    else:
        client = new_client(token, who.client.address)
    return state.access.principal(client, bearer=caller(request).bearer), token


def set_client_cookie(response: Response, request: Request, token: str) -> Response:
    """The response, with the cookie if `token` is not ""."""
    if token:
        response.set_cookie(
            client_cookie(request),
            token,
            max_age=KEPT_S,
            path=site_of(request).root or "/",
            httponly=True,
            samesite="strict",
            secure=request.url.scheme == "https",
        )
    return response


def set_session_cookie(response: Response, request: Request, session_id: str) -> Response:
    """The response, with the cookie of a session, which the browser drops when it ends. "" drops it
    now."""
    response.set_cookie(
        session_cookie(request),
        session_id,
        max_age=None if session_id else 0,
        path=site_of(request).root or "/",
        httponly=True,
        samesite="strict",
        secure=request.url.scheme == "https",
    )
    return response


def opened_by_person(request: Request) -> bool:
    """Whether a person opened this page, not a program or a browser that prefetches."""
    headers = request.headers
    prefetch = re.search("prefetch|prerender", headers.get("sec-purpose", ""))
    return headers.get("sec-fetch-dest") == "document" and not prefetch


# Whether a page is shown in a frame of another page, and what it may do there.
#
# A page in a frame has `embed=1` in its query: put there by the page around it, or by a redirect where
# the browser says that a frame asks (Sec-Fetch-Dest, over HTTPS and on localhost). Only such a page may
# be framed. Browsers name it as the referrer of what it requests, so its presses are known too.

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


# Presses that a person confirms: the question at a browser, and what a press has of its answer.

LONGEST_TOKEN: Final = 64

Widget = TypeVar("Widget", bound=Command)


def confirmed(state: AppState, who: Caller, press: Press[Widget], token: str) -> Press[Widget]:
    """The press, with who confirmed it, if the token is a confirmation of just this press."""
    if not token or not confirmation_of(press.widget):
        return press
    inputs = inputs_of(press.widget, press.inputs)
    by = state.confirmer.take(token, who.session, press.widget.id, inputs)
    return replace(press, confirmed=by)


def confirmed_command(session: RobotSession, widget: str) -> Command:
    """The command with this id that a person confirms; NotFound for every other id."""
    for command in session.panel.commands:
        if command.id == widget and confirmation_of(command):
            return command
    raise NotFound(f'there is no widget "{widget:.64}" that a person confirms')


def question_of(state: AppState, command: Command, inputs: dict[str, Any]) -> Question:
    """What a person confirms of a press with these inputs."""
    needs = state.fleet.panel.needs.commands.get(command.id, frozenset())
    return Question(command.id, inputs_of(command, inputs), confirmation_of(command), needs)


def inputs_of(command: Command, inputs: Any) -> str:
    """The fingerprint of the inputs that a press of the command takes."""
    return fingerprint(needed_inputs(command, inputs))
