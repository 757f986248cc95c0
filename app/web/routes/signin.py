"""The page of sign-in, and its pad for browsers without scripts."""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from pydantic import BaseModel, Field

from app.access.access import Attempt
from app.access.secrets_hash import LONGEST
from app.access.users import LONGEST_NAME, MOST_USERS, User
from app.i18n import TextLike, say
from app.permission.client_places import client_key
from app.web.app_state import AppState, CurrentState
from app.web.client_cookie import caller, principal_of
from app.web.framed_page import FramedPage, framed_page
from app.web.openapi_parts import described_body, errors, fields
from app.web.rendering.sign_in_tiles import tile_page
from app.web.rendering.sign_in_words import sign_in_words
from app.web.request_body import as_model, body_of, form_of
from app.web.routes.session import sign_in_query, signed_in

router = APIRouter()

WRONG: Final = ("sign_in_wrong_pin", "sign_in_wrong_password", "sign_in_wrong_badge")


class SignInQuery(BaseModel):
    """`user` is the chosen user, with `other` the typed one. `password`: whether it is asked for in
    place of the PIN; without it, on another machine it is. `refused` is the code of the last refusal,
    `page` that of the tiles: 0 is the page with the chosen user."""

    user: Annotated[str, Field(max_length=LONGEST_NAME)] = ""
    other: bool = False
    password: bool | None = None
    refused: Annotated[str, Field(max_length=40)] = ""
    page: Annotated[int, Field(ge=0, le=MOST_USERS)] = 0


class PadForm(BaseModel):
    """What the pad posts without scripts: a digit, "clear" or "enter"."""

    user: Annotated[str, Field(max_length=LONGEST_NAME)] = ""
    pin: Annotated[str, Field(max_length=LONGEST)] = ""
    digit: Annotated[str, Field(max_length=8)] = ""


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
    who, book = principal_of(request, state), state.access.book
    here = who.client.local
    users = [known for known in book.users if here and not known.disabled]
    typed = not here or query.other
    chosen = book.user(query.user) if query.user and not typed else None
    name = query.user if typed else chosen.name if chosen else ""
    # Where the name is typed, the page says nothing of the ways that its user has.
    ways = ("pin", "password") if typed else chosen.ways if chosen else ()
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
        "typed": len(state.access.typed_digits.read(who.client.id, name)) if name else 0,
        "failed": _said(state, query.refused, name, who.client.address, here),
        "words_of": sign_in_words() | {"secret_of": _title(chosen, by_password)},
    }
    framed = FramedPage("signin.html", say("signin_sign_in"), own_path="/signin")
    return framed_page(request, state, framed, context)


@router.post(
    "/session/pad",
    status_code=303,
    response_class=RedirectResponse,
    summary="A digit of a PIN, by a form without scripts",
    responses=errors(403, 408, 413, 422, 503) | {401: {"description": "never of a form"}},
    openapi_extra=described_body(
        None,
        fields(user={"maxLength": LONGEST_NAME}, pin={"maxLength": LONGEST}, digit={"maxLength": 8}),
        required=True,
    ),
)
async def pad(request: Request, state: CurrentState, other: bool = False) -> Response:
    """The server keeps the digits until the PIN is complete: no page has them. `other`: the user's name
    is typed."""
    form = as_model(PadForm, form_of(await body_of(request), 8))
    user, client = form.user, caller(request).client(state)
    if form.digit == "enter":
        pin = form.pin or state.access.typed_digits.read(client.id, user)
        state.access.typed_digits.press(client.id, user, "clear")
        if pin:
            return await signed_in(request, state, Attempt(user, "pin", pin), True, other)
    else:
        state.access.typed_digits.press(client.id, user, form.digit)
    return RedirectResponse(f"{state.root}/signin?{sign_in_query(user, other)}", 303)


def _title(chosen: User | None, by_password: bool) -> TextLike:
    if chosen is None:
        return say("signin_sign_in")
    return say("signin_password_of" if by_password else "signin_pin_of", name=chosen.name)


def _said(state: AppState, refused: str, user: str, address: str, here: bool) -> TextLike:
    """Why the last sign-in failed, by its code; how many tries are left."""
    key = "127.0.0.1" if here else client_key(address)
    if wait_s := state.access.delays.wait_s(user, key):
        return say("sign_in_wait", seconds=str(wait_s)) if refused else ""
    if refused not in WRONG:
        return state.access.oidc.reason(refused) if state.access.oidc else ""
    left = str(state.access.delays.tries_left(user, key))
    return say("signin_tries_left", why=say(refused), count=left)
