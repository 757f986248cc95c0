"""Sign in and sign out: the page of sign-in, and sign-in by the plant's OpenID Connect provider."""

import secrets
from typing import Annotated, Any, Final, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from markupsafe import Markup
from pydantic import BaseModel, ConfigDict, Field

from app.cell.people.access import NO_USERS, PIN_HERE, Attempt, SecretCheck
from app.cell.people.oidc import LIFE_S, OidcError, OidcSignIns
from app.cell.people.secrets_hash import LONGEST, WAYS, Way, same_text
from app.cell.people.sessions import Session
from app.cell.people.users import LONGEST_NAME, MOST_USERS, User
from app.cell.permission.roles import BY_PROGRAM, ROLE_LOCK, WITHOUT_PIN
from app.cell.permission.roles import SIGN_IN as SIGN_IN_FIRST
from app.panel.roles import ROLES
from app.records.principal import Client
from app.system.errors import InputError, NotFound
from app.system.texts import TextLike, render, say
from app.web.app_state import AppState, CurrentState, site_of
from app.web.caller import OTHER_SITES, Caller, caller_of
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.sign_in import sign_in_words, tile_page
from app.web.requests import (
    FORM,
    JSON,
    PAGE,
    Described,
    ErrorAnswer,
    FormFields,
    act_body_of,
    as_model,
    described_body,
    errors,
)

# A page that leads on: where a redirect would be one of another site's, or lead to another site.

PAGE_ON: Final = Markup(
    '<!doctype html><html lang="{language}"><head><meta charset="utf-8"><title>{text}</title>'
    '<meta http-equiv="refresh" content="0;url={url}"></head>'
    '<body><p><a href="{url}">{text}</a></p></body></html>'
)


def page_on(request: Request, url: str) -> HTMLResponse:
    """The page that leads to this address."""
    language = caller_of(request).language
    html = PAGE_ON.format(language=language, url=url, text=render(say("oidc_go_on"), language))
    return HTMLResponse(html, headers={"cache-control": "no-store", "referrer-policy": "no-referrer"})


# Sign in, sign out, and who is signed in.

router = APIRouter()

FIELDS_MOST: Final = 8
# Of a confirmation: what is no wrong secret.
NOT_ASKED: Final = frozenset(
    {
        *(SIGN_IN_FIRST, BY_PROGRAM, WITHOUT_PIN, ROLE_LOCK),
        *("confirm_same_person", "confirm_second_role"),
    }
)
Secret = Annotated[str, Field(max_length=LONGEST)]


class SignIn(BaseModel):
    """A user's name with a PIN or password, or a badge's number."""

    model_config = ConfigDict(extra="forbid", strict=True)

    user: Annotated[str, Field(max_length=LONGEST_NAME)] = ""
    pin: Secret = ""
    password: Secret = ""
    badge: Secret = ""


class Touch(BaseModel):
    """`touched`: the user has touched the page since the last such message."""

    model_config = ConfigDict(extra="forbid", strict=True)

    touched: bool = False


class SessionAnswer(BaseModel):
    """Who is signed in: `user` is "" for no one. `idle_s`: seconds without a touch until the sign-out,
    `longest_s` those after the sign-in, 0 for never; `left_s` those that are left, and which of the two
    they are of. `users`: whether the panel has users."""

    user: str
    role: Annotated[str, Field(json_schema_extra={"enum": list(ROLES)})]
    groups: list[str]
    users: bool
    idle_s: float
    longest_s: float
    ends_by: Literal["idle", "longest"] | None
    left_s: float | None


class SignInRefused(BaseModel):
    """Why a sign-in failed; `code` is its stable name. `tries_left`: tries before there is a delay."""

    error: str
    code: str
    tries_left: int


REFUSED: Final[Described] = {
    401: {
        "model": SignInRefused | ErrorAnswer,
        "description": "the name, PIN, password or badge is wrong, or a program's token",
    },
    429: {
        "model": SignInRefused | ErrorAnswer,
        "description": "after failures, or while others sign in; `Retry-After` says when to try again",
    },
}


NAME: Final = {"type": "string", "minLength": 1, "maxLength": LONGEST_NAME}
SECRET: Final = {"type": "string", "minLength": 1, "maxLength": LONGEST, "format": "password"}


def _way(**properties: dict[str, Any]) -> dict[str, Any]:
    required = [*properties]
    return {
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }


