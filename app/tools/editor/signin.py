"""Who edits from another machine: engineers sign in at the editor's own page, and its log has them.

The users are in a folder that the editor only reads; what it keeps of them is in its state folder.
"""

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from logging.handlers import RotatingFileHandler
from pathlib import Path
from shlex import quote
from typing import Any, Final

from fastapi import FastAPI, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.datastructures import Headers
from starlette.requests import HTTPConnection
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from app.cell.people.access import Access, Attempt, EndReason
from app.cell.people.secrets_hash import LONGEST, Way
from app.cell.people.sessions import Session
from app.cell.people.users import LONGEST_NAME, User, UsersError
from app.cell.people.users_file import UsersFile
from app.panel.roles import ENGINEER
from app.panel.rules import AccessRules
from app.records.entry import Entry, Origin
from app.records.log import RefusalQuota
from app.records.principal import Client, anonymous, new_client, new_token, public_id
from app.system.concurrency import keep_running
from app.system.errors import InputError, SettingsError, TooMany, os_error_text
from app.system.texts import ENGLISH, TextLike, localized, render, say
from app.tools.editor.session import Saved
from app.web.assets import FONTS
from app.web.requests import form_of
from app.web.security import POLICY_VIOLATION, refuse

log = logging.getLogger("kiosk.editor")

PERSON: Final = "editor.person"  # in the scope
USERS: Final = "users"  # the folder of the users, in the state folder
LOG: Final = "editor.log"
MOST_LOG_BYTES: Final = 1_000_000
IDLE_S: Final = 3600.0
SIGN_IN: Final = "/sign-in"
SIGN_OUT: Final = "/sign-out"
STATIC: Final = "/static/"
SIGNED_OUT: Final = 401
WAIT: Final = 429
LONGEST_FORM: Final = 4000  # bytes
NOT_KEPT: Final = {"cache-control": "no-store"}
WAYS: Final[dict[Way, TextLike]] = {"password": say("signin_password"), "pin": say("signin_pin")}
WORDS: Final = {
    "title": say("editor_sign_in_title"),
    "about": say("editor_sign_in_about"),
    "name": say("signin_name"),
    "way": say("editor_sign_in_way"),
    "secret": say("signin_password"),
    "either": say("editor_sign_in_either"),
    "sign_in": say("signin_sign_in"),
}
# Renders the page: (language, variables of the template) → HTML.
Renderer = Callable[[Request, dict[str, Any]], str]


def check_engineer(folder: Path, host: str) -> None:
    """SettingsError if no engineer of this folder's users can sign in from another machine."""
    file = UsersFile(folder)
    try:
        book = file.read()
    except (UsersError, OSError) as error:
        why = render(error.text) if isinstance(error, UsersError) else os_error_text(error)
        raise SettingsError(f"{file.path}: {why}") from error
    if not any(_may_edit(user) and user.password for user in book.engineers):
        raise SettingsError(
            f"to listen on {host}, beyond this machine, the editor needs an engineer who signs in with"
            " a password. Add one: operator-panel users add NAME --role engineer --password-stdin"
            f" --data {quote(str(folder))}"
        )


def _may_edit(user: User | None) -> bool:
    return user is not None and user.role == ENGINEER and not user.disabled


class PeopleLog:
    """The file that says who signed in, saved and sent. An `AccessLog`; full, it begins again, with the
    one before kept."""

    def __init__(self, folder: Path) -> None:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._quota = RefusalQuota()
        self._handler = RotatingFileHandler(
            folder / LOG, maxBytes=MOST_LOG_BYTES, backupCount=1, encoding="utf-8", delay=True
        )
        self._handler.setFormatter(logging.Formatter("%(message)s"))
        self._file = logging.Logger("editor.people")
        self._file.addHandler(self._handler)

    def add(self, entry: Entry) -> None:
        for summary in self._quota.summary_due():
            self._write(summary.address, summary.reason)
        self._write(entry.address, entry.reason)

    def allowed(self, origin: Origin) -> bool:
        return self._quota.allowed(origin)

    def suppress(self, origin: Origin, limited: bool = False) -> None:
        self._quota.suppress(origin, limited)

    async def closed(self, entry: Entry) -> TextLike:
        if entry.outcome == "refused":
            self._quota.count(entry)
        self.add(entry)
        return ""

    def saved(self, person: str, saved: Saved) -> None:
        backup = saved.backup.name if saved.backup else "-"
        self._write("", say("editor_log_saved", name=person, backup=backup))

    def sent(self, person: str, kiosk: str) -> None:
        self._write("", say("editor_log_sent", name=person, kiosk=kiosk))

    def close(self) -> None:
        self._handler.close()

    def _write(self, address: str, text: TextLike) -> None:
        at = datetime.now(UTC).isoformat(timespec="seconds")
        self._file.warning("%s", " ".join(filter(None, (at, address, render(text)))))


