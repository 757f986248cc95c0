"""A person confirms one press with a PIN, password or badge: the sheet for it, and its check."""

from collections.abc import Mapping
from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, Response
from pydantic import BaseModel, ConfigDict, Field, JsonValue, WithJsonSchema

from app.cell.people.access import Attempt, SecretCheck
from app.cell.people.confirmer import VALID_S, Question
from app.cell.people.secrets_hash import LONGEST, Way
from app.cell.people.users import LONGEST_NAME
from app.cell.permission.roles import SIGN_IN, ConfirmedBy
from app.panel.widgets.hold import HoldCommand
from app.system.errors import InputError, TooMany
from app.system.texts import localized, say
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.caller import Caller, caller_of, confirmed_command, question_of
from app.web.pages.confirm import Subject, confirm_sheet, press_subject
from app.web.requests import PAGE, as_model, body_of, described_body, errors, json_of
from app.web.routes.presses import INPUTS
from app.web.routes.sign_in import REFUSED, SignIn, attempt_of, refused_answer

router = APIRouter()

# The fields of the sheet in a form of a page. None of them is shown again, logged or taken for an
# input. `_enter` is that of its button.
FIELDS: Final = ("_enter", "_user", "_pin", "_password", "_badge")
WAYS: Final[Mapping[str, Way]] = {"_badge": "badge", "_password": "password", "_pin": "pin"}

UNCACHED: Final = {"cache-control": "no-store"}
Secret = Annotated[str, Field(max_length=LONGEST)]


class ConfirmBody(BaseModel):
    """The inputs of the press that is confirmed, and a PIN, password or badge: of the signed-in user,
    or with `user` or a badge of the second person."""

    model_config = ConfigDict(extra="forbid", strict=True, title="Confirm")

    inputs: Annotated[dict[str, JsonValue], WithJsonSchema(INPUTS)] = {}
    user: Annotated[str, Field(max_length=LONGEST_NAME)] = ""
    pin: Secret = ""
    password: Secret = ""
    badge: Secret = ""

    def sign_in(self, own: str) -> SignIn:
        """Who confirms; `own` is the signed-in user, where only that one can."""
        user = "" if self.badge else own or self.user
        return SignIn(user=user, pin=self.pin, password=self.password, badge=self.badge)


class ConfirmAnswer(BaseModel):
    """`confirmation` goes with the press, within `valid_s` seconds."""

    confirmation: str
    valid_s: float
    reason: str


@router.get(
    "/widgets/{widget}/confirm",
    response_class=HTMLResponse,
    summary="The sheet in which a person confirms a press, as a part of a page",
    responses=errors(403, 404, 422) | {200: {"content": PAGE}},
)
async def sheet(
    widget: str,
    request: Request,
    state: CurrentState,
    session: CurrentSession,
    value: Annotated[str, Query(max_length=200, description="of its button, such as a recipe")] = "",
) -> Response:
    command = confirmed_command(session, widget)
    who = caller_of(request).principal
    context = confirm_sheet(state, press_subject(state, session, command, value), who)
    html = state.templates.render("_confirm.html", caller_of(request).language, **context)
    return HTMLResponse(html, headers=UNCACHED)


@router.post(
    "/widgets/{widget}/confirm",
    response_model=ConfirmAnswer,
    summary="Confirm a press with a PIN, a password or a badge",
    responses=errors(403, 404, 408, 413, 422, 503) | REFUSED,
    openapi_extra=described_body(ConfirmBody, None, required=True),
)
async def confirm(
    widget: str, request: Request, state: CurrentState, session: CurrentSession
) -> Response:
    command = confirmed_command(session, widget)
    body = as_model(ConfirmBody, json_of(await body_of(request)))
    client = caller_of(request)
    who = client.principal
    if not who.user:
        return refused_answer(request, SecretCheck(None, say(SIGN_IN), SIGN_IN))
    question = question_of(state, command, body.inputs)
    own = who.user if question.confirmation == "pin" else ""
    attempt = attempt_of(body.sign_in(own))
    checked, token = await state.confirmer.confirm(who, client.session, question, attempt)
    if not token:
        return refused_answer(request, checked)
    hold = isinstance(command, HoldCommand)
    content: dict[str, Any] = {
        "confirmation": token,
        "valid_s": VALID_S,
        "reason": say("confirm_hold_now", seconds=f"{VALID_S:.0f}") if hold else "",
    }
    return JSONResponse(localized(content, caller_of(request).language), headers=UNCACHED)


def entered_fields(fields: dict[str, str]) -> dict[str, str]:
    """What is entered in the sheet, which the fields lose with it."""
    return {name: fields.pop(name, "")[:LONGEST] for name in FIELDS}


async def checked_entry(
    state: AppState, subject: Subject, act: str, client: Caller, entered: Mapping[str, str]
) -> tuple[ConfirmedBy | None, SecretCheck]:
    """Who confirmed an act with what was entered; else what was wrong."""
    who = client.principal
    ways = [way for way in WAYS if entered[way]]
    if not ways:
        return None, _missing("confirm_empty")
    (way, *_) = ways
    name = entered["_user"][:LONGEST_NAME] if way != "_badge" else ""
    if subject.confirmation == "two_persons" and way != "_badge" and not name:
        return None, _missing("confirm_who")
    question = Question(subject.id, act, subject.confirmation, subject.needs)
    attempt = Attempt(name, WAYS[way], entered[way])
    try:
        checked, token = await state.confirmer.confirm(who, client.session, question, attempt)
    except (InputError, TooMany) as error:
        return None, SecretCheck(None, error.text, "confirm_busy")
    return state.confirmer.take(token, client.session_id, subject.id, act), checked


def _missing(code: str) -> SecretCheck:
    return SecretCheck(None, say(code), code)
