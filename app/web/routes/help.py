"""The page of help: what the signs of pages mean, and the version."""

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import HTMLResponse, Response

from app.i18n import say
from app.web.app_state import CurrentState
from app.web.framed_page import FramedPage, framed_page
from app.web.openapi_parts import errors
from app.web.rendering.help_page import signs

router = APIRouter()


@router.get(
    "/help",
    response_class=HTMLResponse,
    summary="What the signs of pages mean, and the version",
    responses=errors(403, 404, 422),
)
async def page(
    request: Request, state: CurrentState, robot: Annotated[str, Query(max_length=64)] = ""
) -> Response:
    shown = signs(state.fleet.panel.may_raise)
    framed = FramedPage("help.html", say("help_title"), robot, is_help=True)
    key = say("help_log_key", key=state.log.key) if state.log.key else ""
    return framed_page(request, state, framed, {"signs": shown, "log_key": key})
