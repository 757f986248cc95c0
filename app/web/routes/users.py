"""The engineer's page of users and tokens, the same as JSON, and the acts on them."""

import secrets
from collections.abc import Mapping
from typing import Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.commands.acts import ActReceipt, ActRequest
from app.cell.commands.judge import RETRY_AFTER_S
from app.cell.commands.press import PRESS_ID
from app.cell.commands.user_acts import TOKEN, USER_ACTS
from app.cell.people.edits import tokens_json, users_json
from app.cell.people.secrets_hash import LONGEST, WAYS, new_api_token
from app.cell.people.users import LONGEST_NAME
from app.panel.roles import ROLES
from app.system.texts import Text, TextLike, localized, say
from app.web.answers import STATUS
from app.web.app_state import AppState, CurrentState
from app.web.caller import caller_of
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.users_page import Mode, users_context, word
from app.web.requests import (
    PAGE,
    SINCE,
    FormFields,
    Moment,
    act_body_of,
    as_model,
    described_body,
    errors,
    refusals,
)
from app.web.routes.presses import is_second_tap

router = APIRouter()

TOO_OFTEN: Final = say("control_too_often")
TOO_SOON: Final = say("press_too_soon")
FIELDS_MOST: Final = 40
GROUP: Final = "group-"  # stands before the id of a group in a form
UserAct = Annotated[str, Path(json_schema_extra={"enum": list(USER_ACTS)})]
UserName = Annotated[str, Field(max_length=LONGEST_NAME)]
Secret = Annotated[str, Field(max_length=LONGEST, json_schema_extra={"format": "password"})]
HEADERS: Final[Mapping[str, str]] = {"cache-control": "no-store", "vary": "accept"}
NAME: Final = {"maxLength": LONGEST_NAME}
SECRET: Final = {"maxLength": LONGEST, "format": "password"}
ACT_FORM: Final = FormFields(
    {
        "name": NAME,
        "role": {"enum": [*ROLES]},
        "way": {"enum": [*WAYS]},
        "secret": SECRET,
        "none": {"enum": ["true"]},
        "version": {"pattern": "^[0-9]{1,15}$"},
        "id": {"pattern": PRESS_ID},
        "_since": SINCE,
    },
    {f"^{GROUP}": {"enum": ["true"]}},
)


class UsersQuery(BaseModel):
    """What the page shows; `act` is the id of an act whose receipt is shown."""

    model_config = ConfigDict(extra="forbid")

    name: UserName = ""
    tokens: bool = False
    mode: Mode = "show"
    act: Annotated[str, Field(max_length=400)] = ""


class UserActBody(BaseModel):
    """`none` removes the PIN, password or badge. `version` is the number of the last change of the user
    that the screen showed. The same `id` again is the same act."""

    model_config = ConfigDict(extra="forbid")

    name: UserName = ""
    role: Annotated[str, Field(json_schema_extra={"enum": list(ROLES)}, max_length=40)] | None = None
    groups: Annotated[list[Annotated[str, Field(max_length=64)]], Field(max_length=20)] | None = None
    pin: Secret = ""
    password: Secret = ""
    badge: Secret = ""
    none: bool | None = None
    version: Annotated[int, Field(ge=0, lt=2**53)] | None = None
    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    at: Moment | None = None

    @property
    def values(self) -> dict[str, Any]:
        """What the act needs, and the log keeps: no secret."""
        return self.model_dump(include={"role", "groups", "none", "version"}, exclude_none=True)


class UserReceipt(BaseModel):
    """The receipt of an act, as that of a press; `done`: it was applied. `token` is the token that was
    made: it is answered once."""

    id: str
    act: str
    outcome: str
    code: str
    reason: str
    at: str
    done: bool
    token: str = ""


class ListedUser(BaseModel):
    """Times are ISO 8601, `last_sign_in` is null for never."""

    name: str
    role: str
    groups: list[str]
    signs_in_with: list[str]
    disabled: bool
    created: str
    changed: str
    last_sign_in: str | None


class ListedToken(BaseModel):
    name: str
    role: str
    created: str
    last_used: str | None


class UsersAnswer(BaseModel):
    users: list[ListedUser]
    tokens: list[ListedToken]


@router.get(
    "/users",
    response_model=UsersAnswer,
    summary="Users and tokens: a page for browsers, else as JSON",
    responses=errors(403, 422) | {200: {"content": PAGE}},
)
async def users(
    request: Request, state: CurrentState, query: Annotated[UsersQuery, Query()]
) -> Response:
    if not caller_of(request).accepts_html:
        book, last = state.access.book, state.access.log.last
        content = {"users": users_json(book, last), "tokens": tokens_json(book, last)}
        return JSONResponse(content, headers=HEADERS)
    return _page(request, state, query)


