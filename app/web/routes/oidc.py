"""Sign-in by the plant's OpenID Connect provider: to it, and back.

A browser does not send the panel's own cookies with the request by which it comes back from another
site. So that request is bound to the browser by a cookie of this sign-in alone, and answers a page that
leads on.
"""

from typing import Annotated, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response

from app.access.oidc import LIFE_S, OidcSignIns
from app.access.oidc_provider import OidcError
from app.access.secrets_hash import same_text
from app.errors import NotFound
from app.i18n import say
from app.web.app_state import AppState, CurrentState, site_of
from app.web.client_cookie import OTHER_SITES, caller, set_session_cookie
from app.web.openapi_parts import PAGE, errors
from app.web.page_on import page_on

router = APIRouter()

COOKIE: Final = "panel_oidc"
BACK: Final = "/session/oidc/back"
Text = Annotated[str, Query(max_length=4000)]


@router.get(
    "/session/oidc",
    status_code=303,
    response_class=RedirectResponse,
    summary="Begin a sign-in at the plant's provider",
    responses=errors(403, 404),
)
async def begin(request: Request, state: CurrentState) -> Response:
    """To the provider; back to the page of sign-in if it is away."""
    sign_ins, who = _sign_ins(state), caller(request)
    if not who.token or request.headers.get("sec-fetch-site") in OTHER_SITES:
        return RedirectResponse(f"{state.root}/signin", 303)
    back = f"{request.url.scheme}://{request.url.netloc}{state.root}{BACK}"
    try:
        url, begun = await sign_ins.begin(who.client(state), back)
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
    sent_state: Annotated[str, Query(alias="state", max_length=200)] = "",
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
        set_session_cookie(answer, request, session_id)
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