BODY: Final = {
    "oneOf": [_way(user=NAME, pin=SECRET), _way(user=NAME, password=SECRET), _way(badge=SECRET)]
}
SIGN_IN_FORM: Final = FormFields({"user": NAME, "pin": SECRET, "password": SECRET, "badge": SECRET})


@router.get("/session", response_model=SessionAnswer, summary="Who is signed in", responses=errors(403))
async def who_is_signed_in(request: Request, state: CurrentState) -> Response:
    return _about(state, caller_of(request))


@router.post(
    "/session",
    response_model=SessionAnswer,
    summary="Sign in with a PIN, a password or a badge",
    responses=errors(403, 408, 413, 422, 503)
    | REFUSED
    | {303: {"description": "of a form: to the page that it was opened from, or back with the reason"}},
    openapi_extra={
        "requestBody": {"required": True, "content": {JSON: {"schema": BODY}, FORM: {"schema": BODY}}}
    },
)
async def sign_in(request: Request, state: CurrentState, other: bool = False) -> Response:
    """`other`: the page on which the name is typed is shown again, with the reason of a refusal."""
    form, content = await act_body_of(request, SIGN_IN_FORM, FIELDS_MOST)
    attempt = attempt_of(as_model(SignIn, content))
    return await signed_in(request, state, attempt, form, other)


async def signed_in(
    request: Request, state: AppState, attempt: Attempt, form: bool, other: bool
) -> Response:
    """The response to a sign-in; a new browser gets its cookies with it."""
    who = caller_of(request)
    token = "" if who.token else secrets.token_hex(16)
    who.token = who.token or token
    checked, session = await state.access.sign_in(who.client, attempt)
    if session is None:
        if form:
            query = sign_in_query(attempt.name, other, checked.code, attempt.way)
            return RedirectResponse(f"{state.root}/signin?{query}", status_code=303)
        return refused_answer(request, checked)
    who.session_id, who.bearer = session.id, ""
    answer = RedirectResponse(f"{state.root}/", status_code=303) if form else _about(state, who)
    return who.with_client_cookie(who.with_session_cookie(answer, session.id), token)


@router.delete("/session", status_code=204, summary="Sign out", responses=errors(403))
async def sign_out(request: Request, state: CurrentState) -> Response:
    _end(request, state)
    return caller_of(request).with_session_cookie(Response(status_code=204), "")


@router.post(
    "/session/end",
    status_code=303,
    response_class=RedirectResponse,
    summary="Sign out, by a form",
    responses=errors(403) | {200: {"description": "leads to the plant's provider", "content": PAGE}},
)
async def sign_out_by_form(request: Request, state: CurrentState) -> Response:
    """A user whom the plant's provider knows signs out there too: by a page that leads to it, since
    the answer to a form must not redirect to another site."""
    session, page = _end(request, state), f"{state.root}/signin"
    answer: Response = RedirectResponse(page, 303)
    if session is not None and session.id_token and state.access.oidc is not None:
        back = f"{request.url.scheme}://{request.url.netloc}{page}"
        if url := await state.access.oidc.end_url(session.id_token, back):
            answer = page_on(request, url)
    return caller_of(request).with_session_cookie(answer, "")


@router.post(
    "/session/here",
    response_model=SessionAnswer,
    summary="The page of a signed-in user is still open",
    responses=errors(403, 408, 413, 422),
    openapi_extra=described_body(Touch, None, required=False),
)
async def still_here(request: Request, state: CurrentState) -> Response:
    """A touch puts the sign-out off."""
    _, content = await act_body_of(request)
    touched, who = as_model(Touch, content).touched, caller_of(request)
    if who.session is not None and touched:
        state.access.sessions.touch(who.session)
    return _about(state, who)


def attempt_of(body: SignIn) -> Attempt:
    """The way that a body names; InputError for none or several."""
    ways = [way for way in WAYS if getattr(body, way)]
    if len(ways) != 1:
        raise InputError(say("sign_in_incomplete"))
    (way,) = ways
    if way != "badge" and not body.user:
        raise InputError(say("sign_in_without_user"))
    return Attempt(body.user, way, getattr(body, way))


def _end(request: Request, state: AppState) -> Session | None:
    """Signs out who is signed in at the browser; returns the session."""
    session = caller_of(request).session
    if session is not None:
        state.access.sign_out(session)
    return session


