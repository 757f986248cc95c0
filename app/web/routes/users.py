"""The engineer's page of users, tokens and sign-ins, the same as JSON, and the acts on them; the page
of the sign-ins of who is signed in."""

import time
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Annotated, Any, Final
from urllib.parse import urlencode

from fastapi import APIRouter, Path, Query, Request
from fastapi.responses import JSONResponse, RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.commands.acts import ActReceipt
from app.cell.commands.press import PRESS_ID
from app.cell.commands.user_acts import END, TOKEN, USER_ACTS
from app.cell.people.access import Access
from app.cell.people.edits import tokens_json, users_json
from app.cell.people.secrets_hash import LONGEST, WAYS, new_api_token
from app.cell.people.sessions import Session
from app.cell.people.users import LONGEST_NAME
from app.panel.roles import ROLES
from app.system.clock import iso_time
from app.system.texts import TextLike
from app.web.acts import ActBody, act_responses, refused_form, said_of, sent_act
from app.web.answers import ActAnswer
from app.web.app_state import AppState, CurrentState
from app.web.caller import caller_of
from app.web.large_answers import rows_answer
from app.web.pages.context import FramedPage, framed_page
from app.web.pages.users_page import GROUP, OF_LISTS, Listed, Mode, users_context, word
from app.web.requests import PAGE, SINCE, FormFields, described_body, errors

router = APIRouter()

UserAct = Annotated[str, Path(json_schema_extra={"enum": list(USER_ACTS)})]
UserName = Annotated[str, Field(max_length=LONGEST_NAME)]
Secret = Annotated[str, Field(max_length=LONGEST, json_schema_extra={"format": "password"})]
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

END_FORM: Final = FormFields({"name": NAME, "id": {"pattern": PRESS_ID}, "_since": SINCE})


class UsersQuery(BaseModel):
    """What the page shows; `act` is the id of an act whose receipt is shown."""

    model_config = ConfigDict(extra="forbid")

    name: UserName = ""
    tokens: bool = False
    sessions: bool = False
    mode: Mode = "show"
    act: Annotated[str, Field(max_length=400)] = ""


class UserActBody(ActBody):
    """`none` removes the PIN, password or badge. `version` is the number of the last change of the user
    that the screen showed. The same `id` again is the same act."""

    name: UserName = ""
    role: Annotated[str, Field(json_schema_extra={"enum": list(ROLES)}, max_length=40)] | None = None
    groups: Annotated[list[Annotated[str, Field(max_length=64)]], Field(max_length=20)] | None = None
    pin: Secret = ""
    password: Secret = ""
    badge: Secret = ""
    none: bool | None = None
    version: Annotated[int, Field(ge=0, lt=2**53)] | None = None

    @property
    def values(self) -> dict[str, Any]:
        """What the act needs, and the log keeps: no secret."""
        return self.model_dump(include={"role", "groups", "none", "version"}, exclude_none=True)


class UserReceipt(ActAnswer):
    """The receipt of an act, as that of a press; `done`: it was applied. `token` is the token that was
    made: it is answered once."""

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


class ListedSession(BaseModel):
    """A sign-in: `id` is what the act `end` takes as `name`. Times are ISO 8601. `here`: it is the one
    at the browser that asks."""

    id: str
    user: str
    role: str
    address: str
    browser: str
    since: str
    touched: str
    here: bool


class SessionsAnswer(BaseModel):
    """The sign-ins of the user who is signed in; none for a program."""

    sessions: list[ListedSession]


class SessionsQuery(BaseModel):
    """`name` is the id of the sign-in that the page shows, `act` that of an act whose receipt is
    shown."""

    model_config = ConfigDict(extra="forbid")

    name: UserName = ""
    act: Annotated[str, Field(max_length=400)] = ""


class EndBody(ActBody):
    """`name` is the id of a sign-in. The same `id` again is the same act."""

    name: UserName = ""


class UsersAnswer(BaseModel):
    users: list[ListedUser]
    tokens: list[ListedToken]
    sessions: list[ListedSession]


@router.get(
    "/users",
    response_model=UsersAnswer,
    summary="Users, tokens and sign-ins: a page for browsers, else as JSON",
    responses=errors(403, 422) | {200: {"content": PAGE}},
)
async def users(
    request: Request, state: CurrentState, query: Annotated[UsersQuery, Query()]
) -> Response:
    if caller_of(request).accepts_html:
        return _page(request, state, query)
    book, last = state.access.book, state.access.log.last
    content = {
        "users": users_json(book, last),
        "tokens": tokens_json(book, last),
        "sessions": _sessions_json(request, state.access, [*state.access.sessions]),
    }
    return await rows_answer(request, lambda: content, len(book.users))


