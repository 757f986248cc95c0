"""Why a control is locked and what to do, as HTML: a page shows it beside a locked button."""

import time

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, Response

from app.cell.view.lock_help import LockHelp, lock_help, without_page
from app.panel.widgets.families import Command
from app.system.errors import NotFound
from app.system.texts import render, say
from app.web.app_state import AppState, CurrentSession, CurrentState
from app.web.assets import PICTURES
from app.web.caller import caller_of, only_shows
from app.web.requests import PAGE, errors

router = APIRouter()


@router.get(
    "/widgets/{widget}/lock",
    response_class=HTMLResponse,
    summary="Why a control is locked now, and what to do, as a part of a page",
    responses=errors(403, 404, 422)
    | {200: {"content": PAGE}, 204: {"description": "the control is not locked"}},
)
async def lock(widget: str, request: Request, state: CurrentState, session: CurrentSession) -> Response:
    command = next((command for command in session.panel.commands if command.id == widget), None)
    if command is None:
        raise NotFound(f'there is no control "{widget:.64}"')
    help_text = _help(command, request, state, session)
    headers = {"cache-control": "no-store"}
    if help_text is None:
        return Response(status_code=204, headers=headers)
    language = caller_of(request).language
    html = state.templates.render(
        "lock_help.html",
        language,
        lock=help_text,
        steps=[line for text in help_text.advice for line in render(text, language).splitlines()],
        to_do=say("lock_to_do"),
        pictures=f"{state.root}/static/{state.assets.revision}/{PICTURES}",
    )
    return HTMLResponse(html, headers=headers)


def _help(
    command: Command, request: Request, state: AppState, session: CurrentSession
) -> LockHelp | None:
    embedded = caller_of(request).embedded
    if only_shows(session.panel.embed, embedded):
        return without_page(command, say("page_embedded"))
    who = caller_of(request).principal
    conditions = session.press_guard.conditions(who)
    return lock_help(session.panel, command, session.robot, time.monotonic(), conditions)