def _about(state: AppState, who: Caller) -> JSONResponse:
    principal, session = who.principal, who.session
    left_s = state.access.sessions.left_s(session) if session else None
    content = {
        "user": principal.user,
        "role": principal.role,
        "groups": sorted(principal.groups),
        "users": state.access.configured,
        "idle_s": state.access.rules.idle_s,
        "longest_s": state.access.rules.longest_s,
        "ends_by": state.access.sessions.ends_by(session) if session else None,
        "left_s": None if left_s in (None, float("inf")) else round(left_s or 0.0, 1),
    }
    return JSONResponse(content, headers={"cache-control": "no-store"})


def sign_in_query(user: str, other: bool, refused: str = "", way: str = "") -> str:
    """The query of the page of sign-in: the user, whether the name is typed there, and why the last
    sign-in, in this way, was refused."""
    password = "1" if way == "password" else "0" if other else ""
    query = {"user": user, "other": "1" if other else "", "refused": refused, "password": password}
    return urlencode({name: value for name, value in query.items() if value})


def refused_answer(request: Request, checked: SecretCheck) -> JSONResponse:
    """Why a PIN, password or badge was not taken."""
    reason, left = checked.reason, checked.tries_left
    if left:
        reason = say("signin_tries_left", why=reason, count=str(left))
    content = {
        "error": render(reason, caller_of(request).language),
        "code": checked.code,
        "tries_left": checked.tries_left,
    }
    status, headers = 401, {"cache-control": "no-store"}
    if checked.code == "sign_in_wait":
        status, headers = 429, headers | {"retry-after": str(checked.wait_s)}
    if checked.code == NO_USERS:
        status = 503
    if checked.code in NOT_ASKED or checked.code == PIN_HERE:
        status = 403
    return JSONResponse(content, status, headers)


# The page of sign-in.

WRONG: Final = ("sign_in_wrong_pin", "sign_in_wrong_password")
PLAIN: Final = (PIN_HERE, "sign_in_wrong_badge")  # without a number of tries


class SignInQuery(BaseModel):
    """`user` is the chosen user, with `other` the typed one. `password`: whether it is asked for in
    place of the PIN; without it, on another machine it is. `refused` is the code of the last refusal,
    `page` that of the tiles: 0 is the page with the chosen user."""

    user: Annotated[str, Field(max_length=LONGEST_NAME)] = ""
    other: bool = False
    password: bool | None = None
    refused: Annotated[str, Field(max_length=40)] = ""
    page: Annotated[int, Field(ge=0, le=MOST_USERS)] = 0


@router.get(
    "/signin",
    response_class=HTMLResponse,
    summary="The page on which users sign in",
    responses=errors(403, 404, 422),
)
async def page(
    request: Request, state: CurrentState, query: Annotated[SignInQuery, Query()]
) -> Response:
    """Names of users are shown at the kiosk's own machine only: elsewhere they are typed."""
    who, book = caller_of(request).principal, state.access.book
    here = who.client.local
    users = [known for known in book.users if here and not known.disabled]
    typed = not here or query.other
    chosen = book.user(query.user) if query.user and not typed else None
    name = query.user if typed else chosen.name if chosen else ""
    # Where the name is typed, the page says nothing of the ways that its user has.
    every: tuple[Way, ...] = ("pin", "password")
    own = every if typed else chosen.ways if chosen else ()
    ways = [way for way in own if state.access.takes(way, who.client)]
    asked = not here if query.password is None else query.password
    by_password = "password" in ways and (asked or "pin" not in ways)
    oidc = say("signin_oidc", name=rules.name) if (rules := state.access.rules.oidc) else ""
    context: dict[str, Any] = {
        "tiles": tile_page(users, name, query.page, 1 if oidc else 0),
        "chosen": name,
        "other": typed,
        "by_password": by_password,
        "can_pin": "pin" in ways,
        "can_password": "password" in ways,
        "oidc": oidc,
        "has_badges": any(known.badge for known in book.users),
        "failed": _failure(state, query.refused, name, who.client),
        "words_of": sign_in_words() | {"secret_of": _title(chosen, by_password)},
    }
    framed = FramedPage("signin.html", say("signin_sign_in"), "/signin")
    return framed_page(request, state, framed, context)


def _title(chosen: User | None, by_password: bool) -> TextLike:
    if chosen is None:
        return say("signin_sign_in")
    return say("signin_password_of" if by_password else "signin_pin_of", name=chosen.name)


