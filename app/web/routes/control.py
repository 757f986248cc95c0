"""Take, request, give and release control of a robot: JSON for scripts, forms without them."""

import secrets
from typing import Annotated, Final

from fastapi import APIRouter, Path, Request
from fastapi.responses import RedirectResponse, Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.commands.acts import ActReceipt, ActRequest
from app.cell.commands.control_acts import CONTROL_ACTS, TOO_OFTEN
from app.cell.commands.press import PRESS_ID
from app.cell.permission.control import for_role, role
from app.cell.session.session import RobotSession
from app.panel.base import ID
from app.records.principal import Principal
from app.system.errors import NotFound
from app.web.answers import ActAnswer, act_answer
from app.web.app_state import CurrentSession, CurrentState
from app.web.caller import caller_of
from app.web.requests import FormFields, Moment, act_body_of, as_model, described_body, errors, refusals

router = APIRouter()

Act = Annotated[str, Path(json_schema_extra={"enum": list(CONTROL_ACTS)})]
ASKER: Final = r"^[0-9a-f]{0,12}$"

FORM_FIELDS_MOST: Final = 8
ACT_FORM: Final = FormFields(
    {"to": {"pattern": ASKER}, "page": {"pattern": ID}, "id": {"pattern": PRESS_ID}}
)


class Acting(BaseModel):
    """`to` is the id of the requester that the operator saw, for `give` and `keep`; `at` is when it was
    touched, in the server's own time. The same `id` again is the same act."""

    model_config = ConfigDict(extra="forbid")

    to: Annotated[str, Field(pattern=ASKER)] = ""
    page: Annotated[str, Field(pattern=ID)] | None = None
    at: Moment | None = None
    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None


class KeepAlive(BaseModel):
    """`touched`: the operator has touched the page since its last such message."""

    model_config = ConfigDict(extra="forbid", strict=True)

    touched: bool = False


class ControlAnswer(ActAnswer):
    """The receipt of an act: `reason` is "" where it was done, `code` is its stable name; `browser` is
    the id of the client, `control` who has control now."""

    browser: str
    control: dict[str, bool | str]


@router.post(
    "/control/here",
    status_code=204,
    summary="The holder's or asker's page is still there",
    responses=errors(403, 404, 408, 413, 422),
    openapi_extra=described_body(KeepAlive, None, required=False),
)
async def keep_alive(request: Request, state: CurrentState, session: CurrentSession) -> Response:
    _required(session)
    _, content = await act_body_of(request)
    who, touched = caller_of(request).principal, as_model(KeepAlive, content).touched
    for shown in (session, *state.fleet.sharing(session)):
        shown.control.keepalive(who, touched)
    return Response(status_code=204)


@router.post(
    "/control/{act}",
    response_model=ControlAnswer,
    summary="Take, ask for, give, keep or release control of the robot",
    responses=errors(404, 408, 413, 422)
    | refusals(ControlAnswer)
    | {
        303: {"description": "of a form: back to the page"},
        503: {"model": ControlAnswer, "description": "the operator's log can't be written"},
    },
    openapi_extra=described_body(Acting, ACT_FORM.schema, required=False),
)
async def act(act: Act, request: Request, state: CurrentState, session: CurrentSession) -> Response:
    _required(session)
    who = caller_of(request).principal
    # Without a cookie the act is refused; with this one the next succeeds.
    _, token = caller_of(request).identified()
    form, content = await act_body_of(request, ACT_FORM, FORM_FIELDS_MOST)
    body = as_model(Acting, content)
    # One rendered page has one id for all its buttons, and each button is an act of its own.
    act_id = (f"{body.id}.{act}" if form else body.id) if body.id else secrets.token_hex(8)
    at = None if form or body.at is None else body.at.timestamp()
    requested = ActRequest(act, who, body.to, at=at, scripted=not form)
    if not state.limits.admit(who):
        receipt = session.control_acts.limited(requested, act_id, TOO_OFTEN)
    else:
        with state.in_flight.track():
            receipt = await session.control_acts.act(requested, act_id)
    answer = _page(session, body.page, receipt) if form else _json(request, session, who, receipt)
    return caller_of(request).with_client_cookie(answer, token)


def _page(session: RobotSession, page_id: str | None, receipt: ActReceipt) -> Response:
    """A redirect to the page, which shows why the act was refused."""
    page = session.panel.page(page_id or "") or session.panel.pages[0]
    if receipt.cause == "limit":
        query = f"?control={receipt.code}"
    else:
        query = f"?control={receipt.id}" if receipt.reason else ""
    return RedirectResponse(f"{session.base}/pages/{page.id}{query}", status_code=303)


def _json(request: Request, session: RobotSession, who: Principal, receipt: ActReceipt) -> Response:
    control = session.control.view()
    shown = for_role(control, role(control, who, session.control.rules))
    return act_answer(request, receipt, browser=who.client.id, control=shown)


def _required(session: RobotSession) -> None:
    if not session.control.rules.required:
        raise NotFound("this panel does not require control: its file has no [control] required = true")
