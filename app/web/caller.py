"""Who asks: the client of a request or WebSocket, with its cookies, its language and its frame; and the
confirmation of its press."""

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import cached_property
from typing import Any, Final, TypeVar
from urllib.parse import parse_qsl, urlsplit

from fastapi.responses import Response
from starlette.datastructures import Headers, MutableHeaders
from starlette.requests import HTTPConnection, cookie_parser
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.cell.commands.press import Press, fingerprint
from app.cell.people.confirmer import Question
from app.cell.people.sessions import Session
from app.cell.permission.client_places import client_key
from app.cell.session.session import RobotSession
from app.panel.rules import EmbedRules
from app.panel.template import needed_inputs
from app.panel.widgets.families import Command
from app.panel.widgets.key_parts import confirmation_of
from app.records.principal import TOKEN, Client, Principal, anonymous, new_client, new_token
from app.system.errors import NotFound
from app.web.app_state import AppState
from app.web.language import COOKIE as LANGUAGE_COOKIE
from app.web.language import MOST_ACCEPTED, negotiated
from app.web.pages.display_choice import DisplaySettings, display_of

# A client is known by a cookie that the server sets, and its session by another. No token is in a path.

SCOPE: Final = "panel.caller"
COOKIE: Final = "panel_browser"
SESSION: Final = "panel_session"
BEARER: Final = re.compile(r"Bearer +(?P<token>[A-Za-z0-9._~+/-]{1,200}=*) *", re.IGNORECASE)
KEPT_S: Final = 365 * 86_400
OTHER_SITES: Final = frozenset({"cross-site", "same-site"})
SECURE: Final = frozenset({"https", "wss"})
# A page in a frame has `embed=1` in its query: put there by the page around it, or by a redirect where
# the browser says that a frame asks (Sec-Fetch-Dest, over HTTPS and on localhost). Only such a page may
# be framed. Browsers name it as the referrer of what it requests, so its presses are known too.
QUERY: Final = "embed"
FRAMES: Final = frozenset({"iframe", "frame", "embed", "object", "fencedframe"})


