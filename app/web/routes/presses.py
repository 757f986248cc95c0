"""A press over HTTP as JSON; `press_forms` has what browsers without scripts send."""

import secrets
from collections.abc import Mapping
from typing import Annotated, Final

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, RedirectResponse, Response
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field, JsonValue, WithJsonSchema

from app.commands.press import EVENT_ID, MAX_ID_LENGTH, PRESS_ID, Press
from app.commands.press_limits import RETRY_AFTER_S
from app.commands.receipts import Receipt
from app.errors import InputError
from app.i18n import localized
from app.panel.widgets.families import PressCommand
from app.permission.principal import Principal
from app.runtime.robot_session import RobotSession
from app.web.app_state import AppState, CurrentSession, CurrentState, PageSession
from app.web.client_cookie import caller, principal_of
from app.web.confirmations import LONGEST_TOKEN, confirmed
from app.web.language import language_of
from app.web.openapi_parts import (
    FORM,
    JSON,
    PAGE,
    TEXT,
    Described,
    ErrorAnswer,
    described_body,
    errors,
    fields,
    refusals,
)
from app.web.receipt_answer import ReceiptAnswer
from app.web.rendering.display_choice import display_of
from app.web.request_body import as_model, body_of, form_of, json_of, kind_of
from app.web.routes.confirm_forms import PressForm, Reader
from app.web.routes.press_forms import page_after, pressed_by_form

router = APIRouter()

STATUS: Final[Mapping[str, int]] = {
    "": 200,
    "interlock": 409,
    "input": 422,
    "link": 503,
    "log": 503,
    "time": 504,
    "limit": 429,
    "role": 403,
}


# Pydantic's own has a reference within the model, which is not the description's.
INPUTS: Final = {"type": "object", "description": "values by the ids of inputs"}


class PressBody(BaseModel):
    """What a client posts as JSON; only `inputs` is needed."""

    model_config = ConfigDict(extra="forbid", title="Press")

    inputs: Annotated[dict[str, JsonValue], WithJsonSchema(INPUTS)]
    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    seen: Annotated[str, Field(pattern=EVENT_ID)] | None = None
    at: AwareDatetime | None = None
    confirmation: Annotated[str, Field(max_length=LONGEST_TOKEN)] = ""

    def press(self, widget: PressCommand, principal: Principal) -> Press[PressCommand]:
        """The press of a widget by a client. A press without an id gets one."""
        at = self.at.timestamp() if self.at else None
        press_id = self.id or secrets.token_hex(8)
        return Press(press_id, widget, self.inputs, principal, self.seen or "", at)


class Cancel(BaseModel):
    """What a client may post as JSON to cancel: the id of the goal's press; without it, it is the goal
    under way. What else comes with it is not judged: stopping stays easy."""

    press: str = ""


RECEIPTS: Final[Described] = (
    errors(404, 408, 413)
    | refusals(ReceiptAnswer)
    | {
        303: {"description": "of a form: back to the page, with the receipt on it"},
        409: {
            "model": ReceiptAnswer,
            "description": "refused: an interlock, who has control, no such goal",
        },
        503: {
            "model": ReceiptAnswer | ErrorAnswer,
            "description": "no way to the robot, or to the log",
        },
    }
)


@router.post(
    "/widgets/{widget}",
    response_model=ReceiptAnswer,
    summary="Press a widget",
    responses=RECEIPTS
    | {
        200: {"description": "done or under way; of a form: a page that asks first", "content": PAGE},
        422: {"model": ReceiptAnswer | ErrorAnswer, "description": "bad input"},
        504: {"model": ReceiptAnswer, "description": "no answer in time"},
    },
    openapi_extra=described_body(
        PressBody, {"type": "object", "additionalProperties": TEXT}, required=True
    ),
)
async def press(
    widget: str, request: Request, state: CurrentState, session: CurrentSession, page: PageSession
) -> Response:
    command = session.presses.widget(widget)
    who = principal_of(request, state)
    body = await body_of(request)
    kind = kind_of(request)
    if kind == JSON:
        posted = as_model(PressBody, json_of(body))
        pressed = confirmed(state, caller(request), posted.press(command, who), posted.confirmation)
        return _answer(request, await receipt_of_press(state, session, pressed))
    if kind == FORM:
        reader = Reader(language_of(request), display_of(request, state.fleet.panel))
        form = PressForm(who, form_of(body), caller(request).session, command, reader)
        return await pressed_by_form(state, page, session, form)
    raise InputError(f'a press is "{JSON}" or "{FORM}", not "{kind}"')


@router.post(
    "/widgets/{widget}/cancel",
    response_model=ReceiptAnswer,
    summary="Ask the robot to cancel an action's goal",
    responses=RECEIPTS | errors(422),
    openapi_extra=described_body(Cancel, fields(_press={}), required=False),
)
async def cancel(
    widget: str, request: Request, state: CurrentState, session: CurrentSession, page: PageSession
) -> Response:
    command = session.presses.widget(widget)
    who = principal_of(request, state)
    body, kind = await body_of(request), kind_of(request)
    form = kind == FORM
    press_id = ""
    if form:
        press_id = form_of(body).get("_press", "")
    elif kind == JSON and body:
        press_id = as_model(Cancel, json_of(body)).press
    canceling = Press("", command, {}, who)
    if state.limits.admit_cancel(who, session.base, widget, press_id[:MAX_ID_LENGTH]):
        receipt = await state.counted(session.presses.cancel(canceling, press_id))
    else:
        refusals = session.presses.early_refusals
        receipt = refusals.limited(canceling, "cancel_too_often", shown=form)
    if form:
        return RedirectResponse(page_after(state, page, widget, receipt.id), status_code=303)
    return _answer(request, receipt)


async def receipt_of_press(
    state: AppState, session: RobotSession, press: Press[PressCommand]
) -> Receipt:
    """The receipt of a press in JSON, from HTTP or from a WebSocket."""
    if not state.limits.admit(press.principal):
        return session.presses.early_refusals.limited(press)
    session.press_guard.receive(press)
    return await state.counted(session.presses.press(press))


def _answer(request: Request, receipt: Receipt) -> Response:
    content = localized(receipt.as_json(), language_of(request))
    headers = {"retry-after": str(RETRY_AFTER_S)} if receipt.cause == "limit" else None
    return JSONResponse(content, status_code=STATUS[receipt.cause], headers=headers)
