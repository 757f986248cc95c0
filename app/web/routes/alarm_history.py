"""The history of alarms as a page with a filter and figures, and as CSV; the figures as JSON."""

from contextlib import AsyncExitStack
from functools import partial
from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, JSONResponse, Response

from app.alarms.figures import Figures, read_figures
from app.alarms.history import read_page
from app.i18n import localized
from app.web.app_state import AppState, CurrentState
from app.web.exported import Exported
from app.web.framed_page import FramedPage, framed_page
from app.web.language import language_of
from app.web.openapi_parts import TEXT, errors
from app.web.rendering.alarm_figures import FiguresAnswer, figures_json
from app.web.rendering.alarm_history_page import (
    ROWS_ON_PAGE,
    HistoryQuery,
    TimesQuery,
    history_context,
    now,
)
from app.web.rendering.alarms_page import word
from app.web.rendering.log_words import word as log_word

router = APIRouter()


@router.get(
    "/alarms/history",
    response_class=HTMLResponse,
    summary="The history of alarms, the newest first",
    responses=errors(403, 422, 429, 503),
)
async def page(
    request: Request, state: CurrentState, wanted: Annotated[HistoryQuery, Query()]
) -> Response:
    read = partial(read_page, wanted=wanted.filter(now()), limit=ROWS_ON_PAGE + 1)
    shown = await state.fleet.alarms.history.read(read)
    figures = await read_figures_of(state, *wanted.times(now()))
    context = history_context(state.fleet.panel, wanted, shown, figures)
    path = f"alarms/history?{wanted.address()}"
    framed = FramedPage("alarm-history.html", word("history_title"), alarms_page=path)
    return framed_page(request, state, framed, {**context, "word": word, "log_word": log_word})


async def read_figures_of(state: AppState, since: float, until: float) -> Figures:
    """The figures of a time; LogError, TooMany."""
    alarms = state.fleet.alarms
    delays = {alarm.definition.id: alarm.definition.delays for alarm in alarms.engine.alarms.values()}
    read = partial(read_figures, since=since, until=until, now=now(), delays=delays)
    return await alarms.history.read(read)


@router.get(
    "/alarms/figures",
    response_model=FiguresAnswer,
    summary="Figures of the history of alarms, after EEMUA 191",
    responses=errors(403, 422, 429, 503),
)
async def figures(
    request: Request, state: CurrentState, wanted: Annotated[TimesQuery, Query()]
) -> Response:
    of_time = await read_figures_of(state, *wanted.times(now()))
    content = localized(figures_json(of_time), language_of(request))
    return JSONResponse(content, headers={"cache-control": "no-store"})


@router.get(
    "/alarms/history.csv",
    response_class=Response,
    summary="The history that the filter shows, as CSV",
    responses=errors(403, 422, 429, 503) | {200: {"content": {"text/csv": {"schema": TEXT}}}},
)
async def as_csv(
    request: Request, state: CurrentState, wanted: Annotated[HistoryQuery, Query()]
) -> Response:
    gzip = "gzip" in request.headers.get("accept-encoding", "")
    exports = state.fleet.alarms.history
    async with AsyncExitStack() as opened:
        export = await opened.enter_async_context(
            exports.export(wanted.filter(now()), gzip, language_of(request))
        )
        first = await export.start()
        return Exported(export, first, gzip, opened.pop_all(), "alarms")