class Caller:
    """Who asks. Made once for a request or a WebSocket; each part is read when it is first needed. What
    may change while a connection is open, such as who is signed in, is that of this moment."""

    def __init__(self, scope: Scope) -> None:
        # Not the scope itself, which has this: no reference cycle is made for each request.
        self._app: Any = scope.get("app")
        self._query: str = scope.get("query_string", b"").decode("latin-1")
        self.is_secure = scope.get("scheme", "http") in SECURE
        self.headers = Headers(scope=scope)
        self.address: str = scope["client"][0] if scope.get("client") else ""

    @property
    def state(self) -> AppState:
        """The state of the application, which is there from the end of the startup on."""
        state: AppState = self._app.state.app_state
        return state

    @cached_property
    def key(self) -> str:
        """The client by its address, for limits."""
        return client_key(self.address)

    @cached_property
    def cookies(self) -> Mapping[str, str]:
        return cookie_parser("; ".join(self.headers.getlist("cookie")))

    @cached_property
    def token(self) -> str:
        """The token of the client's cookie; "" without a valid one."""
        token = self.cookies.get(self._bound(COOKIE)) or self.cookies.get(COOKIE, "")
        return token if TOKEN.fullmatch(token) else ""

    @cached_property
    def session_id(self) -> str:
        """The id of a session; "" without one."""
        return self.cookies.get(self._bound(SESSION), "")

    @cached_property
    def bearer(self) -> str:
        """The token of a program in the header Authorization; "" without one."""
        match = BEARER.fullmatch(self.headers.get("authorization", ""))
        return match["token"] if match else ""

    @property
    def client(self) -> Client:
        """The client; an anonymous one without a valid cookie."""
        if not self.token:
            return anonymous(self.address)
        return self.state.clients.identify(self.token, self.address)

    @property
    def principal(self) -> Principal:
        """Who asks at this moment."""
        return self.state.access.principal(self.client, self.session_id, self.bearer)

    @property
    def session(self) -> Session | None:
        """The session of the user who is signed in; None for no one."""
        return self.state.access.sessions.get(self.session_id, self.client.id)

    @property
    def signed_in_since(self) -> bool:
        """Whether somebody has signed in at this browser since the connection began, which then has
        not the cookie of that session."""
        session = self.state.access.sessions.of_client(self.client.id) if self.token else None
        return session is not None and session.id != self.session_id

    @cached_property
    def language(self) -> str:
        """The language of the response, one of the panel's."""
        panel = self.state.fleet.panel
        language, available = panel.language, panel.readers_languages
        if len(available) > 1:
            chosen, accepted = (
                self.cookies.get(LANGUAGE_COOKIE, "")[:MOST_ACCEPTED],
                self.headers.get("accept-language", "")[:MOST_ACCEPTED],
            )
            language = negotiated(chosen, accepted, available) or language
        return language

    @property
    def spoken(self) -> str:
        """The language, if the response has been written in it; else ""."""
        return self.language if "language" in vars(self) else ""

    @property
    def display(self) -> DisplaySettings:
        """The look of this browser's pages."""
        return display_of(self.cookies, self.state.fleet.panel)

    @property
    def accepts_html(self) -> bool:
        return "text/html" in self.headers.get("accept", "")

    @property
    def accepts_gzip(self) -> bool:
        return "gzip" in self.headers.get("accept-encoding", "")

    @property
    def opened_by_person(self) -> bool:
        """Whether a person opened this page, not a program or a browser that prefetches."""
        prefetch = re.search("prefetch|prerender", self.headers.get("sec-purpose", ""))
        return self.headers.get("sec-fetch-dest") == "document" and not prefetch

    @property
    def embedded(self) -> bool:
        """Whether a page is asked for that a frame shows. One that is opened by itself is not such a
        page, whatever it comes from."""
        if self.headers.get("sec-fetch-dest") == "document":
            return says_embedded(self._query)
        return self.from_frame

    @property
    def from_frame(self) -> bool:
        """Whether a request comes from a page in a frame."""
        # Browsers send `Sec-Fetch-Storage-Access` where a page is in a frame of another site.
        if self.headers.get("sec-fetch-dest") in FRAMES or "sec-fetch-storage-access" in self.headers:
            return True
        try:
            referrer = urlsplit(self.headers.get("referer", "")).query
        except ValueError:
            referrer = ""
        return says_embedded(self._query) or says_embedded(referrer)

    def identified(self, embedded: bool = False) -> tuple[Principal, str]:
        """Who asks, and the token to set with the response, "" if it needs none.

        A browser that follows a link from another site does not send its cookie. It gets no second one,
        since its next request has the first. One that shows a page in a frame (`embedded`) would keep
        none. One that has a cookie without the prefix, of a version before or of HTTP, keeps its token
        and gets the other.
        """
        who = self.principal
        if who.client.id and self._bound(COOKIE) not in self.cookies and not embedded:
            return who, self.token
        if who.client.id or embedded or self.headers.get("sec-fetch-site") in OTHER_SITES:
            return who, ""
        token, address = new_token(), who.client.address
        if self.opened_by_person:
            client = self.state.clients.identify(token, address)
        else:
            client = new_client(token, address)
        return self.state.access.principal(client, bearer=self.bearer), token

    def with_client_cookie(self, response: Response, token: str) -> Response:
        """The response, with the cookie of the client if `token` is not ""."""
        return self._with_cookie(response, COOKIE, token, KEPT_S) if token else response

    def with_session_cookie(self, response: Response, session_id: str) -> Response:
        """The response, with the cookie of a session, which the browser drops when it ends. "" drops
        it now."""
        return self._with_cookie(response, SESSION, session_id, None if session_id else 0)

    def _with_cookie(self, response: Response, name: str, value: str, max_age: int | None) -> Response:
        response.set_cookie(
            self._bound(name),
            value,
            max_age=max_age,
            path=self.state.root or "/",
            httponly=True,
            samesite="strict",
            secure=self.is_secure,
        )
        return response

    def _bound(self, name: str) -> str:
        """A cookie's name. Over HTTPS its prefix binds it to this host (RFC 6265bis); below a root path
        to HTTPS only, as another panel may be at the same host."""
        if not self.is_secure:
            return name
        return f"__Secure-{name}" if self.state.root else f"__Host-{name}"


def caller_of(connection: HTTPConnection) -> Caller:
    """Who asks by a request or WebSocket."""
    return caller_in(connection.scope)


def caller_in(scope: Scope) -> Caller:
    """Who asks, by the scope of a request or WebSocket: made by the first layer that needs it."""
    caller: Caller | None = scope.get(SCOPE)
    if caller is None:
        caller = scope[SCOPE] = Caller(scope)
    return caller


class LanguageHeaders:
    """Sets Content-Language and Vary on each response whose language was negotiated (RFC 9110, 8.5 and
    12.5.5)."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        async def said(message: Message) -> None:
            if message["type"] == "http.response.start" and (language := caller_in(scope).spoken):
                headers = MutableHeaders(scope=message)
                headers["content-language"] = language
                headers.add_vary_header("Accept-Language, Cookie")
            await send(message)

        await self._app(scope, receive, said if scope["type"] == "http" else send)


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
    by = state.confirmer.take(token, who.session_id, press.widget.id, inputs)
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
