"""The lines of a log: each browser asks for those that it shows, while it shows them."""

from typing import Annotated, Any, Final

from fastapi import APIRouter, Query, Request
from pydantic import BaseModel

from app.clock import format_time
from app.i18n import render, say
from app.panel.widgets.log_view import LEVELS, Level, LogView
from app.robot.log_lines import Line, Wanted
from app.ros_logging import NODE_NAME
from app.runtime.robot_session import RobotSession
from app.web.app_state import CurrentSession
from app.web.language import language_of
from app.web.openapi_parts import errors

router = APIRouter()

Text = Annotated[str, Query(max_length=100)]
WORDS: Final = {
    "debug": say("rosout_debug"),
    "info": say("rosout_info"),
    "warn": say("rosout_warn"),
    "error": say("rosout_error"),
    "fatal": say("rosout_fatal"),
}
RENDERED: Final = 20  # lines of a page as it is rendered


class LogLine(BaseModel):
    """`level` is ROS 2's word for it, `word` that of the reader's language."""

    number: int
    time: str
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
    of = session.panel.widget(widget, LogView)
    wanted = _wanted(of, level or of.level, node or of.node, search)
    kept = session.robot.log_lines[session.robot.key(of.topic)]
    found = await kept.find(wanted, after, of.lines)
    language = language_of(request)
    note = render(say("rosout_left_out", number=found.left_out), language) if found.left_out else ""
    said = [LogLine.model_validate(_said(*one, language)) for one in found.lines]
    return Lines(lines=said, left_out=found.left_out, note=note, last=found.last)


def rendered(session: RobotSession, widget: LogView, language: str) -> list[dict[str, Any]]:
    """The newest lines of a page as it is rendered."""
    kept = session.robot.log_lines[session.robot.key(widget.topic)]
    wanted = _wanted(widget, widget.level, widget.node, "")
    return [_said(*one, language) for one in kept.newest(wanted, RENDERED).lines]


def _wanted(widget: LogView, level: Level, node: str, search: str) -> Wanted:
    severity = 10 * LEVELS.index(level) + 10 if level != "debug" else 0
    return Wanted(severity, node, search, "" if widget.own else NODE_NAME)


def _said(number: int, line: Line, language: str) -> dict[str, Any]:
    return {
        "number": number,
        "time": render(format_time(line.stamp), language),
        "level": line.level,
        "word": render(WORDS[line.level], language),
        "node": line.node,
        "text": line.text,
    }
