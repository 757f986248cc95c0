"""Taking control of a robot, asking for it, giving it: JSON for scripts, forms without them."""

from typing import Annotated, Final, TypeVar

from fastapi import APIRouter, Path, Request
from fastapi.responses import JSONResponse, RedirectResponse, Response
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, JsonValue

from app.errors import InputError, NotFound
from app.i18n import say
from app.panel.base import ID
from app.permission.control_authority import LIFE_S, Refusal
from app.permission.principal import Principal
from app.runtime.robot_session import RobotSession
from app.web.app_state import CurrentSession, CurrentState
from app.web.client_cookie import keep, visitor, welcomed
from app.web.described import FORM, JSON, described_body, errors, fields
from app.web.request_body import as_model, body_of, form_of, json_of, kind_of

router = APIRouter()

ACTS: Final[list[JsonValue]] = ["take", "ask", "give", "keep", "release"]
Act = Annotated[str, Path(json_schema_extra={"enum": ACTS})]
ASKER: Final = r"^[0-9a-f]{0,12}$"

# A form's browser shows that it is there by loading its page anew, at the latest after this time.
FORM_LIFE_S: Final = 35.0
FORM_FIELDS_MOST: Final = 8


class Acting(BaseModel):
    """`to` is the id of who asks, for `give` and `keep`: the request that the operator saw; `at` is
    when it was touched, in the server's own time."""

    model_config = ConfigDict(extra="forbid")

    to: Annotated[str, Field(pattern=ASKER)] = ""
    page: Annotated[str, Field(pattern=ID)] | None = None
    at: AwareDatetime | None = None


class Here(BaseModel):
    """`touched`: the operator touched the page since it said so last."""

    model_config = ConfigDict(extra="forbid", strict=True)

    touched: bool = False


Fields = TypeVar("Fields", bound=BaseModel)


class ControlAnswer(BaseModel):
    """What came of an act: `browser` is the id of who asked, `reason` is "" where it was done."""

    done: bool
    reason: str
    browser: str
    control: dict[str, bool | str]


@router.post(
    "/control/here",
    status_code=204,
    summary="The holder's or asker's page is still there",
    responses=errors(403, 404, 408, 413, 422),
    openapi_extra=described_body(Here, None, required=False),
)
async def here(request: Request, state: CurrentState, session: CurrentSession) -> Response:
    _required(session)
    session.control.keepalive(visitor(request, state), (await _given(Here, request)).touched)
    return Response(status_code=204)


@router.post(
    "/control/{act}",
    response_model=ControlAnswer,
    summary="Take, ask for, give, keep or release control of the robot",
    responses=errors(403, 404, 408, 413, 422)
    | {
        303: {"description": "of a form: back to the page"},
        409: {"model": ControlAnswer, "description": "it was not done"},
    },
    openapi_extra=described_body(
        Acting, fields(to={"pattern": ASKER}, page={"pattern": ID}), required=False
    ),
)
async def act(act: Act, request: Request, state: CurrentState, session: CurrentSession) -> Response:
    _required(session)
    who = visitor(request, state)
    _, token = welcomed(request, state)  # without a cookie nothing is done yet, the next time it is
    form = kind_of(request) == FORM
    given = await _given(Acting, request)
    reason = "" if form or given.at is None else _late(session, act, given.at.timestamp())
    refusal = "" if reason else _done(session, act, who, given.to, FORM_LIFE_S if form else LIFE_S)
    reason = say(refusal) if refusal else reason
    session.show()
    if form:
        page = session.panel.page(given.page or "") or session.panel.pages[0]
        query = f"?control={refusal}" if refusal else ""
        answer: Response = RedirectResponse(f"{session.base}/pages/{page.id}{query}", status_code=303)
    else:
        body = {"done": not reason, "reason": reason, "browser": who.client.id}
        content = body | {"control": session.control.view()}
        answer = JSONResponse(content, status_code=409 if reason else 200)
    return keep(answer, request, token)


def _required(session: RobotSession) -> None:
    if not session.control.rules.required:
        raise NotFound("on this panel nobody needs control: its file has no [control] required = true")


def _done(session: RobotSession, act: str, who: Principal, to: str, life_s: float) -> Refusal:
    control = session.control
    match act:
        case "take":
            return control.take(who, life_s)
        case "ask":
            return control.ask(who, life_s)
        case "give":
            return control.give(who, to)
        case "keep":
            return control.keep(who, to)
        case "release":
            return control.release(who)
    raise NotFound(f'there is no "/control/{act:.40}": there is take, ask, give, keep, release, here')


def _late(session: RobotSession, act: str, at: float) -> str:
    """Why what was touched then is not done any more; giving up is never too late."""
    return "" if act == "release" else session.press_guard.late(at)


async def _given(model: type[Fields], request: Request) -> Fields:
    """The body as a model: JSON, a form, or nothing at all."""
    kind, body = kind_of(request), await body_of(request)
    if kind == FORM:
        return as_model(model, form_of(body, FORM_FIELDS_MOST))
    if kind not in (JSON, ""):
        raise InputError(f'the body must be "{JSON}" or "{FORM}", not "{kind}"')
    return as_model(model, json_of(body or b"{}"))