@dataclass(frozen=True, slots=True)
class SignedIn:
    """An engineer at a browser."""

    session: Session
    name: str


class SignIn:
    """The engineers of one editor and their sessions. Used on the event loop only."""

    def __init__(self, users: Path, state: Path, port: int) -> None:
        """`users` is the folder of the users' file, `state` that of what is kept."""
        self.log = PeopleLog(state)
        rules = AccessRules(open=False, idle_s=IDLE_S)
        self.access = Access(UsersFile(users), rules, self.log, state=state)
        self.cookie = f"panel_editor_user_{port}"
        self._ended: dict[str, asyncio.Event] = {}
        self.access.on_end(self._end)

    async def start(self) -> "asyncio.Task[None]":
        """Reads the users, and follows their changes until the task is cancelled."""
        await self.access.reload()
        return keep_running(self.access.watch, log, "following the users failed")

    def close(self) -> None:
        self.access.close()
        self.log.close()

    def signed_in(self, connection: HTTPConnection) -> SignedIn | None:
        """The engineer who is signed in at a browser now; None for no one."""
        token, _, session_id = connection.cookies.get(self.cookie, "").partition(".")
        session = self.access.sessions.get(session_id, public_id(token)) if session_id else None
        user = self.access.book.user(session.user) if session else None
        return SignedIn(session, user.name) if session and user and _may_edit(user) else None

    async def sign_in(self, client: Client, attempt: Attempt) -> tuple[Session | None, TextLike, int]:
        """Signs an engineer in; else why not, and the status of the answer."""
        try:
            verdict, session = await self.access.sign_in(client, attempt)
        except TooMany as error:
            return None, error.text, WAIT
        if session is None:
            reason: TextLike = verdict.reason
            if verdict.tries_left:
                reason = say("signin_tries_left", why=reason, count=verdict.tries_left)
            return None, reason, WAIT if verdict.wait_s else SIGNED_OUT
        if not _may_edit(verdict.user):
            self.access.sign_out(session)
            return None, say("editor_sign_in_engineer"), SIGNED_OUT
        return session, "", 0

    def ended(self, session: Session) -> asyncio.Event:
        """Is set when the session ends."""
        return self._ended.setdefault(session.id, asyncio.Event())

    def _end(self, session: Session, _: EndReason) -> None:
        if (ended := self._ended.pop(session.id, None)) is not None:
            ended.set()


