"""Take, request, give and release control of a robot: JSON for scripts, forms without them."""

from dataclasses import replace
from typing import Annotated, Final

from fastapi import APIRouter, Path, Request
from fastapi.responses import Response
from pydantic import BaseModel, ConfigDict, Field

from app.cell.commands.control_acts import CONTROL_ACTS
from app.cell.commands.press import PRESS_ID
from app.cell.permission.control import for_role, role
from app.cell.session.session import RobotSession
from app.panel.base import ID
from app.system.errors import NotFound
from app.web.acts import ActBody, act_responses, sent_act
from app.web.answers import ActAnswer
from app.web.app_state import CurrentSession, CurrentState
from app.web.caller import caller_of
from app.web.requests import FormFields, act_body_of, as_model, described_body, errors

router = APIRouter()

Act = Annotated[str, Path(json_schema_extra={"enum": list(CONTROL_ACTS)})]
ASKER: Final = r"^[0-9a-f]{0,12}$"

ACT_FORM: Final = FormFields(
    {"to": {"pattern": ASKER}, "page": {"pattern": ID}, "id": {"pattern": PRESS_ID}}
)


class Acting(ActBody):
    """`to` is the id of the requester that the operator saw, for `give` and `keep`; `at` is when it was
    touched, in the server's own time. The same `id` again is the same act."""

    to: Annotated[str, Field(pattern=ASKER)] = ""
    page: Annotated[str, Field(pattern=ID)] | None = None


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
    responses=act_responses(ControlAnswer),
    openapi_extra=described_body(Acting, ACT_FORM.schema, required=False),
)
async def act(act: Act, request: Request, state: CurrentState, session: CurrentSession) -> Response:
    _required(session)
    sent = await sent_act(request, state, Acting, ACT_FORM)
    # Without a cookie the act is refused; with the one of its answer the next succeeds.
    sent = replace(sent, who=caller_of(request).principal)
    runner, asked = session.control_acts, sent.asked(act, sent.body.to)
    receipt = await sent.run(runner, asked, sent.act_id(act) if sent.form else sent.act_id())
    page = session.panel.page(sent.body.page or "") or session.panel.pages[0]
    control, browser = session.control.view(), sent.who.client.id
    shown = for_role(control, role(control, sent.who, session.control.rules))
    path = f"{session.base}/pages/{page.id}"
    return sent.answer(receipt, path, "control", browser=browser, control=shown)


def _required(session: RobotSession) -> None:
    if not session.control.rules.required:
        raise NotFound("this panel does not require control: its file has no [control] required = true")