def _sessions_json(
    request: Request, access: Access, sessions: Sequence[Session]
) -> list[dict[str, str | bool]]:
    own_client = caller_of(request).principal.client.id
    rows: list[dict[str, str | bool]] = []
    for session in sessions:
        began_s, touched_s = access.sessions.seen_s(session)
        client, now = session.client, time.time()
        rows.append(
            {
                "id": session.handle,
                "user": session.user,
                "role": access.principal(client, session.id).role,
                "address": client.address,
                "browser": client.id,
                "since": iso_time(now - began_s),
                "touched": iso_time(now - touched_s),
                "here": client.id == own_client,
            }
        )
    return rows


@router.get(
    "/sessions",
    response_model=SessionsAnswer,
    summary="The sign-ins of the user who is signed in: a page for browsers, else as JSON",
    responses=errors(403, 422)
    | {
        200: {"content": PAGE},
        303: {"description": "of a browser at which no one is signed in: to the page of sign-in"},
    },
)
async def own_sessions(
    request: Request, state: CurrentState, query: Annotated[SessionsQuery, Query()]
) -> Response:
    """No one but their user sees them here."""
    who = caller_of(request).principal
    own = state.access.own_sessions(who)
    if not caller_of(request).accepts_html:
        content = {"sessions": _sessions_json(request, state.access, own)}
        return JSONResponse(content, headers={"cache-control": "no-store"})
    if not own:
        return RedirectResponse(f"{state.root}/signin", 303)
    said = said_of(query.act, [state.user_acts])
    context = users_context(state.access, (), who, query.name, "own", "show", said)
    page = FramedPage("users.html", word("own"), "/sessions")
    return framed_page(request, state, page, {**context, "word": word})


@router.post(
    "/sessions/end",
    response_model=ActAnswer,
    summary="End a sign-in of one's own",
    responses=act_responses(ActAnswer),
    openapi_extra=described_body(EndBody, END_FORM.schema, required=False),
)
async def end_own(request: Request, state: CurrentState) -> Response:
    """Of others only who may do it by `POST /users/end` too."""
    sent = await sent_act(request, state, EndBody, END_FORM)
    name = sent.body.name
    receipt = await sent.run(state.user_acts, sent.asked(END, name), sent.act_id(END, name))
    shown = "" if receipt.done else f"?{urlencode({'name': name})}"
    return sent.answer(receipt, f"{state.root}/sessions{shown}")


@router.post(
    "/users/{act}",
    response_model=UserReceipt,
    summary="Add, change or remove a user, make or revoke a token, or end a sign-in",
    responses=act_responses(UserReceipt)
    | {200: {"content": PAGE, "description": "also of a form that made a token: the page that has it"}},
    openapi_extra=described_body(UserActBody, ACT_FORM.schema, required=False),
)
async def act(act: UserAct, request: Request, state: CurrentState) -> Response:
    sent = await sent_act(request, state, UserActBody, ACT_FORM, partial(_form_body, act))
    body, runner = sent.body, state.user_acts
    entered = {way: text for way in WAYS if (text := getattr(body, way))}
    token = new_api_token() if act == TOKEN else ""
    asked = sent.asked(act, body.name, body.values)
    asked = asked._replace(secrets=entered | ({TOKEN: token} if token else {}))
    act_id = sent.act_id(act, body.name)
    is_first = runner.receipt(act_id) is None
    receipt = await sent.run(runner, asked, act_id)
    if not is_first or not receipt.done:
        token = ""
    if sent.form is None:
        return sent.answer(receipt, "", token=token)
    if token:  # a new token is on no page with an address
        query = UsersQuery(name=body.name, tokens=True)
        return sent.with_cookie(_page(request, state, query, receipt.reason, token))
    return sent.back(f"{state.root}/users?{urlencode(_shown(act, body.name, receipt))}", receipt)


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


def _shown(act: str, name: str, receipt: ActReceipt) -> dict[str, str]:
    """The query of the page after a form: whom it shows, and the form again if it was refused."""
    listed = OF_LISTS.get(act)
    shown: dict[str, str] = {listed: "true"} if listed else {}
    if name and not (receipt.done and act in ("remove", "revoke", END)):
        shown["name"] = name
    if not receipt.done and act not in ("disable", "enable", END):
        shown["mode"] = act
    return shown


def _page(
    request: Request, state: AppState, query: UsersQuery, said: TextLike = "", token: str = ""
) -> Response:
    runner = state.user_acts
    receipt = runner.receipt(query.act) if query.act else None
    said = said or said_of(query.act, [runner])
    if receipt and receipt.done and receipt.act == TOKEN and not token:
        said = word("token_gone")
    typed = refused_form(request, state).typed
    rules, who = state.fleet.panel.access, caller_of(request).principal
    listed: Listed = "tokens" if query.tokens else "sessions" if query.sessions else "users"
    about = (rules.groups, who, query.name, listed, query.mode, said, typed, token)
    context = {**users_context(state.access, *about), "word": word}
    page = FramedPage("users.html", word("title"), "/users")
    return framed_page(request, state, page, context)
