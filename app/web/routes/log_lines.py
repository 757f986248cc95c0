"""The lines of a log: each browser asks for those that it shows, while it shows them."""

from typing import Annotated

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel, Field

from app.i18n import render, say
from app.panel.widgets.log_view import Level, LogView
from app.web.app_state import CurrentSession
from app.web.language import language_of
from app.web.openapi_parts import errors
from app.web.rendering.log_lines import line_values, wanted_lines

router = APIRouter()

Text = Annotated[str, Query(max_length=100)]


class LogLine(BaseModel):
    """`level` is ROS 2's word for it, `word` that of the reader's language."""

    number: int
    time: str
    at: Annotated[str, Field(description="the same as ISO 8601, with milliseconds and offset")]
    level: Level
    word: str
    node: str
    text: str


class Lines(BaseModel):
    """The newest last. `left_out`: so many more fit, or are not kept any more."""

    lines: list[LogLine]
    left_out: int
    note: str
    last: int


@router.get(
    "/widgets/{widget}/lines",
    response_model=Lines,
    summary="The newest lines of a log, those after a number, of a level, a node, with a text",
    responses=errors(403, 404, 422),
)
async def lines(
    widget: str,
    request: Request,
    session: CurrentSession,
    level: Level | None = None,
    node: Text = "",
    search: Text = "",
    after: Annotated[int, Query(ge=0)] = 0,
) -> Lines:
    view = session.panel.widget(widget, LogView)
    wanted = wanted_lines(view, level or view.level, node or view.node, search)
    kept = session.robot.log_lines[session.robot.key(view.topic)]
    result = await kept.find(wanted, after, view.lines)
    language = language_of(request)
    note = render(say("rosout_left_out", number=result.left_out), language) if result.left_out else ""
    shown = [LogLine.model_validate(line_values(*line, language)) for line in result.lines]
    return Lines(lines=shown, left_out=result.left_out, note=note, last=result.last)
