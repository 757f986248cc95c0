"""Sign in, sign out, and who is signed in."""

import secrets
from typing import Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.access.access import Attempt, Checked
from app.access.secrets_hash import LONGEST, WAYS
from app.access.sessions import Session
from app.access.users import LONGEST_NAME
from app.errors import InputError
from app.i18n import render, say
from app.permission.confirmations import BY_PROGRAM, WITHOUT_PIN
from app.permission.confirmations import SIGN_IN as SIGN_IN_FIRST
from app.permission.role_locks import ROLE_LOCK
from app.roles import ROLES
from app.web.app_state import AppState, CurrentState
from app.web.client_cookie import (
    Caller,
    caller,
    set_client_cookie,
    set_session_cookie,
)
from app.web.language import language_of
from app.web.openapi_parts import FORM, JSON, PAGE, Described, described_body, errors
from app.web.page_on import page_on
from app.web.request_body import act_body_of, as_model

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
    """Who is signed in: `user` is "" for nobody. `idle_s`: seconds without a touch until the sign-out,
    0 for never; `left_s` those that are left. `users`: whether the panel has users."""

    user: str
    role: Annotated[str, Field(json_schema_extra={"enum": list(ROLES)})]
    groups: list[str]
    users: bool
    idle_s: float
    left_s: float | None


class SignInRefused(BaseModel):
    """Why a sign-in failed; `code` is its stable name. `tries_left`: tries before there is a delay."""

    error: str
    code: str
    tries_left: int


REFUSED: Final[Described] = {
    401: {"model": SignInRefused, "description": "the name, PIN, password or badge is wrong"},
    429: {
        "model": SignInRefused,
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


@router.get("/session", response_model=SessionAnswer, summary="Who is signed in", responses=errors(403))
async def who_is_signed_in(request: Request, state: CurrentState) -> Response:
    return _about(state, caller(request))


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
    form, content = await act_body_of(request, FIELDS_MOST)
    attempt = attempt_of(as_model(SignIn, content))
    return await signed_in(request, state, attempt, form, other)


async def signed_in(
    request: Request, state: AppState, attempt: Attempt, form: bool, other: bool
) -> Response:
    """The response to a sign-in; a new browser gets its cookies with it."""
    who = caller(request)
    token = "" if who.token else secrets.token_hex(16)
    asking = Caller(who.token or token, who.address)
    checked, session = await state.access.sign_in(asking.client(state), attempt)
    if session is None:
        if form:
            query = sign_in_query(attempt.name, other, checked.code, attempt.way)
            return RedirectResponse(f"{state.root}/signin?{query}", status_code=303)
        return refused_answer(request, checked)
    answer = (
        RedirectResponse(f"{state.root}/", status_code=303)
        if form
        else _about(state, Caller(asking.token, asking.address, session.id))
    )
    return set_client_cookie(set_session_cookie(answer, request, session.id), request, token)


@router.delete("/session", status_code=204, summary="Sign out", responses=errors(403))
async def sign_out(request: Request, state: CurrentState) -> Response:
    _end(request, state)
    return set_session_cookie(Response(status_code=204), request, "")


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
    return set_session_cookie(answer, request, "")


@router.post(
    "/session/here",
    response_model=SessionAnswer,
    summary="The page of a signed-in user is still open",
    responses=errors(403, 408, 413, 422),
    openapi_extra=described_body(Touch, None, required=False),
)
async def still_here(request: Request, state: CurrentState) -> Response:
    """A touch puts the sign-out off."""
    _, content = await act_body_of(request, FIELDS_MOST)
    touched, who = as_model(Touch, content).touched, caller(request)
    session = state.access.sessions.get(who.session, who.client(state).id)
    if session is not None and touched:
        state.access.sessions.touch(session)
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
    who = caller(request)
    session = state.access.sessions.get(who.session, who.client(state).id)
    if session is not None:
        state.access.sign_out(session)
    return session


def _about(state: AppState, who: Caller) -> JSONResponse:
    principal, sessions = who.principal(state), state.access.sessions
    session = sessions.get(who.session, who.client(state).id)
    left_s = sessions.left_s(session) if session else None
    content = {
        "user": principal.user,
        "role": principal.role,
        "groups": sorted(principal.groups),
        "users": state.access.configured,
        "idle_s": state.access.rules.idle_s,
        "left_s": None if left_s in (None, float("inf")) else round(left_s or 0.0, 1),
    }
    return JSONResponse(content, headers={"cache-control": "no-store"})


def sign_in_query(user: str, other: bool, refused: str = "", way: str = "") -> str:
    """The query of the page of sign-in: the user, whether the name is typed there, and why the last
    sign-in, in this way, was refused."""
    password = "1" if way == "password" else "0" if other else ""
    query = {"user": user, "other": "1" if other else "", "refused": refused, "password": password}
    return urlencode({name: value for name, value in query.items() if value})


def refused_answer(request: Request, checked: Checked) -> JSONResponse:
    """Why a PIN, password or badge was not taken."""
    reason, left = checked.reason, checked.tries_left
    if left:
        reason = say("signin_tries_left", why=reason, count=str(left))
    content = {
        "error": render(reason, language_of(request)),
        "code": checked.code,
        "tries_left": checked.tries_left,
    }
    status, headers = 401, {"cache-control": "no-store"}
    if checked.code == "sign_in_wait":
        status, headers = 429, headers | {"retry-after": str(checked.wait_s)}
    if checked.code == "users_unreadable":
        status = 503
    if checked.code in NOT_ASKED:
        status = 403
    return JSONResponse(content, status, headers)