class SignInGuard:
    """Lets in who is signed in. Open are the page of the sign-in and its style only. What is open when
    a session ends, such as a stream, ends with it."""

    def __init__(self, app: ASGIApp, sign_in: SignIn, language: Callable[[Request], str]) -> None:
        self._app = app
        self._sign_in = sign_in
        self._language = language

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] not in ("http", "websocket"):
            await self._app(scope, receive, send)
            return
        person = self._sign_in.signed_in(HTTPConnection(scope))
        if person is not None:
            if scope.get("method") == "POST" or scope["path"] == "/":
                self._sign_in.access.sessions.touch(person.session)
            scope[PERSON] = person.name
            await self._until_end(person.session, scope, receive, send)
        elif scope["type"] == "http" and _is_open(scope["path"]):
            await self._app(scope, receive, send)
        else:
            await refuse(self._refusal(scope), scope, receive, send)

    def _refusal(self, scope: Scope) -> Response:
        is_page = scope["type"] == "http" and scope["method"] == "GET" and scope["path"] == "/"
        if is_page and "text/html" in Headers(scope=scope).get("accept", ""):
            return RedirectResponse(SIGN_IN, 303, NOT_KEPT)
        text = say("editor_sign_in_needed")
        language = self._language(Request(scope)) if scope["type"] == "http" else ENGLISH
        return JSONResponse({"message": localized(text, language)}, SIGNED_OUT, NOT_KEPT)

    async def _until_end(self, session: Session, scope: Scope, receive: Receive, send: Send) -> None:
        is_http = scope["type"] == "http"
        ended = self._sign_in.ended(session)
        is_begun = is_done = False

        async def receive_until_end() -> Message:
            message = asyncio.ensure_future(receive())
            end = asyncio.ensure_future(ended.wait())
            try:
                await asyncio.wait((message, end), return_when=asyncio.FIRST_COMPLETED)
                if message.done() and not ended.is_set():
                    return await message
            finally:
                message.cancel()
                end.cancel()
            if is_http:
                return {"type": "http.disconnect"}
            return {"type": "websocket.disconnect", "code": POLICY_VIOLATION}

        async def send_noted(message: Message) -> None:
            nonlocal is_begun, is_done
            is_begun = is_begun or message["type"] in ("http.response.start", "websocket.accept")
            is_last = message["type"] == "http.response.body" and not message.get("more_body")
            is_done = is_done or is_last or message["type"] == "websocket.close"
            await send(message)

        await self._app(scope, receive_until_end, send_noted)
        if not ended.is_set() or not is_begun or is_done:
            return
        if is_http:
            await send({"type": "http.response.body", "body": b"", "more_body": False})
        else:
            await send({"type": "websocket.close", "code": POLICY_VIOLATION})


def _is_open(path: str) -> bool:
    if path == SIGN_IN:
        return True
    name = path.removeprefix(STATIC).partition("/")[2] if path.startswith(STATIC) else ""
    return name == "editor.css" or name.startswith(f"{FONTS}/")


def add_sign_in(app: FastAPI, sign_in: SignIn, rendered: Renderer) -> None:
    """The routes of the sign-in."""

    def page(request: Request, status: int = 200, problem: TextLike = "", name: str = "") -> Response:
        client = _client(request)
        ways = {way: word for way, word in WAYS.items() if sign_in.access.takes(way, client)}
        variables = {"words": WORDS, "ways": ways, "problem": problem, "person": name}
        return HTMLResponse(rendered(request, variables), status, NOT_KEPT)

    @app.get(SIGN_IN, response_class=HTMLResponse)
    async def sign_in_page(request: Request) -> Response:
        return page(request)

    @app.post(SIGN_IN, response_class=HTMLResponse)
    async def begin(request: Request) -> Response:
        try:
            form = form_of(await _body(request))
        except InputError as error:
            return page(request, error.status, error.text)
        name, secret = form.get("name", "").strip(), form.get("secret", "")
        way: Way = "pin" if form.get("way") == "pin" else "password"
        if not name or len(name) > LONGEST_NAME or len(secret) > LONGEST:
            return page(request, SIGNED_OUT, say("signin_choose") if not name else say(_WRONG[way]))
        token = new_token()
        client = new_client(token, _client(request).address)
        session, problem, status = await sign_in.sign_in(client, Attempt(name, way, secret))
        if session is None:
            return page(request, status, problem, name)
        if (before := sign_in.signed_in(request)) is not None:
            sign_in.access.sign_out(before.session)
        answer = RedirectResponse("/", 303, NOT_KEPT)
        answer.set_cookie(
            sign_in.cookie, f"{token}.{session.id}", httponly=True, samesite="strict", secure=True
        )
        return answer

    @app.post(SIGN_OUT)
    async def end(request: Request) -> Response:
        if (person := sign_in.signed_in(request)) is not None:
            sign_in.access.sign_out(person.session)
        answer = RedirectResponse(SIGN_IN, 303, NOT_KEPT)
        answer.delete_cookie(sign_in.cookie, httponly=True, samesite="strict", secure=True)
        return answer


_WRONG: Final[dict[Way, str]] = {"pin": "sign_in_wrong_pin", "password": "sign_in_wrong_password"}


def _client(request: Request) -> Client:
    return anonymous(request.client.host if request.client else "")


async def _body(request: Request) -> bytes:
    body = bytearray()
    async for chunk in request.stream():
        body += chunk
        if len(body) > LONGEST_FORM:
            raise InputError(say("sign_in_incomplete"))
    return bytes(body)