def _failure(state: AppState, refused: str, user: str, client: Client) -> TextLike:
    """Why the last sign-in failed, by its code; how many tries are left. Without a failure, why the
    browser's session ended."""
    if not refused:
        return state.access.end_reason(client)
    if refused in PLAIN:
        return say(refused)
    if wait_s := state.access.wait_s(client, user):
        return say("sign_in_wait", seconds=str(wait_s))
    if refused not in WRONG:
        return state.access.oidc.reason(refused) if state.access.oidc else ""
    left = str(state.access.tries_left(client, user))
    return say("signin_tries_left", why=say(refused), count=left)


# Sign-in by the plant's OpenID Connect provider: to it, and back.
#
# A browser does not send the panel's own cookies with the request by which it comes back from another
# site. So that request is bound to the browser by a cookie of this sign-in alone, and answers a page
# that leads on.

COOKIE: Final = "panel_oidc"
BACK: Final = "/session/oidc/back"
# Visible ASCII, as RFC 6749 has it: with more, a request's target could be too long for the server.
VISIBLE: Final = r"^[\x20-\x7e]*$"
Text = Annotated[str, Query(max_length=4000, pattern=VISIBLE)]


@router.get(
    "/session/oidc",
    status_code=303,
    response_class=RedirectResponse,
    summary="Begin a sign-in at the plant's provider",
    responses=errors(403, 404),
)
async def begin(request: Request, state: CurrentState) -> Response:
    """To the provider; back to the page of sign-in if it is away."""
    sign_ins, who = _sign_ins(state), caller_of(request)
    if not who.token or request.headers.get("sec-fetch-site") in OTHER_SITES:
        return RedirectResponse(f"{state.root}/signin", 303)
    back = f"{request.url.scheme}://{request.url.netloc}{state.root}{BACK}"
    try:
        url, begun = await sign_ins.begin(who.client, back)
    except OidcError as error:
        return RedirectResponse(_sign_in_page(state, error), 303)
    answer = RedirectResponse(url, 303, {"cache-control": "no-store"})
    return _with_cookie(answer, request, begun)


@router.get(
    BACK,
    response_class=HTMLResponse,
    summary="Back from the plant's provider",
    responses=errors(403, 404, 422) | {200: {"content": PAGE}},
)
async def back(
    request: Request,
    state: CurrentState,
    code: Text = "",
    error: Text = "",
    sent_state: Annotated[str, Query(alias="state", max_length=200, pattern=VISIBLE)] = "",
) -> Response:
    """Signs in who the code stands for, at the browser that began this, and leads to the first page."""
    sign_ins, session_id, url = _sign_ins(state), "", f"{state.root}/"
    cookie = request.cookies.get(_cookie(request), "")
    try:
        if not cookie or not same_text(cookie, sent_state):
            raise OidcError(say("oidc_late", name=sign_ins.rules.name))
        begun = sign_ins.take(sent_state)
        try:
            if error or not code:
                raise OidcError(say("oidc_refused", name=sign_ins.rules.name), error)
            user = await sign_ins.user_of(begun, code)
        except OidcError as refused:
            await state.access.log.failed(begun.client, "", "sign_in", "", refused.reason)
            raise
        session_id = state.access.sign_in_external(begun.client, user).id
    except OidcError as refused:
        url = _sign_in_page(state, refused)
    answer = page_on(request, url)
    if session_id:
        caller_of(request).with_session_cookie(answer, session_id)
    return _with_cookie(answer, request, "")


def _sign_ins(state: AppState) -> OidcSignIns:
    if state.access.oidc is None:
        raise NotFound("this panel has no [access.oidc]")
    return state.access.oidc


def _sign_in_page(state: AppState, error: OidcError) -> str:
    return f"{state.root}/signin?{urlencode({'refused': error.reason.code})}"


def _cookie(request: Request) -> str:
    return f"__Secure-{COOKIE}" if request.url.scheme == "https" else COOKIE


def _with_cookie(answer: Response, request: Request, begun: str) -> Response:
    """With the cookie that binds a sign-in to this browser; "" drops it."""
    answer.set_cookie(
        _cookie(request),
        begun,
        max_age=int(LIFE_S) if begun else 0,
        path=f"{site_of(request).root}{BACK}",
        httponly=True,
        samesite="lax",
        secure=request.url.scheme == "https",
    )
    return answer
