"""The shift report, as a page to be printed."""

import asyncio
from functools import partial
from typing import Annotated
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, Response

from app.alarms.report import read_report
from app.alarms.shifts import Shift
from app.alarms.state_times import StatePeriod, read_states
from app.audit import Filter, OperatorLog, Row
from app.web.app_state import AppState, CurrentState
from app.web.framed_page import FramedPage, framed_page
from app.web.openapi_parts import errors
from app.web.rendering.alarm_report_page import COUNTED, ReportParts, ReportQuery, now, report_context
from app.web.rendering.alarms_page import word
from app.web.rendering.log_words import word as log_word
from app.web.routes.alarm_history import read_figures_of

router = APIRouter()


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
    )
    context = report_context(panel, wanted, shift, parts, at)
    query = urlencode(wanted.model_dump(exclude={"act"}, exclude_defaults=True))
    path = f"alarms/report?{query}"
    page = FramedPage("alarm-report.html", word("report_title"), alarms_page=path)
    return framed_page(request, state, page, {**context, "word": word, "log_word": log_word})


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
