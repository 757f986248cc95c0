"""Queries a node for its parameters again: without a request this ends at the first query that gets no
answer."""

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, RedirectResponse, Response
from pydantic import BaseModel

from app.system.texts import render
from app.web.app_state import CurrentSession, CurrentState, PageSession
from app.web.caller import caller_of
from app.web.requests import FORM, body_of, errors, kind_of
from app.web.routes.presses import page_after

router = APIRouter()


class ReadAnswer(BaseModel):
    """Whether the node is queried; its answer comes with the events. `reason` is why it is not."""

    asked: bool
    reason: str


@router.post(
    "/widgets/{widget}/read",
    response_model=ReadAnswer,
    status_code=202,
    summary="Ask the node of a parameter for it once more",
    responses=errors(403, 404, 408, 413, 422)
    | {
        303: {"description": "of a form: back to the page"},
        409: {"model": ReadAnswer, "description": "its node is not there"},
    },
)
async def read(
    widget: str, request: Request, state: CurrentState, session: CurrentSession, page: PageSession
) -> Response:
    await body_of(request)  # a page without scripts sends its whole form
    why = session.read_again(widget)
    if kind_of(request) == FORM:
        return RedirectResponse(page_after(state, page, widget, ""), status_code=303)
    answer = ReadAnswer(asked=not why, reason=render(why, caller_of(request).language))
    return JSONResponse(answer.model_dump(), status_code=409 if why else 202)