@router.post(
    "/users/{act}",
    response_model=UserReceipt,
    summary="Add, change or remove a user, or make or revoke a token",
    responses=errors(403, 404, 408, 413, 422)
    | {
        200: {"content": PAGE, "description": "also of a form that made a token: the page that has it"},
        303: {"description": "of a form: back to the page, with the receipt on it"},
        **{status: refusals(UserReceipt)[status] for status in (409, 429)},
        503: {"model": UserReceipt, "description": "the operator's log refuses it"},
    },
    openapi_extra=described_body(UserActBody, ACT_FORM.schema, required=False),
)
async def act(act: UserAct, request: Request, state: CurrentState) -> Response:
    is_form, content = await act_body_of(request, ACT_FORM, FIELDS_MOST)
    body = as_model(UserActBody, _form_body(act, content) if is_form else content)
    who, cookie = caller_of(request).identified()
    act_id = f"{body.id}.{act}.{body.name}"[:400] if body.id else secrets.token_hex(8)
    runner, is_first = state.user_acts, state.user_acts.receipt(act_id) is None
    at = body.at.timestamp() if body.at else None
    entered = {way: text for way in WAYS if (text := getattr(body, way))}
    token = new_api_token() if act == TOKEN else ""
    asked = ActRequest(
        act, who, body.name, body.values, at, not is_form, entered | ({TOKEN: token} if token else {})
    )
    refusal = TOO_SOON if is_form and is_second_tap(content) else None
    if not state.limits.admit(who):
        refusal = TOO_OFTEN
    with state.in_flight.track():
        receipt = (
            await runner.act(asked, act_id)
            if refusal is None
            else runner.limited(asked, act_id, refusal)
        )
    if not is_first or not receipt.done:
        token = ""
    if is_form:
        answer = _after_form(request, state, act, body, receipt, token)
    else:
        answer = _receipt(request, receipt, token)
    return caller_of(request).with_client_cookie(answer, cookie)


def _form_body(act: str, form: Mapping[str, str]) -> dict[str, Any]:
    """The body of a form: its one secret is a PIN, password or badge, as `way` or the act says."""
    taken = {"way", "secret", "_since"}
    groups = [name.removeprefix(GROUP) for name in form if name.startswith(GROUP)]
    body: dict[str, Any] = {
        name: text for name, text in form.items() if name not in taken and not name.startswith(GROUP)
    }
    way = act if act in WAYS else form.get("way", "")
    if way in WAYS and "secret" in form:
        body[way] = form["secret"]
    if act in ("add", "role"):
        body["groups"] = groups
    return body


def _receipt(request: Request, receipt: ActReceipt, token: str) -> Response:
    said = {**receipt.as_json(), "done": receipt.done}
    content = localized(said, caller_of(request).language) | {"token": token}
    headers = {"cache-control": "no-store"}
    if receipt.cause == "limit":
        headers["retry-after"] = str(RETRY_AFTER_S)
    return JSONResponse(content, STATUS[receipt.cause], headers)


def _after_form(
    request: Request,
    state: AppState,
    act: str,
    body: UserActBody,
    receipt: ActReceipt,
    token: str,
) -> Response:
    """A redirect to the page, which shows the receipt; a new token is on no page with an address."""
    is_token = act in (TOKEN, "revoke")
    if token:
        query = UsersQuery(name=body.name, tokens=True)
        return _page(request, state, query, receipt.reason, token)
    shown: dict[str, Any] = {"tokens": "true"} if is_token else {}
    if body.name and not (receipt.done and act in ("remove", "revoke")):
        shown["name"] = body.name
    if not receipt.done and act not in ("disable", "enable"):
        shown["mode"] = act
    shown["act"] = receipt.code if receipt.cause == "limit" else receipt.id
    return RedirectResponse(f"{state.root}/users?{urlencode(shown)}", 303)


def _page(
    request: Request, state: AppState, query: UsersQuery, said: TextLike = "", token: str = ""
) -> Response:
    runner = state.user_acts
    receipt = runner.receipt(query.act) if query.act else None
    known: Mapping[str, Text] = {text.code: text for text in (TOO_OFTEN, TOO_SOON)}
    if not said:
        said = known.get(query.act) or (receipt.reason if receipt else "")
    if receipt and receipt.done and receipt.act == TOKEN and not token:
        said = word("token_gone")
    refused = runner.request(query.act) if receipt and not receipt.done else None
    rules, who = state.fleet.panel.access, caller_of(request).principal
    about = (rules.groups, who, query.name, query.tokens, query.mode, said, refused, token)
    context = {**users_context(state.access, *about), "word": word}
    answer = framed_page(
        request, state, FramedPage("users.html", word("title"), own_path="/users"), context
    )
    assert isinstance(answer, HTMLResponse)
    return answer
