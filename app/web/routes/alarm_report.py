"""The shift report, as a page to be printed."""

import asyncio
import secrets
from functools import partial
from typing import Annotated, Final
from urllib.parse import quote, urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, RedirectResponse, Response
from pydantic import AwareDatetime, BaseModel, ConfigDict, Field

from app.alarms.report import read_report
from app.alarms.shifts import Shift
from app.alarms.state_times import StatePeriod, read_states
from app.audit import Filter, OperatorLog, Row
from app.commands.act_receipt import ActReceipt
from app.commands.acts import ActRequest
from app.commands.control_acts import TOO_OFTEN
from app.commands.press import PRESS_ID
from app.commands.shift_acts import LONGEST_MESSAGE, SHIFT_ACTION
from app.web.act_answer import ActAnswer, act_answer
from app.web.app_state import AppState, CurrentState
from app.web.client_cookie import principal_with_new_token, set_client_cookie
from app.web.framed_page import FramedPage, framed_page
from app.web.openapi_parts import described_body, errors, fields, refusals
from app.web.rendering.alarm_report_page import COUNTED, ReportParts, now, report_context
from app.web.rendering.alarm_report_query import ReportQuery
from app.web.rendering.alarms_page import word
from app.web.rendering.log_words import word as log_word
from app.web.request_body import act_body_of, as_model
from app.web.routes.alarm_history import read_figures_of

router = APIRouter()

FORM_FIELDS_MOST: Final = 10
MESSAGES_READ: Final = 20  # of two shifts, the newest


class MessageBody(BaseModel):
    """The same `id` again is the same message. `at` is when it was touched, in the server's time."""

    model_config = ConfigDict(extra="forbid")

    text: Annotated[str, Field(max_length=LONGEST_MESSAGE)]
    id: Annotated[str, Field(pattern=PRESS_ID)] | None = None
    at: AwareDatetime | None = None


class MessageReceipt(ActAnswer):
    """The receipt: `reason` is "" where it was done, `code` is its stable name."""


@router.get(
    "/alarms/report",
    response_class=HTMLResponse,
    summary="The shift report: alarms, presses and states of the machine in a time",
    responses=errors(403, 422, 429, 503),
)
async def report(
    request: Request, state: CurrentState, wanted: Annotated[ReportQuery, Query()]
) -> Response:
    at, panel = now(), state.fleet.panel
    shift = wanted.times(at, panel.alarm_rules.shifts)
    alarms = state.fleet.alarms.history
    end = min(shift.until, at)
    parts = ReportParts(
        await read_figures_of(state, shift.since, end),
        await alarms.read(partial(read_report, since=shift.since, until=end)),
        await _states(state, wanted.robot, shift.since, end),
        await _log_rows(state, shift),
        await _messages(state, wanted.before(at, panel.alarm_rules.shifts), shift),
    )
    context = report_context(panel, wanted, shift, parts, at)
    query = urlencode(wanted.model_dump(exclude={"act"}, exclude_defaults=True))
    path = f"alarms/report?{query}"
    page = FramedPage("alarm-report.html", word("report_title"), alarms_page=path)
    receipt = state.fleet.first.shift_acts.receipt(wanted.act)
    refused = TOO_OFTEN if wanted.act == TOO_OFTEN.code else receipt.reason if receipt else ""
    texts = {"word": word, "log_word": log_word, "refused_message": refused}
    return framed_page(request, state, page, {**context, **texts})


@router.post(
    "/alarms/report",
    response_model=MessageReceipt,
    summary="Leave a message to the next shift",
    responses=errors(408, 413, 422)
    | refusals(MessageReceipt)
    | {
        303: {"description": "of a form: back to the report, with the receipt's id if it was refused"},
        503: {"model": MessageReceipt, "description": "the operator's log can't be written"},
    },
    openapi_extra=described_body(
        MessageBody,
        fields(id={"pattern": PRESS_ID}, text={"maxLength": LONGEST_MESSAGE}),
        required=True,
    ),
)
async def leave_message(request: Request, state: CurrentState) -> Response:
    is_form, content = await act_body_of(request, FORM_FIELDS_MOST)
    body = as_model(MessageBody, content)
    who, token = principal_with_new_token(request, state)
    runner = state.fleet.first.shift_acts
    act_id = body.id or secrets.token_hex(8)
    at = body.at.timestamp() if body.at and not is_form else None
    act = ActRequest("message", who, values={"text": body.text}, at=at, scripted=not is_form)
    if not state.limits.admit(who):
        receipt = runner.limited(act, act_id, TOO_OFTEN)
    else:
        with state.in_flight.track():
            receipt = await runner.act(act, act_id)
    return set_client_cookie(_answer(request, state, receipt, is_form), request, token)


def _answer(request: Request, state: AppState, receipt: ActReceipt, is_form: bool) -> Response:
    if is_form:
        shown = receipt.code if receipt.cause == "limit" else receipt.id
        query = f"?act={quote(shown, safe='')}" if receipt.reason else ""
        return RedirectResponse(f"{state.root}/alarms/report{query}", status_code=303)
    return act_answer(request, receipt)


async def _messages(state: AppState, before: Shift, shift: Shift) -> list[Row]:
    """The messages of a shift and of the one before it, the newest first; none without a log."""
    if not isinstance(state.log, OperatorLog):
        return []
    wanted = Filter(
        since=int(before.since * 1000),
        until=int(shift.until * 1000),
        outcome="succeeded",
        text=SHIFT_ACTION,
    )
    rows = await state.log.rows(wanted, None, MESSAGES_READ)
    return [row for row in rows if row.entry.action == SHIFT_ACTION]


async def _states(state: AppState, robot: str, since: float, until: float) -> list[StatePeriod]:
    """The states of a robot, or else of the first; none if the panel has no `[state]`."""
    if state.fleet.panel.state is None or state.fleet.states is None:
        return []
    first = state.fleet.first.entry
    name = robot or (first.id if first else "")
    return await asyncio.to_thread(read_states, state.fleet.states, name, since, until)


async def _log_rows(state: AppState, shift: Shift) -> list[Row]:
    """The newest entries of the operator's log; none without a log."""
    if not isinstance(state.log, OperatorLog):
        return []
    wanted = Filter(since=int(shift.since * 1000), until=int(shift.until * 1000))
    return await state.log.rows(wanted, None, COUNTED)
